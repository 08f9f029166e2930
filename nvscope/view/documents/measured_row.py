"""Rows of reports that are read from what was measured of a stream, a list or a node."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from nvscope.tracker.measured import Measured
from nvscope.view.documents.drawn import DrawnRow, Part, Reads, lists
from nvscope.view.documents.figures import FigureRow


class MeasuredRow(DrawnRow):
    """A row of which something was measured; that is looked up when the first figure of it is asked for."""

    __slots__ = ("_measured",)

    def __init__(self) -> None:
        super().__init__()
        self._measured: Measured | None = None

    @property
    def measured(self) -> Measured:
        """What was measured of it."""
        if self._measured is None:
            self._measured = self.measure()
        return self._measured

    def measure(self) -> Measured:
        """Look up what was measured of it."""
        raise NotImplementedError


def of_measured(figures: FigureRow) -> Part:
    """Return how some figures are read of a ``MeasuredRow``."""
    reads = {key: _reading(read) for key, read in figures.reads.items()}
    return Part(reads, figures.shape, lambda rows: figures.columns([row.measured for row in rows]))


def with_values(parts: Sequence[Part]) -> Sequence[Part]:
    """Return how a list is read with its variables (``values_of`` by key), which stand in front of the last part."""
    return *parts[:-1], lists(values=lambda row: row.values_of.get(row.entry.key, [])), parts[-1]


def _reading(read: Callable[[Measured], Any]) -> Reads:
    return lambda row: read(row.measured)
