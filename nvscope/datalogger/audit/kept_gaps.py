"""What may be gaps in the parts of one task, until it is known by which interval each is judged.

A part of which half comes as rows of the table do is judged by the interval of that, others by their own. That of the
configuration holds for all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit.gaps import Gaps, SetBack, are_late, are_no_clock_sets
from nvscope.datalogger.audit.intervals import FEW, LEAST_ALIKE
from nvscope.datalogger.audit.rhythms import Rhythms

MOST_SOME = 1 << 20
"""So many lengths that stand for those of parts are kept."""


class Regularity(Struct):
    """How many intervals are in parts that come at one of their own, of those of which that can be told.

    Of many parts of few rows, some seem to be regular by chance; so these tell something where most of them are, and
    all of them together would be as one. ``least_ns`` and ``most_ns`` are the shortest and the longest interval.
    """

    intervals: int = 0
    regular: int = 0
    few_parts: int = 0
    regular_few_parts: int = 0
    of_few: int = 0
    others_of_few: int = 0
    least_ns: int | None = None
    most_ns: int | None = None

    def take(self, rhythms: Rhythms) -> None:
        """Take some parts."""
        few, asked = rhythms.count < FEW, rhythms.count > LEAST_ALIKE
        self.intervals += int(rhythms.count[asked].sum())
        self.regular += int(rhythms.count[asked & rhythms.is_regular].sum())
        self.few_parts += int(np.count_nonzero(asked & few))
        self.regular_few_parts += int(np.count_nonzero(asked & few & rhythms.is_regular))
        self.of_few += int(rhythms.count[few].sum())
        self.others_of_few += int(rhythms.others[few].sum())
        own_ns = rhythms.median_ns[asked & rhythms.is_regular]
        if len(own_ns):
            least_ns, most_ns = int(own_ns.min()), int(own_ns.max())
            self.least_ns = least_ns if self.least_ns is None else min(least_ns, self.least_ns)
            self.most_ns = most_ns if self.most_ns is None else max(most_ns, self.most_ns)

    @property
    def tells(self) -> bool:
        """Whether parts have intervals of their own at all."""
        return 0 < 3 * self.intervals <= 4 * self.regular

    @property
    def few_tell(self) -> bool:
        """Whether those of few rows have."""
        most = max(1, 2 * self.of_few**2 // FEW**2)
        return self.tells and 3 * self.few_parts <= 4 * self.regular_few_parts and self.others_of_few <= most


class Late(Struct, frozen=True):
    """Rows that come too late by an interval each.

    ``slower_ns`` is how often the rows of its part come where that is less often than the configuration asks for, else
    0.
    """

    gaps: Gaps
    interval_ns: I64
    slower_ns: I64

    def take(self, rows: Bool | I64) -> Late:
        """Return some of them."""
        return Late(self.gaps.take(rows), self.interval_ns[rows], self.slower_ns[rows])


class Yardstick(Struct, frozen=True):
    """What the rows of a task are judged by: the interval of the table, and that of the configuration.

    None where it is not known, or rows come at none.
    """

    interval_ns: int | None
    asked_ns: int | None

    @property
    def is_asked(self) -> bool:
        """Whether the configuration says it of all rows."""
        return self.interval_ns is not None and self.interval_ns == self.asked_ns

    def knows(self, rhythm: Rhythms) -> bool:
        """Return whether rows of a part can be judged at all."""
        if self.is_asked or rhythm.is_regular[0]:
            return True
        return self.interval_ns is not None and bool(rhythm.are_near(self.interval_ns)[0])

    def own_ns(self, rhythms: Rhythms) -> I64:
        """Return what parts are judged by that do not come as the table does, 0 where that is not known."""
        own_ns = rhythms.own_ns
        if self.asked_ns is None:
            return own_ns
        # Rows that come more often than was asked for, or less often, are judged by how they come.
        often = own_ns < self.asked_ns - own_ns // 2
        return np.where((own_ns > 0) & ~often, np.maximum(own_ns, self.asked_ns), own_ns)


class KeptGaps:
    """Keeps them, and the rhythm of each part that has some; ``told`` are those in front of parts."""

    def __init__(self) -> None:
        self.regularity = Regularity()
        self._gaps: list[Gaps] = []
        self._part: list[I64] = []
        self._rhythms: list[Rhythms] = []
        self._parts = 0
        self._told: list[Gaps] = []
        self._told_ns: list[I64] = []
        self._first_ns = self._own_ns = 0
        self.count = self._some = 0
        self.passed = 0
        """How many were decided when nobody knew what they are to be judged by."""

    @property
    def is_full(self) -> bool:
        """Whether the lengths that stand for parts are too many."""
        return self._some > MOST_SOME

    def take(self, gaps: Gaps, part: I64, rhythms: Rhythms) -> None:
        """Take what may be gaps in some parts, and which each is in."""
        if not len(gaps):
            return
        there = np.zeros(len(rhythms), np.bool_)
        there[part] = True
        place = np.cumsum(there) - 1 + self._parts
        own = rhythms if there.all() else rhythms.take(there)
        self._gaps.append(gaps)
        self._part.append(place[part])
        self._rhythms.append(own)
        self._parts += len(own)
        self.count += len(gaps)
        self._some += len(own.some_ns)

    def take_told(self, told: Gaps, behind: I64, rhythms: Rhythms) -> None:
        """Take what the logger tells between parts, and behind which of these each is."""
        own_ns = np.append(self._own_ns, rhythms.own_ns)
        last_ns = own_ns[np.maximum.accumulate(np.where(own_ns > 0, np.arange(len(own_ns)), 0))]
        self._own_ns = int(last_ns[-1])
        if not self._first_ns and own_ns.any():
            self._first_ns = int(own_ns[own_ns > 0][0])
        if len(told):
            self._told.append(told)
            self._told_ns.append(last_ns[behind + 1])
            self.count += len(told)

    def late(self, by: Yardstick, set_back: Sequence[SetBack], unfinished: Rhythms | None = None) -> tuple[Late, Late]:
        """Return which come late, those that nobody tells of and those that are told, and forget all.

        A part that is ``unfinished`` tells as much as those that are over; it is not the end then.
        """
        regularity = self.regularity if unfinished is None else replace(self.regularity)
        if unfinished is not None:
            regularity.take(unfinished)
        if unfinished is not None and by.interval_ns is None and not regularity.few_tell:
            self.passed += self.count
        untold, told = self._late_untold(by, regularity), self._late_told(by, regularity)
        self._gaps, self._part, self._rhythms, self._told, self._told_ns = [], [], [], [], []
        self._parts = self.count = self._some = 0
        if not set_back:
            return untold, told
        gaps = Gaps.joined([untold.gaps, told.gaps])
        order = np.argsort(gaps.number, kind="stable")
        interval_ns = np.concatenate([untold.interval_ns, told.interval_ns])
        kept = np.empty(len(gaps), np.bool_)
        kept[order] = are_no_clock_sets(gaps.take(order), interval_ns[order], set_back)
        return untold.take(kept[: len(untold.gaps)]), told.take(kept[len(untold.gaps) :])

    def _late_untold(self, by: Yardstick, regularity: Regularity) -> Late:
        gaps, rhythms = Gaps.joined(self._gaps), Rhythms.joined(self._rhythms)
        part = np.concatenate(self._part) if self._part else np.zeros(0, np.int64)
        near = np.zeros(len(rhythms), np.bool_) if by.interval_ns is None else rhythms.are_near(by.interval_ns)
        if by.is_asked:
            assert by.interval_ns is not None
            own_ns = np.where(near | (rhythms.count < LEAST_ALIKE), 0, rhythms.own_ns)
            slower_ns = np.where(are_late(own_ns, by.interval_ns), own_ns, 0)
            interval_ns = np.full(len(rhythms), by.interval_ns)
            found = Late(gaps, interval_ns[part], slower_ns[part])
            return found.take(are_late(gaps.length_ns, by.interval_ns))
        interval_ns = np.where(near, by.interval_ns or 0, by.own_ns(rhythms))
        # What is late by the interval of the table, too, is no chance.
        tells = np.where(rhythms.count < FEW, regularity.few_tell, regularity.tells)
        certain = (near | tells)[part]
        if by.interval_ns is not None:
            certain |= are_late(gaps.length_ns, by.interval_ns)
        late = certain & (interval_ns > 0)[part] & are_late(gaps.length_ns, interval_ns[part])
        return Late(gaps, interval_ns[part], np.zeros(len(gaps), np.int64)).take(late)

    def _late_told(self, by: Yardstick, regularity: Regularity) -> Late:
        gaps = Gaps.joined(self._told)
        if by.interval_ns is not None:
            interval_ns = np.full(len(gaps), by.interval_ns)
        elif self._told and regularity.tells:
            own_ns = np.concatenate(self._told_ns)
            interval_ns = np.where(own_ns > 0, own_ns, self._first_ns)
        else:
            interval_ns = np.zeros(len(gaps), np.int64)
        late = (interval_ns > 0) & are_late(gaps.length_ns, interval_ns)
        return Late(gaps, interval_ns, np.zeros(len(gaps), np.int64)).take(late)
