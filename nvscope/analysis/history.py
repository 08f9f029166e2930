"""Changes: every change of some variables, in the order of the capture."""

from __future__ import annotations

from collections.abc import Iterator
from heapq import merge
from typing import TYPE_CHECKING

from nvscope.analysis.inquiry import Inquiry, Watch
from nvscope.analysis.read_values import meant, nothing_meant, read_source, value_history
from nvscope.analysis.seen_lists import SeenLists
from nvscope.definition.selection import Selection, names_of_lists, select, unplaced_text
from nvscope.engine.run import Observer
from nvscope.errors import UsageError
from nvscope.tracker.variables.data_telegrams import DataTelegrams
from nvscope.tracker.variables.history import Entry, History

if TYPE_CHECKING:
    from nvscope.tracker.readings.value_history import ReadEntry


class Changes:
    """The changes of the variables of a name; iterate once, then read ``history``, ``seen`` and ``source``.

    ``listed`` is the list, None for all that have such a variable. With ``every``, the values of each telegram, changed
    or not; ``expression`` is a filter. UsageError where nothing has the name, or no definition is given.

    ``with_read``: variables whose values come one by one are meant, too, by ``read_ones``. Which there are is known in
    the end: where no list has the name, ``check`` raises what is raised at once without them; there is no ``history``
    then.
    """

    def __init__(
        self,
        inquiry: Inquiry,
        name: str,
        *,
        listed: str | None = None,
        every: bool = False,
        expression: str | None = None,
        with_read: bool = False,
    ) -> None:
        self._inquiry = inquiry
        self._name = name
        self._named_so = with_read and (read_source(name) or read_source(listed)) is not None
        self._problem: UsageError | None = None
        wanted = meant(name, listed) if with_read else {}
        self._any_meant = bool(wanted)
        self.read_ones = value_history(wanted, every=every)
        self.selection = self._select(listed)
        self._chosen = None if expression is None else inquiry.filter(expression)
        self.source = inquiry.open()
        self.history: History | None = None
        if self._problem is None:
            self.history = History(inquiry.defined_layouts(), self.selection.names_in, every=every)
        self.read = self.history.read if self.history else DataTelegrams(lambda _: False)
        self.seen = SeenLists()

    def _select(self, listed: str | None) -> Selection:
        try:
            if self._named_so:
                raise nothing_meant(self._name, ())
            return select(self._inquiry.defined_layouts(), self._name, listed)
        except UsageError as error:
            if not self._any_meant:
                raise
            self._problem = error
            return Selection()

    @property
    def read_alone(self) -> bool:
        """Whether only what comes one by one may have the variables."""
        return self._problem is not None

    @property
    def came_from_nobody(self) -> bool:
        """Whether neither a list is defined nor any value seen that comes one by one."""
        return self._inquiry.layouts is None and not self.read_ones.known

    def check(self) -> None:
        """Raise UsageError where nothing has the name, now that all was read."""
        known = self.read_ones.known.values()
        if self._problem is None or any(one.read.meant for one in known):
            return
        if known and (self._named_so or self._inquiry.layouts is None):
            raise nothing_meant(self._name, [variable for one in known for variable in one.read.known])
        raise self._problem

    @property
    def lists(self) -> list[tuple[str, str]]:
        """Keys, as reports write them, and names of the lists that have the variables."""
        keys = self.selection.lists()
        layouts = self._inquiry.layouts
        return [(str(key), known.name) for key, known in names_of_lists(layouts) if key in keys] if layouts else []

    @property
    def some_came(self) -> bool:
        """Whether any data telegram of these lists was seen."""
        keys, layouts = self.selection.lists(), self._inquiry.layouts
        return layouts is not None and any(layouts.key_of(key) in keys for key in self.read.lists)

    @property
    def unplaced(self) -> str:
        """What of the name cannot be shown, as a sentence; '' if nothing."""
        return unplaced_text(self.selection.unplaced) if self.selection.unplaced else ""

    def batches(self, watch: Watch | None = None) -> Iterator[Iterator[Entry | ReadEntry]]:
        """Yield the changes of each batch in turn."""
        observers: list[Observer] = [self.seen]
        observers += [self.history] if self.history is not None else []
        observers += [self.read_ones] if self._any_meant else []
        for _ in self._inquiry.run(self.source, observers, self._chosen, watch=watch):
            yield self._entries()

    def _entries(self) -> Iterator[Entry | ReadEntry]:
        of_lists: Iterator[Entry | ReadEntry] = self.history.entries() if self.history else iter(())
        read_ones = [one.entries() for one in self.read_ones.known.values()]
        return merge(of_lists, *read_ones, key=lambda entry: entry.frame) if read_ones else of_lists

    def __iter__(self) -> Iterator[Entry]:
        """Yield the changes of variables of lists."""
        for entries in self.batches():
            yield from (entry for entry in entries if isinstance(entry, Entry))
