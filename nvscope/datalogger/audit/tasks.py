"""Tasks: which variables are sampled together, and which rows are theirs.

In a row of one task, the columns of the others are NULL. Which variables belong together stands nowhere; those that
are stored in one row do. A value that is no number is NULL, too, so rows of one task need not have the same columns.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.datalogger.row_shapes import RowShapes
from dissectors.datalogger.tables import LogTable
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.tracker.datalogger.variable_groups import VariableGroups

_MOST_SHAPES = 2_000
"""So many sets of columns are looked at together; in tables of changes, nearly each row has its own."""

_MOST_JOINED = 500
"""So many sets of these may tell that variables belong together."""


class Tasks:
    """Groups of variables, found while rows are read; a group is named by the number of one of its variables."""

    def __init__(self, table: LogTable) -> None:
        # A counter is there, too, where a value is no number.
        self._columns = [one.column if one.counter is None else one.counter for one in table.variables]
        self._groups = VariableGroups(len(self._columns))
        self._shapes = RowShapes(len(self._columns))
        self.merged: list[tuple[int, int]] = []
        """Groups that turned out to be one, since ``rows`` was called last: the one that is no more, and the other."""
        self.blank: Bool | None = None
        """Which rows of that chunk have no value at all, and may be of several groups; None where none may."""

    def of(self, variable: int) -> int:
        """Return the group of a variable."""
        return int(self._groups.of[variable])

    def rows(self, chunk: Chunk) -> Iterator[tuple[int, I64 | None]]:
        """Yield each group that rows of a chunk are of, with these rows, None for all.

        Of a row without any value nobody knows whose it is: it may be a sample of each, and is in ``blank`` then.
        """
        self.merged, self.blank = [], None
        filled = [number for number, column in enumerate(self._columns) if not chunk.rows.is_empty(column)]
        if not filled:
            yield from self._of_one(min(self._groups.there, default=0), filled, chunk)
            return
        for row in {0, len(chunk) - 1}:
            in_row = [number for number in filled if chunk.rows.filled(self._columns[number])[row]]
            self._join(np.array(in_row, np.int64))
        if self._groups.are_one(np.array(filled)):
            yield from self._of_one(self.of(filled[0]), filled, chunk)
            return
        shape = self._shapes.of(len(chunk), ((number, chunk.rows.filled(self._columns[number])) for number in filled))
        shapes, first, which = np.unique(shape, return_index=True, return_inverse=True)
        groups, numbers = np.full(len(shapes), -1, np.int64), np.array(filled)
        for start in range(0, len(shapes), _MOST_SHAPES):
            some = first[start : start + _MOST_SHAPES]
            own = np.array([chunk.rows.filled(self._columns[number])[some] for number in filled])
            self._groups.seen[numbers[own.any(axis=1)]] = True
            any_of = own.any(axis=0)
            known = self._groups.of[numbers][:, np.newaxis]
            mixed = np.where(own, known, len(self._columns)).min(axis=0) < np.where(own, known, -1).max(axis=0)
            for place in np.flatnonzero(mixed)[:_MOST_JOINED].tolist():
                self._join(numbers[own[:, place]])
            named = self._groups.of[numbers][own.argmax(axis=0)]
            groups[start : start + len(some)] = np.where(any_of, named, -1)
        groups = np.where(groups >= 0, self._groups.of[groups], -1)
        of_row = groups[which]
        present = [group for group in dict.fromkeys(groups.tolist()) if group >= 0]
        if len(present) <= 1:
            yield from self._of_one(present[0] if present else min(self._groups.there, default=0), filled, chunk)
            return
        blank = of_row < 0
        self.blank = blank if blank.any() else None
        for group in present:
            yield group, np.flatnonzero((of_row == group) | blank)

    def _of_one(self, group: int, filled: list[int], chunk: Chunk) -> Iterator[tuple[int, I64 | None]]:
        """Yield rows of which all that have a value are of one group."""
        others = [other for other in self._groups.there if other != group]
        blank = np.ones(len(chunk), np.bool_)
        for number in filled if others else ():
            blank &= ~chunk.rows.filled(self._columns[number])
            if not blank.any():
                break
        if not others or not blank.any():
            yield group, None
            return
        self.blank = blank
        yield group, np.arange(len(chunk))
        for other in others:
            yield other, np.flatnonzero(blank)

    def _join(self, variables: I64) -> None:
        gone = self._groups.join(variables)
        self.merged += [(one, self.of(one)) for one in gone]
