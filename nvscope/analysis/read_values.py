"""Variables whose values come one by one, as a person asks for them; nothing of them is imported before there is any.

Whoever tells such values is a row of ``SOURCES``: the pages of web visualization, databases of DataLoggers. What stands
there in the place of a list begins with a prefix of its own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

from msgspec import Struct

from nvscope.engine.told import Told
from nvscope.enumeration import first_few
from nvscope.errors import UsageError
from nvscope.name_patterns import expression_of
from nvscope.tracker.datalogger.on_demand import NAME as DATABASES
from nvscope.tracker.readings.observed import Observed
from nvscope.tracker.visu.on_demand import NAME as PAGES

if TYPE_CHECKING:
    from nvscope.tracker.readings.last_values import LastValues
    from nvscope.tracker.readings.readings import ReadValues, ReadVariable, Wanted
    from nvscope.tracker.readings.value_history import ValueHistory
    from nvscope.tracker.readings.values_at import ValuesAt
    from nvscope.tracker.variables.moment import Moment

_MOST_COMPARED, _MOST_NEAR = 1_000, 3


class ReadSource(Struct, frozen=True):
    """Whoever tells values one by one, ``name`` as in ``Told.parts``; with ``name/`` begins what stands for lists.

    ``read`` makes what finds them, ``wanted`` what tells which variables two patterns mean: of what stands for a list,
    without its beginning, and of the name. ``nobody`` begins the sentences that there is none of a name; between
    ``nothing`` and ``behind`` stands of which list nothing came.
    """

    name: str
    read: Callable[[Wanted | None], ReadValues]
    wanted: Callable[[str, str], Wanted]
    nobody: str
    nothing: str
    behind: str
    hint: str

    def names(self, text: str) -> bool:
        """Tell whether a person names a variable of it, or what stands for a list."""
        return text.strip().lower().startswith(f"{self.name}/")


def _read_pages(wanted: Wanted | None) -> ReadValues:
    from nvscope.tracker.visu.readings import ReadPages  # noqa: PLC0415

    return ReadPages(wanted)


def _on_pages(server: str, name: str) -> Wanted:
    """Tell by patterns of a controller and of a name or place; the name of a structure or array stands for all of it.

    Names are the same in any case, spaces do not count.
    """
    is_server = re.compile(expression_of(server), re.DOTALL).fullmatch
    is_name = re.compile(rf"\.?{expression_of(name.removeprefix('.'))}(?:[.\[].*)?", re.DOTALL).fullmatch

    def is_meant(variable: Any) -> bool:
        called = _plain(variable.name), _plain(variable.place)
        own = _plain(variable.list).removeprefix(f"{PAGES}/")
        return bool(is_server(own) and any(is_name(text) for text in called))

    return is_meant


def _read_rows(wanted: Wanted | None) -> ReadValues:
    from nvscope.tracker.datalogger.readings import ReadRows  # noqa: PLC0415

    return ReadRows(wanted)


def _in_databases(database: str, name: str) -> Wanted:
    """Tell by patterns of a database and of a name, whole or behind its last slash, as ``_on_pages`` does."""
    is_database = re.compile(expression_of(database), re.DOTALL).fullmatch
    is_name = re.compile(rf"{expression_of(name)}(?:[.\[].*)?", re.DOTALL).fullmatch

    def is_meant(variable: Any) -> bool:
        own = _plain(variable.list).removeprefix(f"{DATABASES}/")
        return bool(is_database(own) and any(is_name(_plain(text)) for text in (variable.name, variable.short_name)))

    return is_meant


SOURCES = (
    ReadSource(
        PAGES, _read_pages, _on_pages, "no page asked for a variable named", "no page asked", " for variables",
        "`nvscope report` tells which pages asked which controllers",
    ),
    ReadSource(
        DATABASES, _read_rows, _in_databases, "no database has a variable named", "no row came of", "",
        "`nvscope vars` without a name shows all of them",
    ),
)  # fmt: skip

Meant = Mapping[ReadSource, "Wanted | None"]
"""Of whom variables are meant, and what tells which; None: all of them."""


def read_source(text: str | None) -> ReadSource | None:
    """Return of whom a person names a variable, or what stands for a list; None where it is of lists."""
    return next((one for one in SOURCES if text is not None and one.names(text)), None)


def meant(name: str | None, listed: str | None = None) -> Meant:
    """Return which variables are meant by a name, and by what stands for a list; nothing where none can be.

    ``visu/10.0.0.5/NAME``, ``visu/10.0.0.5:NAME``, ``db/x.db/NAME``, or NAME, which all may have; None stands for all.
    """
    if name is None and listed is None:
        return dict.fromkeys(SOURCES)
    found: dict[ReadSource, Wanted | None] = {}
    for source in SOURCES:
        patterns = _patterns(source, name, listed)
        if patterns is not None:
            found[source] = source.wanted(*patterns)
    return found


def _patterns(source: ReadSource, name: str | None, listed: str | None) -> tuple[str, str] | None:
    if listed is not None and not source.names(listed):
        return None
    prefix = f"{source.name}/"
    whose = "*" if listed is None else _plain(listed).removeprefix(prefix).strip("/") or "*"
    if name is None:
        return whose, "*"
    if not source.names(name):
        return None if ":" in name or read_source(name) else (whose, _plain(name) or "\0")
    told = _plain(name).removeprefix(prefix)
    own, slash, rest = told.partition("/")
    if not slash:
        own, _, rest = told.rpartition(":")
    return own or rest or "*", rest if own else "*"


def meant_by_lists(listed: Sequence[str]) -> Meant:
    """Return which variables are meant by what stands for lists: all without any, none where only lists are named."""
    if not listed:
        return meant(None)
    found: dict[ReadSource, list[Wanted]] = {}
    for text in listed:
        for source, wanted in meant(None, text).items():
            assert wanted is not None
            found.setdefault(source, []).append(wanted)
    return {source: _any_of(several) for source, several in found.items()}


def _any_of(several: Sequence[Wanted]) -> Wanted:
    return lambda variable: any(one(variable) for one in several)


def nothing_meant(name: str, known: Iterable[ReadVariable]) -> UsageError:
    """Return the error that nobody told of a variable of a name, with those near it that are known."""
    known = list(known)
    source = read_source(name) or next(
        (one for one in SOURCES for variable in known if one.names(variable.list)), SOURCES[0]
    )
    names = list(dict.fromkeys(f"{one.list}/{one.name}" for one in known))[:_MOST_COMPARED]
    near = get_close_matches(name.strip(), names, _MOST_NEAR, 0.5) or names[:_MOST_NEAR]
    next_step = f"near it: {', '.join(near)}" if near else source.hint
    return UsageError(f"{source.nobody} '{name.strip()[:80]}'", next_step=next_step)


def nothing_asked(listed: str, known: Iterable[ReadVariable]) -> UsageError:
    """Return the error that nothing came of what stands for a list, with those of which something did."""
    source = read_source(listed) or SOURCES[0]
    lists = list(dict.fromkeys(one.list for one in known))
    return UsageError(
        f"{source.nothing} '{listed.strip()[:80]}'{source.behind}",
        next_step=f"there are {first_few(lists, _MOST_NEAR) or 'none'}",
    )


def last_values(wanted: Meant) -> Observed[LastValues]:
    """Return what observes the last values of variables that are meant."""

    def make(source: ReadSource, own: Wanted | None) -> LastValues:
        from nvscope.tracker.readings.last_values import LastValues  # noqa: PLC0415

        return LastValues(source.read(own))

    return Observed({one.name: partial(make, one, own) for one, own in wanted.items()})


def value_history(wanted: Meant, *, every: bool) -> Observed[ValueHistory]:
    """Return what observes the changes of variables that are meant; with ``every``, all their values."""

    def make(source: ReadSource, own: Wanted | None) -> ValueHistory:
        from nvscope.tracker.readings.value_history import ValueHistory  # noqa: PLC0415

        return ValueHistory(source.read(own), every=every)

    return Observed({one.name: partial(make, one, own) for one, own in wanted.items()})


class ReadAt:
    """Observes what variables that are meant were at a moment, which observes beside it, and in front of it.

    ``known`` are the values by name of who tells them, those alone of whom there was any.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, wanted: Meant, moment: Moment) -> None:
        self._wanted = wanted
        self._moment = moment
        self.known: dict[str, ValuesAt] = {}

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        until = max(self._moment.last_frame - told.first_frame + 1, 0) if len(told) else 0
        for source, wanted in self._wanted.items():
            part = told.parts.get(source.name)
            if part is None:
                if until and source.name in self.known:
                    self.known[source.name].count_all()
                continue
            from nvscope.tracker.readings.values_at import ValuesAt  # noqa: PLC0415

            if source.name not in self.known:
                self.known[source.name] = ValuesAt(source.read(wanted))
            self.known[source.name].take(told, part, until)


def _plain(text: str) -> str:
    return "".join(text.split()).lower()
