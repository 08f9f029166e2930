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
        found = np.zeros(len(time_ns), np.bool_)
        if not len(time_ns):
            return found
        first = 1 if self._last_ns is None else 0
        length = np.diff(time_ns, prepend=time_ns[0] if self._last_ns is None else self._last_ns)[first:]
        self._last_ns = int(time_ns[-1])
        known = len(self._lengths)
        lengths = np.concatenate([self._lengths, length])
        for place in range(min(USUAL_OF - known, len(length))):
            before = lengths[: known + place]
            if len(before) >= _LEAST:
                found[first + place] = self._are_late(before[np.newaxis], length[place : place + 1])[0]
        if len(lengths) > USUAL_OF:
            windows, behind = sliding_window_view(lengths, USUAL_OF)[:-1], lengths[USUAL_OF:]
            found[len(found) - len(behind) :] = self._are_late(windows, behind)
        self._lengths = lengths[-USUAL_OF:]
        found[first:] |= length < 0
        return found

    def _are_late(self, before: I64, length: I64) -> Bool:
        """Return which intervals are too long; ``before`` are those before each, a row an interval."""
        middle = before.shape[1] // 2
        # A length is above the share of the median only where it is above that of the least one: most are not.
        late: Bool = length * 100 > before.min(axis=1) * self._percent
        row = np.flatnonzero(late)
        if len(row):
            usual = np.partition(before[row], middle, axis=1)[:, middle]
            off = np.abs(before[row] - usual[:, np.newaxis])
            alike = np.count_nonzero(off * ALIKE_SHARE <= usual[:, np.newaxis], axis=1)
            late[row] = (length[row] * 100 > usual * self._percent) & (alike * REGULAR_SHARE >= before.shape[1])
        return late
