"""Intervals between the rows of one task: how long they usually are, and which of them are gaps.

The usual interval is known when all rows were read, so what may be a gap is kept until then, as long as it is not too
much; then the interval is what it was up to there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.tracker.datalogger.late_rows import LATE_PERCENT
from nvscope.tracker.readings.cadence import ALIKE_SHARE, REGULAR_SHARE

_WAITING = 50_000
"""So many intervals at least are counted together."""

_MOST_KEPT = 200_000
_MOST_VALUES = 1 << 18
_FEW = 36
"""Of fewer intervals, one alone may be another than the rest: two pauses among them may well be usual."""

_FEW_ALIKE_SHARE = 8
"""Those of few are alike within an eighth of the median: within a quarter, five of six are by chance, too."""

LEAST_ALIKE = 5
"""So many have to be alike before one that is not says anything."""

_PERHAPS = 11, 10
"""What is longer than the usual interval so far by this may turn out to be a gap."""


@dataclass(frozen=True, slots=True)
class Gaps:
    """Rows that come later than they should: how long after the one before, when that was, and of which file.

    ``number`` counts the rows of the task. ``told``: the logger says that data was lost before them.
    """

    length_ns: I64
    before_ns: I64
    rowid: I64
    number: I64
    file: I64
    told: Bool

    def __len__(self) -> int:
        return len(self.length_ns)

    def take(self, rows: Bool | I64) -> Gaps:
        """Return some of them."""
        return Gaps(*(getattr(self, name)[rows] for name in _COLUMNS))

    @staticmethod
    def joined(parts: list[Gaps]) -> Gaps:
        """Return several as one."""
        if not parts:
            none = np.zeros(0, np.int64)
            return Gaps(none, none, none, none, none, np.zeros(0, np.bool_))
        return Gaps(*(np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS))


_COLUMNS = ("length_ns", "before_ns", "rowid", "number", "file", "told")


@dataclass(frozen=True, slots=True)
class SetBack:
    """A row before which the clock was set back: its number, the time of the row before, and its own."""

    number: int
    before_ns: int
    time_ns: int


class Intervals:
    """The intervals of one task; ``asked_ns`` is what the configuration says, None where nobody knows it."""

    def __init__(self, asked_ns: int | None) -> None:
        self.asked_ns = asked_ns
        self._values: I64 = np.zeros(0, np.int64)
        self._counts: I64 = np.zeros(0, np.int64)
        self._waiting: list[I64] = []
        self._waiting_count = 0
        self._told: Counter[int] = Counter()
        """Those in front of which the logger says that data was lost, by their lengths, coarsely."""
        self._floor_ns: int | None = None
        self._kept: list[Gaps] = []
        self._kept_count = 0
        self._most_floor_ns = 0
        self._fixed_ns: int | None = None
        self._given_up = False
        self.count = 0

    @staticmethod
    def counted() -> Intervals:
        """Return intervals of which nobody asks for gaps."""
        found = Intervals(None)
        found.give_up()
        return found

    @property
    def median_ns(self) -> int | None:
        """The usual interval so far."""
        self._merge_waiting()
        if not self.count:
            return None
        place = np.searchsorted(np.cumsum(self._counts), (self.count + 1) // 2)
        return int(self._values[place])

    @property
    def is_regular(self) -> bool:
        """Whether there is a usual interval at all: telegrams that are sent on events have none.

        The fewer intervals there are, the fewer of them may be others: what comes in bursts seems to be regular, too,
        until there were many. Where the logger says that data was lost, it is no wonder that one is longer.
        """
        median_ns = self.median_ns
        if median_ns is None:
            return False
        self._merge_waiting()
        count = self.count - sum(many for length, many in self._told.items() if length > limit_ns(median_ns))
        share = _FEW_ALIKE_SHARE if count < _FEW else ALIKE_SHARE
        near = np.abs(self._values - median_ns) * share <= median_ns
        alike = int(self._counts[near].sum())
        others = count - alike
        if not others:
            return True
        most = max(1, 2 * count * count // _FEW**2)
        return alike >= LEAST_ALIKE and others <= most and alike * REGULAR_SHARE >= count

    def take(self, gaps: Gaps) -> None:
        """Take the intervals between rows, all of which are longer than nothing, as what may be gaps."""
        if not len(gaps):
            return
        self.count += len(gaps)
        self._waiting.append(gaps.length_ns)
        self._waiting_count += len(gaps)
        if gaps.told.any():
            lengths, counts = np.unique(_coarse(gaps.length_ns[gaps.told]), return_counts=True)
            self._told.update(dict(zip(lengths.tolist(), counts.tolist(), strict=True)))
        if self._floor_ns is None or self._waiting_count > max(_WAITING, len(self._values)):
            self._merge_waiting()
            self._floor_ns = self._floor()
        if self._given_up:
            return
        floor_ns = self._floor_ns
        self._most_floor_ns = max(self._most_floor_ns, floor_ns)
        long = gaps.length_ns > floor_ns
        if long.any():
            self._kept.append(gaps.take(long))
            self._kept_count += int(np.count_nonzero(long))
        if self._kept_count > _MOST_KEPT:
            self._tidy()

    def interval_ns(self, alone: bool) -> int | None:
        """Return the interval that rows are judged by; ``alone``: the table has no other task.

        The configuration does not say how long the cycle of each task is: of several, rows that come more often, or
        less often, than it asks for are judged by how they come. Rows that come irregularly are judged where it is
        theirs alone.
        """
        if self._fixed_ns is not None:
            return self._fixed_ns
        median_ns = self.median_ns
        if alone and self.asked_ns is not None and median_ns is not None:
            return self.asked_ns
        if median_ns is None or not self.is_regular:
            return None
        asked_ns = self.asked_ns or 0
        return median_ns if limit_ns(median_ns) < asked_ns else max(asked_ns, median_ns)

    def gaps(self, interval_ns: int) -> Gaps:
        """Return what turned out to be a gap, and forget it."""
        kept = Gaps.joined(self._kept)
        self._kept, self._kept_count = [], 0
        return kept.take(kept.length_ns > limit_ns(interval_ns))

    def is_incomplete(self, interval_ns: int) -> bool:
        """Return whether gaps may have passed when the interval seemed to be longer."""
        return self._given_up or self._most_floor_ns > limit_ns(interval_ns)

    def give_up(self) -> None:
        """Keep nothing of what may be a gap: there is no interval to judge it by."""
        self._kept, self._kept_count, self._given_up = [], 0, True

    def fix(self, interval_ns: int) -> None:
        """Have all that follows judged by an interval that is known now."""
        self._fixed_ns, self._floor_ns = interval_ns, limit_ns(interval_ns)

    @property
    def is_full(self) -> bool:
        """Whether so much may be a gap that it has to be decided now."""
        return self._kept_count > _MOST_KEPT

    def _floor(self) -> int:
        if self._fixed_ns is not None:
            return limit_ns(self._fixed_ns)
        floors = [limit_ns(self.asked_ns)] if self.asked_ns is not None else []
        if (median_ns := self.median_ns) is not None:
            floors.append(median_ns * _PERHAPS[0] // _PERHAPS[1])
        return min(floors)

    def _tidy(self) -> None:
        kept = Gaps.joined(self._kept)
        floor_ns = self._floor()
        self._kept = [kept.take(kept.length_ns > floor_ns)]
        self._kept_count = len(self._kept[0])

    def _merge_waiting(self) -> None:
        if self._waiting:
            values, counts = np.unique(np.concatenate(self._waiting), return_counts=True)
            self._waiting, self._waiting_count = [], 0
            self._merge(values, counts)

    def _merge(self, values: I64, counts: I64) -> None:
        both, which = np.unique(np.concatenate([self._values, values]), return_inverse=True)
        summed = np.bincount(which, np.concatenate([self._counts, counts]).astype(np.float64)).astype(np.int64)
        if len(both) > _MOST_VALUES:
            # Of two neighbours, the first one stands for both: that is less than any clock tells.
            if len(both) % 2:
                both, summed = np.append(both, both[-1]), np.append(summed, 0)
            both, summed = both[::2], summed[::2] + summed[1::2]
        self._values, self._counts = both, summed


def _coarse(length_ns: I64) -> I64:
    """Return lengths to a thousandth, so that there are not many of them."""
    step: I64 = np.maximum(1, 1 << np.maximum(0, np.frexp(length_ns.astype(np.float64))[1].astype(np.int64) - 11))
    return length_ns // step * step


def limit_ns(interval_ns: int) -> int:
    """Return how long after a row the next one may come."""
    return interval_ns * LATE_PERCENT // 100


def are_late(length_ns: I64, interval_ns: I64) -> Bool:
    """Return which lengths are longer than that for intervals of their own, however long they are."""
    more = LATE_PERCENT - 100
    found: Bool = length_ns - interval_ns > interval_ns // 100 * more + interval_ns % 100 * more // 100
    return found


def without_clock_sets(gaps: Gaps, set_back: Sequence[SetBack], interval_ns: int) -> Gaps:
    """Return gaps without those that are none, since the clock was set forward and back, or back and forward.

    Then the time from the row before to the row behind both is that of the rows between them: none is missing.
    """
    if not len(gaps) or not set_back:
        return gaps
    order = np.argsort(gaps.number, kind="stable")
    gaps = gaps.take(order)
    kept = np.ones(len(gaps), np.bool_)
    for one in set_back:
        place = int(np.searchsorted(gaps.number, one.number))
        if place:
            rows = one.number - int(gaps.number[place - 1]) + 1
            if _fits(one.time_ns - int(gaps.before_ns[place - 1]), rows, interval_ns):
                kept[place - 1] = False
        if place < len(gaps):
            rows = int(gaps.number[place]) - one.number + 1
            time_ns = int(gaps.before_ns[place]) + int(gaps.length_ns[place])
            if _fits(time_ns - one.before_ns, rows, interval_ns):
                kept[place] = False
    return gaps.take(kept)


def _fits(length_ns: int, rows: int, interval_ns: int) -> bool:
    """Return whether so many rows fill a time, of which the interval is known to a twentieth."""
    return 0 < length_ns <= rows * interval_ns * 21 // 20 + interval_ns // 2
