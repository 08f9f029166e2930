"""Changes: how often values had changed, and which of them a database stores that holds changes only.

Changes are counted of every data set. One that is lost in the ring buffer leaves a step of more than 1 in the counts of
those behind it, by which an audit sees that changes were missed.
"""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from nvscope.datalogger.rows import Rows
from nvscope.expression.typed_columns import Numbers


class Counts:
    """Counts the changes of each variable: 0 for its first value, 1 more for each other value than the one before."""

    def __init__(self, variables: int, dtype: str) -> None:
        self._cells: Numbers = np.zeros(variables, dtype)
        self._counts = np.full(variables, -1, np.int64)

    def take(self, cells: Numbers, own: Bool | None) -> tuple[Numbers, I64]:
        """Return the values of data sets, (n, v), and the counts behind each.

        Where a value is not its data set's own, the one before stands in its place.
        """
        rows = len(cells)
        if own is not None:
            above = np.where(own, np.arange(rows)[:, np.newaxis], -1)
            last = np.maximum.accumulate(above, axis=0)
            cells = np.where(last >= 0, np.take_along_axis(cells, np.maximum(last, 0), axis=0), self._cells)
            known_before = np.concatenate([(self._counts >= 0)[np.newaxis], (last[:-1] >= 0) | (self._counts >= 0)])
        else:
            known_before = np.ones(cells.shape, np.bool_)
            known_before[0] = self._counts >= 0
        before = np.concatenate([self._cells[np.newaxis], cells[:-1]])
        changed = (cells != before) | ~known_before
        if own is not None:
            changed &= own
        counts = self._counts + np.cumsum(changed, axis=0)
        self._cells, self._counts = cells[-1].copy(), counts[-1].copy()
        return cells, counts

    @property
    def cells(self) -> Numbers:
        """The last values, to be changed in place."""
        return self._cells


class Changed:
    """Leaves of data sets what has changed since the one that was stored before."""

    def __init__(self, variables: int) -> None:
        self._counts = np.full(variables, -1, np.int64)
        self._lost = False

    def take(self, rows: Rows) -> Rows:
        """Return the rows with a change; ``own`` are the values that have changed.

        What was lost in front of a row without one, was lost in front of the next row.
        """
        if not len(rows):
            return rows
        stored = np.concatenate([self._counts[np.newaxis], rows.counts])
        if rows.own is not None:
            # Between two rows of a task stand rows of others, which do not store what it has changed.
            stored[1:][~rows.own] = -1
            stored = np.maximum.accumulate(stored)
        differs = rows.counts != stored[:-1]
        if rows.own is not None:
            differs &= rows.own
        kept = differs.any(axis=1)
        self._counts = stored[-1].copy()
        losses = np.cumsum(~rows.consistent)
        until = losses[kept]
        before_first = -1 if self._lost else 0
        consistent = until == np.append(before_first, until[:-1])
        self._lost = bool(losses[-1] > (until[-1] if len(until) else before_first))
        return replace(rows.take(kept), consistent=consistent, own=differs[kept])
