"""Which variables of lists the variables of a configuration are, and what their columns hold."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from enum import Enum

from msgspec import Struct

from dissectors.datalogger.tables import SQL_TYPES
from nvscope.datalogger.configuration import NamedVariable, Session
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import ListDefinition
from nvscope.definition.project_datalogger import DataLoggerSettings
from nvscope.definition.selection import lists_named, names_of_lists
from nvscope.definition.variables import Elementary, ScalarKind, String, scalar_of
from nvscope.errors import ConfigurationError, UsageError
from nvscope.list_key import ListKey
from nvscope.units import count_of

_MOST_NEAR, _MOST_COMPARED, _LONGEST = 3, 5_000, 200
_LEAST_LIKE = 0.75


class Content(Enum):
    """What the values of a column are."""

    INTEGER = "integer"
    REAL = "real"
    TEXT = "text"


class Logged(Struct, frozen=True):
    """A variable that is logged: ``uri`` names its column, ``element`` of the list ``key`` is where it comes from.

    ``declared`` is the type of the column.
    """

    uri: str
    key: ListKey
    element: str
    type: Elementary
    declared: str

    @property
    def content(self) -> Content:
        if isinstance(self.type, String):
            return Content.TEXT
        scalar = scalar_of(self.type)
        return Content.REAL if scalar and scalar.kind is ScalarKind.REAL else Content.INTEGER


class Resolved(Struct, frozen=True):
    """The variables of a session, by the names of their columns, and the mistakes in those that are left out."""

    logged: tuple[Logged, ...]
    left_out: tuple[ConfigurationError, ...]


class _Known(Struct, frozen=True):
    """An element of a list."""

    key: ListKey
    list_name: str
    name: str
    type: Elementary


def resolve(session: Session, layouts: Layouts, settings: DataLoggerSettings) -> Resolved:
    """Return where the variables of a session come from.

    What ``[datalogger.variables]`` says goes before names. By its name, ``Arp.Plc.Eclr/Prg1.Speed`` is a variable
    ``Prg1.Speed`` of any list, else ``Speed`` of a list ``Prg1``, else ``Speed`` of any list; letters are the same in
    any case. What several lists have is a mistake, as is what none has.
    """
    names = _Names(layouts, settings)
    logged, left_out = [], []
    for variable in session.variables:
        try:
            logged.append(names.find(variable))
        except ConfigurationError as error:
            left_out.append(error)
    # As controllers order the columns.
    return Resolved(tuple(sorted(logged, key=lambda one: one.uri)), tuple(left_out))


def declared_type(kind: Elementary) -> str | None:
    """Return what the column of a type is declared as, None where the type is no elementary one."""
    if isinstance(kind, String):
        return SQL_TYPES["WSTRING" if kind.wide else "STRING"]
    scalar = scalar_of(kind)
    return SQL_TYPES.get(re.split(r"[\s(]", scalar.name, maxsplit=1)[0].upper()) if scalar else None


class _Names:
    """All elements of all lists, by their names in lower case."""

    def __init__(self, layouts: Layouts, settings: DataLoggerSettings) -> None:
        self._settings = settings
        self._told = dict(settings.variables)
        self._lists = names_of_lists(layouts)
        self._unplaced = layouts.unplaced
        self._by_name: dict[str, list[_Known]] = {}
        for known in _elements(self._lists, layouts):
            self._by_name.setdefault(_plain(known.name), []).append(known)

    def find(self, variable: NamedVariable) -> Logged:
        """Return the element that a variable is; ConfigurationError, with its place, where it is none or several."""
        given, tail = self._told.get(variable.uri), variable.uri.rpartition("/")[2]
        found, wanted = (self._given(variable, given), given) if given is not None else (self._named(tail), tail)
        if not found:
            raise self._nothing(variable, wanted)
        lists = sorted({str(one.key) for one in found})
        if len(lists) > 1:
            raise self._error(
                variable, f"{len(lists)} lists have a variable of this name: {', '.join(lists[:_MOST_NEAR])}",
                "Say which in the project file: [datalogger.variables] "
                f'"{variable.uri}" = "{lists[0]}:{found[0].name}".',
            )  # fmt: skip
        declared = declared_type(found[0].type)
        if declared is None or any(declared_type(one.type) != declared for one in found):
            kinds = " and ".join(dict.fromkeys(one.type.name for one in found))
            raise self._error(variable, f"{found[0].name} is {kinds}, which no column holds", "Leave it out.")
        return Logged(variable.uri, found[0].key, found[0].name, found[0].type, declared)

    def _named(self, tail: str) -> Sequence[_Known]:
        plain = _plain(tail)
        if found := self._by_name.get(plain):
            return found
        first, dot, rest = plain.partition(".")
        found = self._by_name.get(rest, []) if dot else []
        return [one for one in found if _plain(one.list_name) == first] or found

    def _given(self, variable: NamedVariable, given: str) -> Sequence[_Known]:
        listed, colon, name = given.rpartition(":")
        found = self._by_name.get(_plain(name), [])
        if not colon:
            return found
        try:
            keys = {key for key, _ in lists_named(self._lists, listed.strip(), self._unplaced)}
        except UsageError as error:
            raise self._error(variable, error.what, error.next_step) from None
        return [one for one in found if one.key in keys]

    def _nothing(self, variable: NamedVariable, wanted: str) -> ConfigurationError:
        plain = _plain(wanted.rpartition(":")[2])
        for name in (plain, plain.partition(".")[2]):
            parts = [
                known for text, known in self._by_name.items() if name and re.match(rf"{re.escape(name)}[.\[]", text)
            ]
            if parts:
                what = f"it has {count_of(len(parts), 'part')}, and a column holds one value"
                return self._error(variable, what, f"Name a part, such as {parts[0][0].name}.")
        what = "no list has a variable of this name"
        if variable.uri not in self._told and (given := near_name(variable.uri, self._told)):
            return self._error(variable, what, f"[datalogger.variables] has one near it: '{given[:_LONGEST]}'.")
        near = self._near(plain)
        if near:
            return self._error(variable, what, f"Near it: {', '.join(near)}.")
        return self._error(
            variable, what, "Name the exported lists with --gvl, or say in [datalogger.variables] which variable it is."
        )

    def _error(self, variable: NamedVariable, what: str, next_step: str) -> ConfigurationError:
        """Return a mistake in what a variable means, with the place of what says so."""
        given = self._told.get(variable.uri)
        if given is None:
            return _error(variable, what, next_step)
        what = f"[datalogger.variables] says '{given[:_LONGEST]}': {what}"
        return self._settings.mistake("variables", variable.uri, what, next_step, str(variable.position))

    def _near(self, plain: str) -> list[str]:
        last = plain.rpartition(".")[2]
        names = list(self._by_name)[:_MOST_COMPARED]
        same = [name for name in names if name.rpartition(".")[2] == last]
        near = get_close_matches(plain[:_LONGEST], same, _MOST_NEAR, 0.0)
        near += get_close_matches(plain[:_LONGEST], names, _MOST_NEAR, 0.6)
        near += get_close_matches(plain.partition(".")[2][:_LONGEST], names, _MOST_NEAR, 0.6)
        return [self._by_name[name][0].name for name in dict.fromkeys(near)][:_MOST_NEAR]


def _elements(lists: Iterable[tuple[ListKey, object]], layouts: Layouts) -> Iterator[_Known]:
    """Yield the elements of all lists, each name of a list once a type."""
    for key in dict.fromkeys(key for key, _ in lists):
        seen: dict[tuple[str, str, str], _Known] = {}
        for candidate in layouts.candidates_of(key):
            for layout in candidate:
                for element in layout.elements:
                    name = layout.list.name
                    seen.setdefault(
                        (name, element.name, element.type.name), _Known(key, name, element.name, element.type)
                    )
        yield from seen.values()


def near_name(name: str, known: Iterable[str]) -> str:
    """Return the name that is nearest to one, '' where none is: the same but for the case, or a letter or two.

    What names have in common in front of the last part makes them no nearer.
    """
    front, slash, last = name[:_LONGEST].lower().rpartition("/")
    lasts: dict[str, str] = {}
    for one in known:
        other_front, _, other = one.lower().rpartition("/")
        if get_close_matches(front + slash, [other_front + slash], 1, _LEAST_LIKE):
            lasts.setdefault(other, one)
    near = get_close_matches(last, lasts, 1, _LEAST_LIKE)
    return lasts[near[0]] if near else ""


def _plain(name: str) -> str:
    return "".join(name.split()).lower()


def _error(variable: NamedVariable, what: str, next_step: str) -> ConfigurationError:
    return ConfigurationError(
        f"Variable, attribute name: '{variable.uri}': {what}", where=str(variable.position), next_step=next_step
    )


def task_list(session: Session, logged: Sequence[Logged], layouts: Layouts, settings: DataLoggerSettings) -> ListKey:
    """Return the list in each of whose cycles a session takes its values; ConfigurationError where it is not known.

    It is what ``[datalogger.tasks]`` says, or the list of the task's name, or the one list of all its variables.
    """
    tasks, lists = dict(settings.tasks), names_of_lists(layouts)
    position = session.places.get("task", session.position)
    if session.task in tasks:
        return next(iter(list_of_task(session.task, settings, lists)))
    named = {key for key, entry in lists if entry.name.lower() == session.task.lower()}
    own = {one.key for one in logged}
    found = named if len(named) == 1 else own
    if len(found) == 1:
        return next(iter(found))
    if near := near_name(session.task, tasks):
        raise ConfigurationError(
            f"General, attribute taskContext: [datalogger.tasks] has no task '{session.task[:_LONGEST]}'",
            where=str(position), next_step=f"It has one near it: '{near[:_LONGEST]}'.",
        )  # fmt: skip
    names = ", ".join(sorted(entry.name or str(key) for key, entry in lists)[:_MOST_NEAR])
    raise ConfigurationError(
        f"General, attribute taskContext: which list the task '{session.task[:_LONGEST]}' sends is not known",
        where=str(position), next_step=f'Say it in the project file: [datalogger.tasks] "{session.task}" = "LIST"; '
        f"there are {names}.",
    )  # fmt: skip


def list_of_task(
    task: str, settings: DataLoggerSettings, lists: Sequence[tuple[ListKey, ListDefinition]]
) -> set[ListKey]:  # fmt: skip
    """Return the lists that the project file says a task sends; ConfigurationError where there is none."""
    try:
        return {key for key, _ in lists_named(lists, dict(settings.tasks)[task])}
    except UsageError as error:
        what = f'[datalogger.tasks] "{task[:_LONGEST]}": {error.what}'
        raise settings.mistake("tasks", task, what, error.next_step) from None
