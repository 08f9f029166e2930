"""Rows of reports that are read from what was measured of a stream, a list or a node."""

from __future__ import annotations

from collections.abc import Mapping

from nvscope.tracker.measured import Measured
from nvscope.view.documents.drawn import DrawnRow, Reads
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


def of_measured(figures: FigureRow) -> Mapping[str, Reads]:
    """Return how some figures are read of a ``MeasuredRow``, by key."""
    return {key: _reading(read) for key, read in figures.reads.items()}


def with_values(reads: Mapping[str, Reads], behind: FigureRow) -> Mapping[str, Reads]:
    """Return how a list is read with its variables (``values_of`` by key), which stand in front of some figures."""
    last = behind.reads
    return {
        **{key: read for key, read in reads.items() if key not in last},
        "values": lambda row: row.values_of.get(row.entry.key, []),
        **{key: read for key, read in reads.items() if key in last},
    }


def _reading(read: Reads) -> Reads:
    return lambda row: read(row.measured)
