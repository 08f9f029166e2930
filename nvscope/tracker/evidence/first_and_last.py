"""FirstAndLast: which rows are kept of a table for which there is no room: a quarter of them the first, then the last.

What began long ago is told by the first, what happens now by the last: a capture that goes on for weeks must not stop
to see.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64

_FIRST_SHARE = 4
"""The first rows are this part of those that are kept."""

_SLACK_SHARE = 8
"""More than are kept by this part of them, before they are thrown away together."""


class FirstAndLast:
    """Keeps ``most`` rows."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._first = -(-most // _FIRST_SHARE)

    def is_full(self, rows: int) -> bool:
        """Tell whether so many rows are worth to be thrown away: that is done for many at once."""
        return rows > self.most + self.most // _SLACK_SHARE

    def kept(self, rows: int) -> I64:
        """Return which of so many rows are kept, rising."""
        if rows <= self.most:
            return np.arange(rows)
        return np.append(np.arange(self._first), np.arange(rows - self.most + self._first, rows))
