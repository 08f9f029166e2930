"""Repeats: telegrams of a stream that are as one shortly before, and which of them are copies, no cycles.

::

    repeat   has the Counter and the bytes of one of the 64 telegrams before it, and comes within a second of that
    new      all others
    span     from a new one up to the next: where that is there, it is closed

A sender may count each telegram, or only those with other values, or nothing: then a cycle is a repeat, too. What it
does is told by time. Between two new telegrams there is room for as many cycles as intervals of the stream, less one,
or less what a Counter counts that moves with the intervals. Where more repeats come, those are copies that come sooner
than half an interval behind the cycle before them. So it does not matter how late a copy is, nor behind what. Behind
the last new telegram, a copy comes sooner than a quarter of an interval, or as late as others did. What cannot be
proven is a cycle: a row too many is better than one that is lost.

What repeats a telegram and is behind others of it by its Counter, too, is from the past: it is a copy, whenever it
comes.

The interval is that of new telegrams, one directly behind the other. Where there are few such, most have been repeated,
or values are slow: then it is that of all new telegrams if these have been repeated in a way in which no sender sends
cycles (``_are_copied``), else that of all telegrams. An irregular stream has none: there a copy comes at once, or each
telegram has one, equally late, or the Counter is known to move by itself.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U16, U64, Bool
from nvscope.tracker.sequence import walk
from nvscope.tracker.steps import LATE_FROM, Step

RECENT = 64
RECENT_NS = 1_000_000_000

AT_ONCE_NS = 2_000_000
"""Where no interval tells, a copy comes sooner than this."""

LEAST = 5
"""So many times it takes to say that something is so."""

_FEW = 3 * LEAST
_MS_NS = 1_000_000

_MOST_LATE = 8
"""More repeats than so many do not come behind one new telegram, and late, where a Counter goes on and on."""


class Seen(Struct, frozen=True, dict=True):
    """Telegrams of one stream in their order.

    ``values`` and ``content`` are numbers of what a telegram holds, without and with its Counter. ``defined_ns`` is the
    interval of a list that is defined to be cyclic.
    """

    time_ns: I64
    counter: U16
    values: U64
    content: U64
    defined_ns: int | None

    def __len__(self) -> int:
        return len(self.time_ns)

    @cached_property
    def before(self) -> I64:
        """Which telegram each one repeats, the last one of these; -1 where it is new."""
        found = self._recent
        # A Counter that comes round soon tells nothing of what is not directly behind the other.
        return np.where(found == np.arange(len(self)) - 1, found, -1) if self._comes_round else found

    @cached_property
    def _recent(self) -> I64:
        return np.where(self._is_aged, -1, self._again)

    @cached_property
    def _again(self) -> I64:
        """Which of the telegrams before it each one is as, however long ago that came; -1 where there is none."""
        return _earlier(self.content, RECENT)

    @cached_property
    def _is_aged(self) -> Bool:
        """Which telegrams are new since what they repeat is long ago: they say nothing of when values change."""
        found: Bool = (self._again >= 0) & (np.abs(self.time_ns - self.time_ns[self._again]) > RECENT_NS)
        return found

    @cached_property
    def _comes_round(self) -> bool:
        """Whether a few Counters come again and again: in new telegrams, or in a row with nothing new between."""
        is_new = self._recent < 0
        new = np.flatnonzero(is_new)
        counters = _earlier(self.counter[new].astype(np.uint64), len(new))
        used = np.flatnonzero(counters >= 0)
        if np.count_nonzero(new[used] - new[counters[used]] <= 2 * RECENT) >= LEAST:
            return True
        late = self.content != self.content[new[np.cumsum(is_new) - 1]]
        return bool(np.add.reduceat(late, new, dtype=np.int64).max() > _MOST_LATE)

    @cached_property
    def new(self) -> I64:
        """The places of the new telegrams, rising; the first is one."""
        return np.flatnonzero(self.before < 0)

    def copies(self) -> Bool:
        """Return which telegrams are copies."""
        repeats = self.before >= 0
        found: Bool = repeats & ((self._behind_ns < self._limit_ns) | self._is_past)
        if found.sum() == repeats.sum():
            return found
        interval_ns = self._interval_ns
        if interval_ns is None:
            return found | self._without_interval()
        room = self._room(interval_ns)
        # Who sends faster than that does not send in this interval. How many cycles there are is not known exactly.
        fits = (2 * self._closed < interval_ns) | self._evenly(2, 4) | (self._repeats <= room + room // 4)
        found |= repeats & np.append(~fits & (room == 0), False)[self._span]
        for span in np.flatnonzero(~fits & (room > 0)).tolist():
            self._pick(found, span, interval_ns, int(room[span]))
        self._end(found, interval_ns)
        return found

    @cached_property
    def _gaps(self) -> I64:
        return np.diff(self.time_ns)

    @cached_property
    def _closed(self) -> I64:
        """How long each closed span is."""
        return np.diff(self.time_ns[self.new])

    @cached_property
    def _tells(self) -> Bool:
        """Which closed spans go from one telegram with something new in it to another."""
        is_aged = self._is_aged[self.new]
        return ~(is_aged[1:] | is_aged[:-1])

    @cached_property
    def _span(self) -> I64:
        """The number of the span of each telegram."""
        return np.cumsum(self.before < 0) - 1

    @cached_property
    def _repeats(self) -> I64:
        """How many repeats each closed span has."""
        return np.diff(self.new) - 1

    @cached_property
    def _steps(self) -> I64:
        """How far the Counter moves over each closed span."""
        counter = self.counter[self.new]
        steps: U16 = counter[1:] - counter[:-1]
        found: I64 = steps.astype(np.int64)
        return found

    @cached_property
    def _behind_ns(self) -> I64:
        """How far each repeat is behind what it repeats."""
        found: I64 = np.abs(self.time_ns - self.time_ns[self.before])
        return found

    @cached_property
    def _is_past(self) -> Bool:
        """Which telegrams have a Counter that is shortly behind the newest one, and was there before."""
        steps: U16 = self.counter[1:] - self.counter[:-1]
        goes_back = bool((steps >= LATE_FROM).any())
        if not goes_back or self._comes_round:
            return np.zeros(len(self), np.bool_)
        nothing = np.zeros(1, np.int64)
        walked = walk(
            self.counter, nothing, nothing.astype(np.uint16), nothing.astype(np.uint64), np.ones(1, np.bool_)
        ).step  # fmt: skip
        found: Bool = (self.before >= 0) & ((walked == Step.LATE) | (walked == Step.OVERTAKEN))
        return found

    def _evenly(self, repeats: int, off: int) -> Bool:
        """Return which closed spans have so many repeats, or more, as far apart as cycles, to one part in ``off``."""
        if not len(self._closed):
            return np.zeros(0, np.bool_)
        gaps = self._gaps[: self.new[-1]]
        least, most = (by.reduceat(gaps, self.new[:-1]) for by in (np.minimum, np.maximum))
        count = self._repeats + 1
        even: Bool = off * least * count >= (off - 1) * self._closed
        return even & (off * most * count <= (off + 1) * self._closed) & (self._repeats >= repeats)

    @cached_property
    def _interval_ns(self) -> int | None:
        """The interval of the stream, None where it has none."""
        closed = self._closed[self._tells]
        direct = closed[self._repeats[self._tells] == 0]
        # Where few are direct, what lies between the others may have been lost.
        often = 2 * len(direct) >= len(closed)
        of_all = regular(self._gaps)
        if often and (of_direct := regular(direct)) is not None:
            return of_direct if of_all is None else min(of_direct, of_all)
        of_new = regular(closed)
        if of_new is not None and self._are_copied and 4 * (self.defined_ns or of_new) >= 3 * of_new:
            return of_new
        for found in (self._defined_of_few, of_all, self._of_pairs):
            if found is not None:
                return found
        return None

    @cached_property
    def _of_pairs(self) -> int | None:
        """The interval of a stream of which each telegram comes twice, if the list is defined to have about that."""
        found = regular(self._gaps[1:] + self._gaps[:-1])
        if found is None or not self.defined_ns or 4 * abs(found - self.defined_ns) > self.defined_ns:
            return None
        short = 2 * self._gaps < found
        in_turn = np.count_nonzero(short[1:] != short[:-1])
        return found if 10 * in_turn >= 9 * (len(short) - 1) else None

    @cached_property
    def _defined_of_few(self) -> int | None:
        """The interval that the list is defined to have, if the few new telegrams that there are came in it."""
        defined_ns = self.defined_ns
        if not defined_ns or len(self) > _FEW or not 1 < len(self._closed) < LEAST:
            return None
        off = np.abs(self._closed - defined_ns)
        return None if (4 * off > defined_ns).any() or self._evenly(1, 8).any() else defined_ns

    @cached_property
    def _are_copied(self) -> bool:
        """Whether new telegrams have been repeated as no sender sends cycles.

        The Counter moves without the values; or repeats come behind other new telegrams; or they stand out of the
        middle, all on one side, or nearer to one of their neighbours than cycles would.
        """
        if self._counts_by_itself:
            return True
        repeats = np.flatnonzero(self.before >= 0)
        late = self.content[repeats] != self.content[self.new[self._span[repeats]]]
        if np.count_nonzero(late) >= max(LEAST, len(repeats) / 2):
            return True
        span = np.flatnonzero((self._repeats > 0) & self._tells)
        if len(span) < LEAST:
            return False
        # Of those that stand for several cycles, what is behind tells of the sender: it may pause with each new value.
        first, then = self._gaps[self.new[span]], self._gaps[self.new[span] + 1]
        near = 4 * np.minimum(first, then) <= first + then
        if 10 * np.count_nonzero(near) >= 9 * len(near):
            return True
        first, then = np.sort(first), np.sort(then)
        # Of cycles that are about as long as a repeat may be late, only the short ones are repeats.
        if 4 * _at(first, 90) > 3 * RECENT_NS or len(span) < 2 * LEAST:
            return False
        return 16 * _at(first, 90) < 15 * _at(then, 10) or 16 * _at(then, 90) < 15 * _at(first, 10)

    @cached_property
    def _counts_by_itself(self) -> bool:
        """Whether the Counter moves where the values do not."""
        values = self.values[self.new]
        by_itself = (values[1:] == values[:-1]) & (self._steps == 1)
        return not self._comes_round and int(np.count_nonzero(by_itself)) >= LEAST

    def _room(self, interval_ns: int) -> I64:
        """Return for how many cycles there is room between the new telegrams of each closed span."""
        # Rather one too many than a cycle that is no row.
        intervals = (5 * self._closed + 3 * interval_ns) // (5 * interval_ns)
        direct = self._repeats == 0
        if np.count_nonzero(direct) < LEAST:
            direct[:] = True
        counts = direct & (self._steps == intervals)
        # What a Counter that counts intervals has passed over was lost.
        lost = (self._steps >= 1) & (self._steps <= RECENT)
        lost &= 10 * np.count_nonzero(counts) >= 9 * np.count_nonzero(direct)
        return np.maximum(intervals - np.where(lost, self._steps, 1), 0)

    def _pick(self, found: Bool, span: int, interval_ns: int, room: int) -> None:
        """Tell the copies of a span with more repeats than there is room for."""
        begin, end = int(self.new[span]), int(self.new[span + 1])
        last_ns = int(self.time_ns[begin])
        for row in range(begin + 1, end):
            time_ns = int(self.time_ns[row])
            if room and 2 * (time_ns - last_ns) >= interval_ns:
                last_ns = time_ns
                room -= 1
            else:
                found[row] = True

    def _end(self, found: Bool, interval_ns: int) -> None:
        """Tell the copies behind the last new telegram: nobody knows for how many cycles there is room."""
        begin = int(self.new[-1])
        if begin + 1 == len(self):
            return
        usual = _usual(self._behind_ns[found])
        if usual is None and (4 * self._gaps[begin:] >= interval_ns).all():
            return
        last_ns = int(self.time_ns[begin])
        for row in range(begin + 1, len(self)):
            time_ns, behind_ns = int(self.time_ns[row]), int(self._behind_ns[row])
            if (usual and usual[0] <= behind_ns <= usual[1]) or 4 * abs(time_ns - last_ns) < interval_ns:
                found[row] = True
            else:
                last_ns = time_ns

    def _without_interval(self) -> Bool:
        """Return the copies of a stream without an interval."""
        repeats = self.before >= 0
        found = np.zeros(len(self), np.bool_)
        if self._counts_by_itself:
            # A sender that begins anew comes behind its own telegrams, from the first one on.
            first = np.minimum(self.new[:-1] + 1, len(self) - 1)
            back = (self.counter[self.new[:-1]] - self.counter[first]).astype(np.int64)
            late = (back > 0) & (back <= RECENT) & (self.counter[first] > 1)
            found |= repeats & np.append(late | (back == 0), False)[self._span]
        row = np.flatnonzero(repeats)
        of_new = self.before[self.before[row]] < 0
        once = len(self.new) > 1 and 9 * (len(self.new) - 1) <= 10 * len(row) <= 10 * len(self.new)
        if once and 10 * np.count_nonzero(of_new) >= 9 * len(row):
            usual = _usual(self._behind_ns[row])
            # A sender that gives each value two cycles, and pauses now and then, repeats it one cycle later.
            onward_ns = _at(np.sort(self._gaps[self.new[1:] - 1]), 50)
            if usual is not None and 2 * usual[1] < min(onward_ns, self.defined_ns or onward_ns):
                found |= repeats & (self._behind_ns >= usual[0]) & (self._behind_ns <= usual[1])
        return found

    @cached_property
    def _limit_ns(self) -> int:
        """Sooner than this comes a copy where no interval tells."""
        limit_ns = min(AT_ONCE_NS, self.defined_ns // 4) if self.defined_ns else AT_ONCE_NS
        return min(limit_ns, _at(np.sort(self._gaps), 90) // 8) if len(self._gaps) >= LEAST else limit_ns


def _earlier(number: U64, most: int) -> I64:
    """Return where each of some numbers was before, the last time, if that is no more than so many places; else -1."""
    order = np.argsort(number, kind="stable")
    row, other = order[1:], order[:-1]
    again = (number[row] == number[other]) & (row - other <= most)
    found = np.full(len(number), -1)
    found[row[again]] = other[again]
    return found


def regular(times_ns: I64) -> int | None:
    """Return what times are where they are regular: their median, if most of them are near it."""
    if len(times_ns) < LEAST:
        return None
    in_order = np.sort(times_ns)
    low, middle, high = (_at(in_order, percent) for percent in (5, 50, 95))
    return middle if middle > 0 and 2 * (high - low) <= middle else None


def _usual(behind_ns: I64) -> tuple[int, int] | None:
    """Return between which times copies come behind what they repeat, None where they come at any time."""
    if len(behind_ns) < LEAST:
        return None
    in_order = np.sort(behind_ns)
    low, middle, high = (_at(in_order, percent) for percent in (5, 50, 95))
    if high - low > max(_MS_NS, middle // 8):
        return None
    around = _MS_NS + middle // 16
    return low - around, high + around


def _at(in_order: I64, percent: int) -> int:
    """Return the time that so many percent of some, which rise, do not reach."""
    return int(in_order[(len(in_order) - 1) * percent // 100])
