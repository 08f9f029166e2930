"""Changes: every change of some variables, in the order of the capture."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.analysis.inquiry import Inquiry, Watch
from nvscope.analysis.seen_lists import SeenLists
from nvscope.definition.selection import names_of_lists, select, unplaced_text
from nvscope.tracker.variables.history import Entry, History


class Changes:
    """The changes of the variables of a name; iterate once, then read ``history``, ``seen`` and ``source``.

    ``listed`` is the list, None for all that have such a variable. With ``every``, the values of each telegram, changed
    or not; ``expression`` is a filter. UsageError where nothing has the name, or no definition is given.
    """

    def __init__(
        self,
        inquiry: Inquiry,
        name: str,
        *,
        listed: str | None = None,
        every: bool = False,
        expression: str | None = None,
    ) -> None:
        self._inquiry = inquiry
        self._layouts = inquiry.defined_layouts()
        self.selection = select(self._layouts, name, listed)
        self._chosen = None if expression is None else inquiry.filter(expression)
        self.source = inquiry.open()
        self.history = History(self._layouts, self.selection.names_in, every=every)
        self.seen = SeenLists()

    @property
    def lists(self) -> list[tuple[str, str]]:
        """Keys, as reports write them, and names of the lists that have the variables."""
        keys = self.selection.lists()
        return [(str(key), known.name) for key, known in names_of_lists(self._layouts) if key in keys]

    @property
    def some_came(self) -> bool:
        """Whether any data telegram of these lists was seen."""
        keys = self.selection.lists()
        return any(self._layouts.key_of(key) in keys for key in self.history.read.lists)

    @property
    def unplaced(self) -> str:
        """What of the name cannot be shown, as a sentence; '' if nothing."""
        return unplaced_text(self.selection.unplaced) if self.selection.unplaced else ""

    def batches(self, watch: Watch | None = None) -> Iterator[Iterator[Entry]]:
        """Yield the changes of each batch in turn."""
        for _ in self._inquiry.run(self.source, [self.history, self.seen], self._chosen, watch=watch):
            yield self.history.entries()

    def __iter__(self) -> Iterator[Entry]:
        for entries in self.batches():
            yield from entries
