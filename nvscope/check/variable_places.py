"""Which variables a rule is for, each with the field that reads it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from msgspec import Struct

from nvscope.check.check import Setting
from nvscope.check.lists import names_of
from nvscope.check.parameters import Unfit, near
from nvscope.definition.layouts import Layouts
from nvscope.definition.sent_elements import typed
from nvscope.list_key import ListKey
from nvscope.name_patterns import fits, is_pattern
from nvscope.view.fields.field import TelegramField

MOST_VARIABLES = 10_000
_PREFIX = "var."


class VariablePlace(Struct, frozen=True):
    """A variable of a list, what it is called, and the field that reads it."""

    list: ListKey
    name: str
    field: TelegramField


class _Called(Struct, frozen=True):
    """A variable of a list: its name, that of its field, and what else it is called, in lower case."""

    list: ListKey
    name: str
    field: str
    called: Sequence[str]


class CalledVariables:
    """Variables, to be found by what they are called, with their list in front or without."""

    def __init__(self, variables: Iterable[_Called]) -> None:
        self._variables = list(variables)
        self._by_name: dict[str, dict[int, None]] = {}
        for number, one in enumerate(self._variables):
            for name in one.called:
                for whole in _wholes(name):
                    self._by_name.setdefault(whole, {})[number] = None

    def called(self, pattern: str) -> Iterator[_Called]:
        """Yield those that a pattern stands for: the name of a structure or an array stands for all that it has."""
        plain = "".join(pattern.lower().split()).removeprefix(_PREFIX)
        if not is_pattern(plain):
            yield from (self._variables[number] for number in self._by_name.get(plain, ()))
            return
        patterns = plain, f"{plain}.*", f"{plain}[*"
        for one in self._variables:
            if any(fits(own, text) for own in patterns for text in one.called):
                yield one

    def near(self, pattern: str) -> str:
        """Return which names come near to one that nothing is called."""
        return near(pattern, (name for one in self._variables for name in (one.field.removeprefix(_PREFIX), one.name)))


def _wholes(name: str) -> Iterator[str]:
    """Yield a name, and the names of all that it is a part of."""
    yield name
    for place, sign in enumerate(name):
        if sign in ".[" and place:
            yield name[:place]


def variable_places(setting: Setting, wanted: Sequence[str], key: str = "variable") -> list[VariablePlace]:
    """Return the variables that are called so behind a key, in the order of their lists; Unfit where nothing is.

    A name may have its list in front, and the prefix that it has in expressions; ``*`` and ``?`` stand for what they do
    everywhere.
    """
    known = setting.shared("variables", lambda: CalledVariables(_variables(setting)))
    found: dict[tuple[ListKey, str], VariablePlace] = {}
    for pattern in wanted:
        own = [place for one in known.called(pattern) if (place := _place(setting, one)) is not None]
        if not own:
            raise Unfit(
                f"no variable is called '{pattern}'", key,
                next_step=known.near(pattern) or "`nvscope gvl layout` shows all names of the definitions",
            )  # fmt: skip
        found |= {(one.list, one.name): one for one in own}
        if len(found) > MOST_VARIABLES:
            raise Unfit(f"these are more than {MOST_VARIABLES} variables", key, next_step="name fewer of them")
    return list(found.values())


def _variables(setting: Setting) -> Iterator[_Called]:
    for name in setting.series:
        own = name.removeprefix(_PREFIX)
        called = own, own.replace(".", ":", 1), own.partition(".")[2]
        yield _Called(ListKey.udp(0, 0), own, name, [one.lower() for one in called if one])
    if setting.layouts is not None and not setting.series:
        yield from _defined(setting.layouts)


def _defined(layouts: Layouts) -> Iterator[_Called]:
    for key, known in layouts.lists():
        names = dict.fromkeys((typed(known.name).lower(), known.name.lower()))
        for layout in (layout for candidate in layouts.candidates_of(key) for layout in candidate):
            for element in layout.elements:
                name = element.name.replace(" ", "")
                called = [name.lower(), *(f"{one}{sign}{name.lower()}" for one in names for sign in ".:")]
                yield _Called(key, element.name, f"{_PREFIX}{typed(known.name)}.{name}", called)


def _place(setting: Setting, one: _Called) -> VariablePlace | None:
    """Return a variable with its field; None where it is of another list, or no field reads it."""
    if setting.lists and not setting.series and not _is_of(one.list, setting.lists, setting.names):
        return None
    spelled = setting.fields.spelled(one.field)
    field = None if spelled is None else setting.fields[spelled]
    return None if field is None or field.refused else VariablePlace(one.list, one.name, field)


def _is_of(key: ListKey, patterns: Sequence[str], names: Mapping[ListKey, str]) -> bool:
    return any(fits(pattern, name) for pattern in patterns for name in names_of(key, names))
