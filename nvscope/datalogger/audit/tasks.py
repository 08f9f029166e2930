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

_MOST_SHAPES = 2_000
"""So many sets of columns are looked at together; in tables of changes, nearly each row has its own."""

_MOST_JOINED = 500
"""So many sets of these may tell that variables belong together."""


class Tasks:
    """Groups of variables, found while rows are read; a group is named by the number of one of its variables."""

    def __init__(self, table: LogTable) -> None:
        # A counter is there, too, where a value is no number.
        self._columns = [one.column if one.counter is None else one.counter for one in table.variables]
        self._group = list(range(len(self._columns)))
        self._seen: set[int] = set()
        self._shapes = RowShapes(len(self._columns))
        self.merged: list[tuple[int, int]] = []
        """Groups that turned out to be one, since ``rows`` was called last: the one that is no more, and the other."""
        self.blank: Bool | None = None
        """Which rows of that chunk have no value at all, and may be of several groups; None where none may."""

    @property
    def groups(self) -> set[int]:
        """The groups of which there were rows."""
        return {self.of(variable) for variable in self._seen}

    def of(self, variable: int) -> int:
        """Return the group of a variable."""
        while self._group[variable] != variable:
            self._group[variable] = self._group[self._group[variable]]
            variable = self._group[variable]
        return variable

    def rows(self, chunk: Chunk) -> Iterator[tuple[int, I64 | None]]:
        """Yield each group that rows of a chunk are of, with these rows, None for all.

        Of a row without any value nobody knows whose it is: it may be a sample of each, and is in ``blank`` then.
        """
        self.merged, self.blank = [], None
        filled = [number for number, column in enumerate(self._columns) if not chunk.rows.is_empty(column)]
        if not filled:
            yield from self._of_one(min(self.groups, default=0), filled, chunk)
            return
        for row in {0, len(chunk) - 1}:
            self._join([number for number in filled if chunk.rows.filled(self._columns[number])[row]])
        if self._is_one(filled):
            yield from self._of_one(self.of(filled[0]), filled, chunk)
            return
        shape = self._shapes.of(len(chunk), ((number, chunk.rows.filled(self._columns[number])) for number in filled))
        shapes, first, which = np.unique(shape, return_index=True, return_inverse=True)
        groups = np.full(len(shapes), -1, np.int64)
        for start in range(0, len(shapes), _MOST_SHAPES):
            some = first[start : start + _MOST_SHAPES]
            own = np.array([chunk.rows.filled(self._columns[number])[some] for number in filled])
            self._seen.update(filled[at] for at in np.flatnonzero(own.any(axis=1)).tolist())
            any_of = own.any(axis=0)
            known = np.array([self.of(number) for number in filled])[:, np.newaxis]
            mixed = np.where(own, known, len(self._group)).min(axis=0) < np.where(own, known, -1).max(axis=0)
            for place in np.flatnonzero(mixed)[:_MOST_JOINED].tolist():
                self._join([filled[at] for at in np.flatnonzero(own[:, place]).tolist()])
            named = np.array([self.of(number) for number in filled])[own.argmax(axis=0)]
            groups[start : start + len(some)] = np.where(any_of, named, -1)
        groups = np.array([self.of(group) if group >= 0 else -1 for group in groups.tolist()], np.int64)
        of_row = groups[which]
        present = [group for group in dict.fromkeys(groups.tolist()) if group >= 0]
        if len(present) <= 1:
            yield from self._of_one(present[0] if present else min(self.groups, default=0), filled, chunk)
            return
        blank = of_row < 0
        self.blank = blank if blank.any() else None
        for group in present:
            yield group, np.flatnonzero((of_row == group) | blank)

    def _of_one(self, group: int, filled: list[int], chunk: Chunk) -> Iterator[tuple[int, I64 | None]]:
        """Yield rows of which all that have a value are of one group."""
        others = self.groups - {group}
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
        for other in sorted(others):
            yield other, np.flatnonzero(blank)

    def _is_one(self, filled: list[int]) -> bool:
        return self._seen.issuperset(filled) and len({self.of(number) for number in filled}) == 1

    def _join(self, variables: list[int]) -> None:
        self._seen.update(variables)
        for variable in variables[1:]:
            one, other = self.of(variables[0]), self.of(variable)
            if one != other:
                self._group[other] = one
                self.merged.append((other, one))
