"""What a chunk holds of one variable of a table of changes: its values, and their counters."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from dissectors.datalogger.tables import LoggedVariable
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.counts import counts_of


class Stored(Struct, frozen=True):
    """Rows with a counter, their counts, and in which rows there is a value.

    ``alone`` are rows with a value without a counter, which are ``uncounted``, or with one that is no count, which are
    ``no_count``; None where each value has its count, and each count its value.
    """

    rows: I64
    counts: I64
    valued: Bool
    alone: Bool | None
    uncounted: I64
    no_count: I64

    @property
    def is_paired(self) -> bool:
        """Whether each value has its count, and each count its value; there is one at least."""
        return self.alone is None and len(self.rows) > 0

    @property
    def are_alone(self) -> Bool:
        """``alone`` as a mask."""
        return np.zeros(len(self.valued), np.bool_) if self.alone is None else self.alone

    def counts_on(self, before: int) -> bool:
        """Return whether each count is one more than that before it, the first one of which is given."""
        counts = self.counts
        first = int(counts[0])
        return (
            0 < first == before + 1
            and int(counts[-1]) - first == len(counts) - 1
            and bool((counts[1:] - counts[:-1] == 1).all())
        )


def stored_of(variable: LoggedVariable, chunk: Chunk) -> Stored | None:
    """Return what a chunk holds of a variable, None where that is nothing."""
    assert variable.counter is not None
    if chunk.rows.is_empty(variable.counter) and chunk.rows.is_empty(variable.column):
        return None
    counted, valued = chunk.rows.filled(variable.counter), chunk.rows.filled(variable.column)
    rows = np.flatnonzero(counted)
    counts, good = counts_of(chunk.rows.cells(variable.counter, rows), chunk.rows.data)
    if good.all() and (counted == valued).all():
        return Stored(rows, counts, valued, None, rows[:0], rows[:0])
    alone = valued & ~counted
    uncounted = np.flatnonzero(alone)
    alone[rows[~good]] = True
    return Stored(rows[good], counts[good], valued, alone, uncounted, rows[~good])
