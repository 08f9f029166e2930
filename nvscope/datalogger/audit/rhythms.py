"""Rhythms: how often rows come in each part of a table, between two places where data was lost and it is told.

Loggers go on with a table whatever interval their configuration says by then. Where they do, they say that data was
lost; so what stands between two rows that say this may have a rhythm of its own, and is judged by that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit.gaps import are_late
from nvscope.datalogger.audit.intervals import DOUBTFUL_SHARE, FEW, FEW_ALIKE_SHARE, LEAST_ALIKE, NOTHING, Intervals
from nvscope.tracker.readings.cadence import ALIKE_SHARE, REGULAR_SHARE

_MOST_SOME = 256
"""So many lengths of a part stand for all, where it is asked whether they are those of the table."""


class Rhythms(Struct, frozen=True):
    """The rhythms of some parts: how many intervals, the median of them, and whether they come at that regularly.

    ``others`` are not as long as the median. Where rows of a part may be of other tasks and come at no interval,
    ``sure_ns`` is that of the few that are not, or ``NOTHING``; else it is 0. ``some_ns`` are lengths that stand for
    all of them, those of each part from ``begin`` on.
    """

    count: I64
    median_ns: I64
    is_regular: Bool
    others: I64
    sure_ns: I64
    some_ns: I64
    begin: I64

    def __len__(self) -> int:
        return len(self.count)

    @property
    def own_ns(self) -> I64:
        """The interval of each part, 0 where none is known."""
        return np.where(self.is_regular, self.median_ns, 0)

    def take(self, parts: Bool) -> Rhythms:
        """Return those of some parts."""
        lengths = np.diff(self.begin, append=len(self.some_ns))
        own = lengths[parts]
        some_ns = self.some_ns[np.repeat(parts, lengths)]
        begin = np.cumsum(own) - own
        columns = [*(getattr(self, name)[parts] for name in _OF_PARTS), some_ns, begin]
        return Rhythms(*columns)

    def are_near(self, interval_ns: int) -> Bool:
        """Return in which parts half of the intervals are about as long."""
        near = np.append(0, np.cumsum(np.abs(self.some_ns - interval_ns) <= interval_ns // ALIKE_SHARE))
        end = np.append(self.begin[1:], len(self.some_ns))
        half = 2 * (near[end] - near[self.begin]) >= end - self.begin
        found: Bool = half & (self.sure_ns != NOTHING) & ~are_late(self.sure_ns, interval_ns)
        return found

    @staticmethod
    def of(intervals: Intervals) -> Rhythms:
        """Return the rhythm of one part."""
        return Rhythms(
            np.array([intervals.count], np.int64),
            np.array([intervals.median_ns or 0], np.int64),
            np.array([intervals.is_regular], np.bool_),
            np.array([intervals.others], np.int64),
            np.array([intervals.sure_ns], np.int64),
            intervals.some(_MOST_SOME),
            np.zeros(1, np.int64),
        )

    @staticmethod
    def of_parts(length_ns: I64, part: I64, parts: int, in_doubt: Bool | None) -> Rhythms:
        """Return the rhythms of so many parts; ``part``, which rises, tells of each length which one it is of.

        It is as ``Intervals`` has it, where none is told.
        """
        if in_doubt is None or not in_doubt.any():
            return _of_parts(length_ns, part, np.zeros(parts, np.bool_))
        sure = ~in_doubt
        sure_count = np.bincount(part[sure], minlength=parts)
        of_sure = _of_parts(length_ns[sure], part[sure], np.zeros(parts, np.bool_))
        tells = (sure_count >= LEAST_ALIKE) & of_sure.is_regular | (sure_count == np.bincount(part, minlength=parts))
        asked = sure | ~tells[part]
        found = _of_parts(length_ns[asked], part[asked], ~tells)
        regular = found.is_regular & (tells | ~are_late(of_sure.median_ns, found.median_ns))
        told_ns = np.where(tells | regular, 0, np.where(sure_count > 0, of_sure.median_ns, NOTHING))
        return replace(found, is_regular=regular, sure_ns=told_ns)

    @staticmethod
    def joined(rhythms: Sequence[Rhythms]) -> Rhythms:
        """Return several as one."""
        if not rhythms:
            none = np.zeros(0, np.int64)
            return Rhythms(none, none, np.zeros(0, np.bool_), none, none, none, none)
        offsets = np.cumsum([0, *(len(one.some_ns) for one in rhythms)]).tolist()
        columns = [np.concatenate([getattr(one, name) for one in rhythms]) for name in (*_OF_PARTS, "some_ns")]
        begin = np.concatenate([one.begin + offset for one, offset in zip(rhythms, offsets, strict=False)])
        return Rhythms(*[*columns, begin])


_OF_PARTS = ("count", "median_ns", "is_regular", "others", "sure_ns")


def _of_parts(length_ns: I64, part: I64, in_doubt: Bool) -> Rhythms:
    parts = len(in_doubt)
    length_ns = length_ns[np.lexsort((length_ns, part))]
    count = np.bincount(part, minlength=parts)
    first = np.cumsum(count) - count
    median_ns = np.zeros(parts, np.int64)
    there = count > 0
    median_ns[there] = length_ns[first[there] + (count[there] - 1) // 2]
    own_ns = np.repeat(median_ns, count)
    near = np.abs(length_ns - own_ns) <= own_ns // np.where(np.repeat(count, count) < FEW, FEW_ALIKE_SHARE, ALIKE_SHARE)
    alike = np.bincount(part[near], minlength=parts)
    others = count - alike
    most = np.maximum(1, 2 * count * count // FEW**2)
    most = np.where(in_doubt, np.minimum(most, np.maximum(1, count // DOUBTFUL_SHARE)), most)
    enough = (alike >= LEAST_ALIKE) & (others <= most) & (alike * REGULAR_SHARE >= count)
    taken = np.minimum(count, _MOST_SOME)
    begin = np.cumsum(taken) - taken
    number = np.arange(int(taken.sum())) - np.repeat(begin, taken)
    places = np.repeat(first, taken) + (2 * number + 1) * np.repeat(count, taken) // np.repeat(2 * taken, taken)
    regular = there & ((others == 0) | enough)
    return Rhythms(count, median_ns, regular, others, np.zeros(parts, np.int64), length_ns[places], begin)
