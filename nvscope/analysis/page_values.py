"""The variables of WebVisu pages, as a person asks for them; nothing of them is imported before there is any."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, ClassVar

from nvscope.engine.told import Told
from nvscope.errors import UsageError
from nvscope.tracker.visu.on_demand import NAME, PageObserver

if TYPE_CHECKING:
    from nvscope.tracker.variables.moment import Moment
    from nvscope.tracker.visu.last_values import LastValues
    from nvscope.tracker.visu.readings import ReadValues
    from nvscope.tracker.visu.value_history import ValueHistory
    from nvscope.tracker.visu.values_at import ValuesAt
    from nvscope.tracker.visu.variables import PageVariable

PREFIX = f"{NAME}/"
"""With this, names of variables of pages, and of controllers, begin."""

_MOST_COMPARED, _MOST_NEAR = 1_000, 3


@dataclass(frozen=True, slots=True)
class PageSelection:
    """Which variables of which controllers are meant; names are the same in any case, spaces do not count.

    ``*`` stands for any text and ``?`` for one character. The name of a structure or array stands for all that it has.
    """

    server: str = "*"
    name: str = "*"

    @property
    def wanted(self) -> Callable[[PageVariable], bool]:
        """Tells whether a variable is meant."""
        server = re.compile(_pattern(self.server), re.DOTALL).fullmatch
        name = re.compile(rf"\.?{_pattern(self.name.removeprefix('.'))}(?:[.\[].*)?", re.DOTALL).fullmatch

        def is_meant(variable: PageVariable) -> bool:
            called = _plain(variable.name), _plain(variable.place)
            return bool(server(_plain(variable.sender)) and any(name(text) for text in called))

        return is_meant


NO_PAGES = PageSelection("\0")
"""Nothing of any page."""


def is_of_pages(text: str) -> bool:
    """Tell whether a person names a variable of a page, or a controller with pages."""
    return text.strip().lower().startswith(PREFIX)


def selection(name: str | None, listed: str | None = None) -> PageSelection | None:
    """Return which variables of pages are meant by a name, and by what stands for a list; None where none can be.

    ``visu/10.0.0.5/NAME``, ``visu/10.0.0.5:NAME``, or NAME, which all controllers may have; None stands for all.
    """
    if listed is not None and not is_of_pages(listed):
        return None
    server = "*" if listed is None else _plain(listed).removeprefix(PREFIX).strip("/") or "*"
    if name is None:
        return PageSelection(server)
    if not is_of_pages(name):
        return None if ":" in name else PageSelection(server, _plain(name) or "\0")
    told = _plain(name).removeprefix(PREFIX)
    own, slash, rest = told.partition("/")
    if not slash:
        own, _, rest = told.rpartition(":")
    return PageSelection(own or rest or "*", rest if own else "*")


def nothing_meant(name: str, known: Iterable[PageVariable]) -> UsageError:
    """Return the error that no page asked for a variable of a name, with those near it that are known."""
    names = list(dict.fromkeys(f"{one.list}/{one.name}" for one in known))[:_MOST_COMPARED]
    near = get_close_matches(name.strip(), names, _MOST_NEAR, 0.5) or names[:_MOST_NEAR]
    next_step = f"near it: {', '.join(near)}" if near else "`nvscope report` tells which pages asked which controllers"
    return UsageError(f"no page asked for a variable named '{name.strip()[:80]}'", next_step=next_step)


def nothing_asked(listed: str, read: ReadValues | None) -> UsageError:
    """Return the error that no page asked a controller for variables, with those that were asked."""
    lists = list(dict.fromkeys(one.list for one in read.variables.known)) if read else []
    more = f" and {len(lists) - _MOST_NEAR} more" if len(lists) > _MOST_NEAR else ""
    return UsageError(
        f"no page asked '{listed.strip()[:80]}' for variables",
        next_step=f"there are {', '.join(lists[:_MOST_NEAR]) or 'none'}{more}",
    )


def selection_of_lists(listed: Sequence[str]) -> Callable[[PageVariable], bool] | None:
    """Return what tells which variables of pages are meant by what stands for lists, all of them without any name.

    None where only lists are named.
    """
    meant = [one.wanted for text in listed if (one := selection(None, text)) is not None]
    if listed and not meant:
        return None
    return lambda variable: not meant or any(one(variable) for one in meant)


def last_page_values(meant: PageSelection | None) -> PageObserver[LastValues]:
    """Return what observes the last values of variables of pages; of none where nothing is meant."""

    def make() -> LastValues:
        from nvscope.tracker.visu.last_values import LastValues  # noqa: PLC0415

        return LastValues(None if meant == PageSelection() else _wanted(meant))

    return PageObserver(make)


def page_history(meant: PageSelection | None, *, every: bool) -> PageObserver[ValueHistory]:
    """Return what observes the changes of variables of pages; with ``every``, all their values."""

    def make() -> ValueHistory:
        from nvscope.tracker.visu.value_history import ValueHistory  # noqa: PLC0415

        return ValueHistory(_wanted(meant), every=every)

    return PageObserver(make)


class PagesAt:
    """Observes what variables of pages were at a moment, which observes beside it, and in front of it."""

    by_stream: ClassVar[bool] = False

    def __init__(self, meant: PageSelection | None, moment: Moment) -> None:
        self._meant = meant
        self._moment = moment
        self.known: ValuesAt | None = None

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        until = max(self._moment.last_frame - told.first_frame + 1, 0) if len(told) else 0
        part = told.parts.get(NAME)
        if part is None:
            if until and self.known is not None:
                self.known.count_all()
            return
        from nvscope.tracker.visu.messages import VisuBatch  # noqa: PLC0415
        from nvscope.tracker.visu.values_at import ValuesAt  # noqa: PLC0415

        assert isinstance(part, VisuBatch)
        if self.known is None:
            self.known = ValuesAt(_wanted(self._meant))
        self.known.take(told, part, until)


def _wanted(meant: PageSelection | None) -> Callable[[PageVariable], bool]:
    return (lambda _: False) if meant is None else meant.wanted


def _plain(text: str) -> str:
    return "".join(text.split()).lower()


def _pattern(wanted: str) -> str:
    return re.escape(wanted).replace(r"\*", ".*").replace(r"\?", ".")
