"""Groups of variables of a table that stores every value: those that are stored in one row are of one task.

Which variables belong to a task stands nowhere. A value that is no number is NULL, as those of other tasks are, so rows
of one task need not have the same columns; variables that are in a row with the same one belong together, too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from dissectors.batch import I64, Bool

_MOST_ROWS = 2_000
"""So many rows are looked at together; in tables of changes, nearly each has other variables than those before."""

_MOST_JOINED = 500
"""So many of some rows may tell that variables belong together."""


class VariableGroups:
    """Groups that grow as rows are read.

    ``of`` names the group of each variable by the least number of one in it; ``seen`` tells which were in a row at all.
    """

    def __init__(self, variables: int) -> None:
        self.of: I64 = np.arange(variables)
        self.seen: Bool = np.zeros(variables, np.bool_)

    @property
    def there(self) -> list[int]:
        """The groups of which there were rows."""
        found: list[int] = _once(self.of[self.seen]).tolist()
        return found

    def are_one(self, variables: I64) -> bool:
        """Return whether some variables are all known to be of one group; of none, that is so."""
        own = self.of[variables]
        return bool(self.seen[variables].all() and (own == own[:1]).all())

    def join(self, variables: I64) -> list[int]:
        """Take the variables of a row; return the groups that are no more, since they are one with another now."""
        self.seen[variables] = True
        found = _once(self.of[variables])
        if len(found) < 2:
            return []
        self.of[np.isin(self.of, found)] = found[0]
        gone: list[int] = found[1:].tolist()
        return gone

    def join_rows(self, variables: I64, filled: Sequence[Bool], rows: I64) -> list[int]:
        """Take some rows; ``filled`` tells of each of some variables in which rows it is. Return as ``join`` does."""
        gone: list[int] = []
        for begin in range(0, len(rows), _MOST_ROWS):
            some = rows[begin : begin + _MOST_ROWS]
            gone += self._join_matrix(variables, np.array([one[some] for one in filled]))
        return gone

    def _join_matrix(self, variables: I64, filled: npt.NDArray[np.bool_]) -> list[int]:
        self.seen[variables[filled.any(axis=1)]] = True
        known = self.of[variables][:, np.newaxis]
        mixed = np.where(filled, known, len(self.of)).min(axis=0) < np.where(filled, known, -1).max(axis=0)
        gone: list[int] = []
        for place in np.flatnonzero(mixed)[:_MOST_JOINED].tolist():
            gone += self.join(variables[filled[:, place]])
        return gone


def _once(groups: I64) -> I64:
    """Return each group that occurs; ``np.unique`` takes longer, and numpy imports much for the first one."""
    return np.flatnonzero(np.bincount(groups))
