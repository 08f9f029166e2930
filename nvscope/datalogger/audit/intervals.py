"""Intervals between the rows of one task, of a table or a part of it: how long they usually are.

Rows without any value may be of any task, so an interval beside one of them is in doubt: where enough others are known,
these tell alone.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit.gaps import limit_ns
from nvscope.tracker.readings.cadence import ALIKE_SHARE, REGULAR_SHARE

_WAITING = 50_000
"""So many intervals at least are counted together."""

_MOST_VALUES = 1 << 18
FEW = 36
"""Of fewer intervals, one alone may be another than the rest: two pauses among them may well be usual."""

FEW_ALIKE_SHARE = 8
"""Those of few are alike within an eighth of the median: within a quarter, five of six are by chance, too."""

LEAST_ALIKE = 5
"""So many have to be alike before one that is not says anything."""

DOUBTFUL_SHARE = 20
"""Of those that are in doubt, one of so many may be another: some rows of other tasks among them make two lengths."""

NOTHING = -1
"""No interval is free of doubt."""


class Intervals:
    """Intervals by their lengths; it does not matter in which order they come."""

    def __init__(self) -> None:
        self._sure, self._in_doubt = _Lengths(), _Lengths()
        self._told: Counter[int] = Counter()
        """Those in front of which the logger says that data was lost, by their lengths, coarsely."""
        self._told_count = 0

    @staticmethod
    def joined(one: Intervals, other: Intervals) -> Intervals:
        """Return what two are together."""
        both = Intervals()
        both.join(one)
        both.join(other)
        return both

    @property
    def count(self) -> int:
        """How many tell what is usual."""
        return self._telling.count

    @property
    def median_ns(self) -> int | None:
        """The usual interval so far."""
        return self._telling.median_ns

    @property
    def is_regular(self) -> bool:
        """Whether there is a usual interval at all: telegrams that are sent on events have none.

        The fewer intervals there are, the fewer of them may be others: what comes in bursts seems to be regular, too,
        until there were many. Where the logger says that data was lost, it is no wonder that one is longer.
        """
        if self._are_sure:
            return self._alike_enough(self._sure)
        telling = self._telling
        if self._sure.median_ns is not None and self._sure.median_ns > limit_ns(telling.median_ns or 0):
            # The few that are no doubt say something else.
            return False
        return self._alike_enough(telling, DOUBTFUL_SHARE)

    @property
    def others(self) -> int:
        """How many are not as long as is usual."""
        telling = self._telling
        share = FEW_ALIKE_SHARE if telling.count < FEW else ALIKE_SHARE
        return telling.count - telling.near(telling.median_ns or 0, share)

    @property
    def sure_ns(self) -> int:
        """What those say that are no doubt where others are, ``NOTHING`` if there are none; 0 where none is asked."""
        return 0 if self._are_sure or self.is_regular else self._sure.median_ns or NOTHING

    def take(self, length_ns: I64, in_doubt: Bool | None = None) -> None:
        """Take lengths, all of which are longer than nothing, and which of them are ``in_doubt``."""
        if in_doubt is None or not in_doubt.any():
            self._sure.take(length_ns)
            return
        self._sure.take(length_ns[~in_doubt])
        self._in_doubt.take(length_ns[in_doubt])

    def take_told(self, length_ns: I64) -> None:
        """Take lengths of which the logger says that data was lost in them."""
        self._sure.take(length_ns)
        self._told_count += len(length_ns)
        if len(length_ns):
            lengths, counts = np.unique(_coarse(length_ns), return_counts=True)
            self._told.update(dict(zip(lengths.tolist(), counts.tolist(), strict=True)))

    def join(self, other: Intervals) -> None:
        """Take all that others are."""
        self._sure.join(other._sure)
        self._in_doubt.join(other._in_doubt)
        self._told.update(other._told)
        self._told_count += other._told_count

    def some(self, most: int) -> I64:
        """Return so many lengths at most, in their order, that stand for all."""
        return self._telling.some(most)

    @property
    def _telling(self) -> _Lengths:
        if self._are_sure:
            return self._sure
        both = _Lengths()
        both.join(self._sure)
        both.join(self._in_doubt)
        return both

    @property
    def _are_sure(self) -> bool:
        """Whether those in doubt are not asked."""
        if not self._in_doubt.count:
            return True
        return self._sure.count - self._told_count >= LEAST_ALIKE and self._alike_enough(self._sure)

    def _alike_enough(self, lengths: _Lengths, least_share: int = 1) -> bool:
        """Return whether not more than usual are others, and not more than a share."""
        median_ns = lengths.median_ns
        if median_ns is None:
            return False
        count = lengths.count - sum(many for length, many in self._told.items() if length > limit_ns(median_ns))
        alike = lengths.near(median_ns, FEW_ALIKE_SHARE if count < FEW else ALIKE_SHARE)
        others = count - alike
        most = min(max(1, 2 * count * count // FEW**2), max(1, count // least_share))
        return not others or (alike >= LEAST_ALIKE and others <= most and alike * REGULAR_SHARE >= count)


class _Lengths:
    """How often each length comes; of very many of them, neighbours are one."""

    def __init__(self) -> None:
        self.count = 0
        self._values: I64 = np.zeros(0, np.int64)
        self._counts: I64 = np.zeros(0, np.int64)
        self._waiting: list[I64] = []
        self._waiting_count = 0

    @property
    def median_ns(self) -> int | None:
        self._merge_waiting()
        if not self.count:
            return None
        return int(self._values[np.searchsorted(np.cumsum(self._counts), (self.count + 1) // 2)])

    def take(self, length_ns: I64) -> None:
        self.count += len(length_ns)
        self._waiting.append(length_ns)
        self._waiting_count += len(length_ns)
        if self._waiting_count > max(_WAITING, len(self._values)):
            self._merge_waiting()

    def join(self, other: _Lengths) -> None:
        if other.count:
            other._merge_waiting()
            self.count += other.count
            self._merge(other._values, other._counts)

    def near(self, length_ns: int, share: int) -> int:
        """Return how many are within a share of a length."""
        self._merge_waiting()
        return int(self._counts[np.abs(self._values - length_ns) <= length_ns // share].sum())

    def some(self, most: int) -> I64:
        self._merge_waiting()
        take = min(most, self.count)
        places = (2 * np.arange(take) + 1) * self.count // max(2 * take, 1)
        found: I64 = self._values[np.searchsorted(np.cumsum(self._counts), places, "right")]
        return found

    def _merge_waiting(self) -> None:
        if self._waiting:
            values, counts = np.unique(np.concatenate(self._waiting), return_counts=True)
            self._waiting, self._waiting_count = [], 0
            self._merge(values, counts)

    def _merge(self, values: I64, counts: I64) -> None:
        if not len(self._values):
            self._values, self._counts = values, counts
            return
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
