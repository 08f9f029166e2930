"""Cadence: how far apart the values of one variable usually are, and which of them come late."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from dissectors.batch import I64, Bool

USUAL_OF = 16
"""What is usual, the median of so many intervals before one says."""

_LEAST = 4
"""Before so many intervals, nobody knows what is usual."""

ALIKE_SHARE, REGULAR_SHARE = 4, 3
"""Values come at no regular interval, and none of them late, unless a third of the intervals are within a quarter of
the median."""


class Cadence:
    """Tells which values come late, later than ``late_percent`` of what is usual; however they are cut, the same."""

    def __init__(self, late_percent: int) -> None:
        self._percent = late_percent
        self._lengths: I64 = np.empty(0, np.int64)
        self._last_ns: int | None = None

    def late(self, time_ns: I64) -> Bool:
        """Return which of the values at some times, which follow those before, come late, or before those."""
        before_ns = self._last_ns
        late: Bool = self.over(time_ns) >= 0
        if len(time_ns):
            late |= np.diff(time_ns, prepend=time_ns[0] if before_ns is None else before_ns) < 0
        return late

    @property
    def until_ns(self) -> int | None:
        """Until when a value that follows would not come late; None where nobody knows."""
        if self._last_ns is None or len(self._lengths) < _LEAST:
            return None
        longest = int(self._longest(self._lengths[np.newaxis])[0])
        return None if longest < 0 else self._last_ns + longest

    def over(self, time_ns: I64) -> I64:
        """Return until when the values at some times, which follow those before, would not have come late.

        That is -1 of those that do not.
        """
        found = np.full(len(time_ns), -1)
        if not len(time_ns):
            return found
        first = 1 if self._last_ns is None else 0
        since_ns = np.append(time_ns[0] if self._last_ns is None else self._last_ns, time_ns[:-1])
        length = (time_ns - since_ns)[first:]
        self._last_ns = int(time_ns[-1])
        known = len(self._lengths)
        lengths = np.concatenate([self._lengths, length])
        for place in range(min(USUAL_OF - known, len(length))):
            before = lengths[: known + place]
            if len(before) >= _LEAST:
                found[first + place] = self._lasted(before[np.newaxis], length[place : place + 1])[0]
        if len(lengths) > USUAL_OF:
            windows, behind = sliding_window_view(lengths, USUAL_OF)[:-1], lengths[USUAL_OF:]
            found[len(found) - len(behind) :] = self._lasted(windows, behind)
        self._lengths = lengths[-USUAL_OF:]
        return np.where(found < 0, -1, since_ns + found)

    def _lasted(self, before: I64, length: I64) -> I64:
        """Return how long intervals may be that are longer, -1 of others; ``before`` are those before each."""
        found = np.full(len(length), -1)
        # A length is above the share of the median only where it is above that of the least one: most are not.
        row = np.flatnonzero(length * 100 > before.min(axis=1) * self._percent)
        if len(row):
            longest = self._longest(before[row])
            found[row] = np.where(length[row] > longest, longest, -1)
        return found

    def _longest(self, before: I64) -> I64:
        """Return how long an interval may be that is not too long, -1 where they are not regular."""
        middle = before.shape[1] // 2
        usual = np.partition(before, middle, axis=1)[:, middle]
        off = np.abs(before - usual[:, np.newaxis])
        alike = np.count_nonzero(off * ALIKE_SHARE <= usual[:, np.newaxis], axis=1)
        return np.where(alike * REGULAR_SHARE >= before.shape[1], usual * self._percent // 100, -1)
