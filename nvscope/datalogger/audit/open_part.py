"""The part of a table whose rows are being read: its intervals, and what of it may turn out to be a gap.

What is a gap is known when the part ends. Up to some ten thousand rows all are kept; behind them, those that are longer
than what is usual so far, as long as they are not too many.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit.gaps import Gaps, limit_ns
from nvscope.datalogger.audit.intervals import Intervals

_MOST_KEPT, _LEAST_KEPT = 200_000, 2_000
"""So many rows of all tasks may be kept as gaps perhaps, and so many of each of very many."""

_MOST_WHOLE = 50_000
"""So many of all tasks are kept whatever they are."""

_LEAST_WHOLE = 500


class OpenPart:
    """A part of one task; ``asked_ns`` is what the configuration says."""

    def __init__(self, asked_ns: int | None) -> None:
        self.intervals = Intervals()
        self._asked_ns = asked_ns
        self._whole: list[tuple[Gaps, Bool | None]] = []
        self._whole_count = 0
        self._kept: list[Gaps] = []
        self._kept_count = 0
        self._is_given_up = False
        self._passed_ns = 0
        """Up to how long what was not kept may have been."""

    def take(self, gaps: Gaps, in_doubt: Bool | None, tasks: int) -> None:
        """Take rows of one of so many tasks that all come later than those before, and which of them are in doubt."""
        if len(gaps):
            self._whole.append((gaps, in_doubt))
            self._whole_count += len(gaps)
            if self._whole_count > max(_LEAST_WHOLE, _MOST_WHOLE // tasks):
                self._sift()

    @property
    def is_begun(self) -> bool:
        """Whether it has intervals that were counted."""
        return self.intervals.count > 0

    def is_full(self, tasks: int) -> bool:
        """Whether so much may be a gap that it has to be decided now; the table has so many tasks."""
        if self._kept_count > most_kept(tasks):
            self._tidy()
        return self._kept_count > most_kept(tasks)

    def gaps(self) -> Gaps:
        """Return what may be gaps, and forget it."""
        self._sift()
        self._tidy()
        found = Gaps.joined(self._kept)
        self._kept, self._kept_count = [], 0
        return found

    def give_up(self) -> None:
        """Keep nothing of the rest: there is no interval to judge it by."""
        self._is_given_up = True
        self._kept, self._kept_count = [], 0

    def has_passed(self, interval_ns: int) -> bool:
        """Return whether gaps by an interval may not have been kept, since it seemed to be a longer one."""
        return self._is_given_up or self._passed_ns > limit_ns(interval_ns)

    def _sift(self) -> None:
        for gaps, in_doubt in self._whole:
            self.intervals.take(gaps.length_ns, in_doubt)
        if self._whole and not self._is_given_up:
            floor_ns = self._floor_ns()
            for gaps, _ in self._whole:
                long = gaps.length_ns > floor_ns
                if long.any():
                    self._kept.append(gaps.take(long))
                    self._kept_count += int(np.count_nonzero(long))
        self._whole, self._whole_count = [], 0

    def _tidy(self) -> None:
        kept = Gaps.joined(self._kept)
        self._kept = [kept.take(kept.length_ns > self._floor_ns())]
        self._kept_count = len(self._kept[0])

    def _floor_ns(self) -> int:
        found = int(floors_ns(np.array([self.intervals.median_ns or 0]), self._asked_ns)[0])
        self._passed_ns = max(self._passed_ns, found)
        return found


def most_kept(tasks: int) -> int:
    """Return how many rows of each of so many tasks may be kept as gaps perhaps."""
    return min(_MOST_KEPT, max(_LEAST_KEPT, _MOST_KEPT // tasks))


def floors_ns(median_ns: I64, asked_ns: int | None) -> I64:
    """Return how long intervals in parts may be that are no gaps, whatever interval these are judged by.

    The table's is asked where half of the intervals are within a quarter of it: it is four fifths of their median then
    at least, and what is late by it, longer than the median by a fifth.
    """
    own_ns = median_ns + median_ns // 5
    found: I64 = own_ns if asked_ns is None else np.minimum(own_ns, limit_ns(asked_ns))
    return found
