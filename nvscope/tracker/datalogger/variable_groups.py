"""Groups of variables of a table that stores every value: those that are stored in one row are of one task.

Which variables belong to a task stands nowhere. A value that is no number is NULL, as those of other tasks are, so rows
of one task need not have the same columns; variables that are in a row with the same one belong together, too.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool


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
        found: list[int] = np.unique(self.of[self.seen]).tolist()
        return found

    def are_one(self, variables: I64) -> bool:
        """Return whether some variables are all known to be of one group; of none, that is so."""
        own = self.of[variables]
        return bool(self.seen[variables].all() and (own == own[:1]).all())

    def join(self, variables: I64) -> list[int]:
        """Take the variables of a row; return the groups that are no more, since they are one with another now."""
        self.seen[variables] = True
        found = np.unique(self.of[variables])
        if len(found) < 2:
            return []
        self.of[np.isin(self.of, found)] = found[0]
        gone: list[int] = found[1:].tolist()
        return gone
