"""Rhythms: parts of a table in which rows come less often than in the rest, since somebody configured it so.

Loggers go on with a table whatever interval their configuration says by then. Where they do, they say that data was
lost; so what stands between two rows that say this may have a rhythm of its own, and is judged by that.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit.intervals import Gaps, limit_ns
from nvscope.tracker.readings.cadence import ALIKE_SHARE, REGULAR_SHARE

_MOST_PARTS = 1 << 20
_MOST_JUDGED = 10_000
"""So many parts are judged by themselves."""

_FEW = 8
"""Of up to so many intervals, all have to be alike to be a rhythm."""


class Parts:
    """The parts of the rows of one task, by the numbers of the rows that begin them, which rise."""

    def __init__(self) -> None:
        self._begins: list[I64] = []
        self._count = self._decided = 0

    def begin(self, number: I64) -> None:
        """Note rows with which parts begin."""
        if len(number) and self._count <= _MOST_PARTS:
            self._count += len(number)
            self._begins.append(number)

    def forget(self) -> None:
        """Know of no parts any more, nor of those to come: rows have other numbers now."""
        self._begins, self._count = [], _MOST_PARTS + 1

    def without_slower(self, gaps: Gaps, rows: int, *, alone: bool) -> Gaps:
        """Return gaps that no row tells without those that are the rhythm of their part; there are ``rows`` so far.

        ``alone``: no other task has rows that begin parts of this one.
        """
        decided, self._decided = self._decided, rows
        if not len(gaps) or not self._begins or self._count > _MOST_PARTS:
            return gaps
        begins = np.concatenate(self._begins)
        part = np.searchsorted(begins, gaps.number, "right") - 1
        intervals = np.append(begins[1:], rows) - np.maximum(begins + 1, decided)
        count = np.bincount(part, minlength=len(begins))
        kept = np.ones(len(gaps), np.bool_)
        slower = 2 * count > intervals
        # A single interval is no rhythm, unless there is none beside it that says what is usual here.
        unlike = np.concatenate([[False], slower | (intervals <= 0), [False]])
        slower &= (intervals > 1) | (alone & (unlike[:-2] | unlike[2:]))
        for one in np.flatnonzero(slower)[:_MOST_JUDGED].tolist():
            own = np.flatnonzero(part == one)
            kept[own] = _late(gaps.length_ns[own], int(intervals[one]))
        return gaps.take(kept)


def _late(length_ns: I64, intervals: int) -> Bool:
    """Return which of the longest intervals of a part, more than half of all, are gaps by its own rhythm."""
    longest = np.sort(length_ns)
    # All others are shorter than any of these.
    median_ns = int(longest[max((intervals - 1) // 2 - (intervals - len(longest)), 0)])
    alike = int(np.count_nonzero(np.abs(longest - median_ns) * ALIKE_SHARE <= median_ns))
    if intervals <= _FEW:
        late: Bool = np.full(len(length_ns), alike < intervals)
        return late
    if alike * REGULAR_SHARE < intervals:
        return np.zeros(len(length_ns), np.bool_)
    return length_ns > limit_ns(median_ns)
