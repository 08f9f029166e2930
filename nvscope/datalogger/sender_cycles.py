"""Sender cycles: which telegrams of one sender make a cycle of a list, and which come too late for theirs.

Senders that count by stream, or by send, give all telegrams of a cycle one Counter. Where the last whole cycle had it
so, Counters tell what SubIndexes and time do not::

    A1 A2 B1 B2      B1 is of the cycle that A1 began and A2 ended: it is late, and makes no cycle with A2
    A1 B2 A2         B2 begins the next cycle

    A1 C1 B1 B2 C2   B is late as a whole, in the middle of C
    A1 A2 B1 A2      A2 is sent once more

    A1 …      A2     A goes on, however late: the cycle before it had another Counter

Senders that count each telegram give those of a cycle Counters that differ as their SubIndexes do. Where the last
whole cycle had it so, what differs so from an open one is of that, however late. Where Counters rose at least, since
others were sent between, what has a greater one than a greater SubIndex begins the next cycle. What is late of such
senders does not come here (``passed_cycles``).

A second Counter is not believed that says of cycles that have one Counter what is late, or next, before another
whole one has come: the sender may count in another way since. One that is late is, of a sender whose cycles
count on one by one; of one that does not, nobody knows which Counters there are to come.

What is late is lost, as if it had not come: the next telegram of its SubIndex is behind that.

Of a list that is sent on a change or an event, telegrams may be sent alone, at any time. There, Counters tell no more
than what is next: nothing is late, and nothing goes on for longer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U16, Bool
from nvscope.tracker.steps import WINDOW

_WRAP = 1 << 16
_MOST_SAID = {True: 1, False: 4}
"""So many Counters are believed before another whole cycle has come, by whether time tells cycles apart, too."""


class Open(NamedTuple):
    """A cycle that may go on: when it began, its last telegram, and its Counters by SubIndex, as they came."""

    begin_ns: int
    frame: int
    last_ns: int
    counters: dict[int, int]

    @property
    def counter(self) -> int:
        """That of the first telegram."""
        return next(iter(self.counters.values()))

    @property
    def is_one(self) -> bool:
        """Whether that is the Counter of all."""
        return len(set(self.counters.values())) == 1

    @property
    def base(self) -> int | None:
        """The Counter that SubIndex 0 has where each telegram is counted, None where that is not one."""
        bases = {_base(subindex, counter) for subindex, counter in self.counters.items()}
        return bases.pop() if len(bases) == 1 else None

    def is_in_front_of(self, subindex: int, counter: int) -> bool:
        """Return whether a telegram has a greater Counter than a greater SubIndex."""
        last = max(self.counters)
        return subindex < last and 1 <= (counter - self.counters[last]) % _WRAP <= WINDOW

    @property
    def rises(self) -> bool:
        """Whether the greatest SubIndex has a greater Counter than the least."""
        return 1 <= (self.counters[max(self.counters)] - self.counters[min(self.counters)]) % _WRAP <= WINDOW


def _base(subindex: int, counter: int) -> int:
    return (counter - subindex) % _WRAP


class SenderCycles:
    """Cuts the telegrams of one sender into cycles.

    ``subindexes`` are those of a whole cycle, empty where nobody knows all; ``sends_all``: all of them are sent each
    time, so that Counters tell what is late. What comes later than ``apart_ns`` behind
    the telegram before begins a cycle. ``open`` is the cycle that may go on; ``late`` are the frames of those telegrams
    taken last whose cycle was over when they came, ``lost`` of those behind which they are missing: the next ones of
    their SubIndexes that are not late, or they themselves.
    """

    def __init__(self, subindexes: frozenset[int], apart_ns: int, *, sends_all: bool) -> None:
        self._all = subindexes
        self._sends_all = sends_all
        self._apart_ns = apart_ns
        self.open: Open | None = None
        self.late: list[int] = []
        self.lost: list[int] = []
        self._is_sure = False
        """Whether all telegrams of the last whole cycle had one Counter."""
        self._are_counted = self._rises = False
        """Whether each of them was counted; whether Counters rose with SubIndexes at all."""
        self._newest = 0
        """The Counter that the last cycle began with."""
        self._said: set[int] = set()
        """The Counters that have told something since the last whole cycle."""
        self._most_said = _MOST_SAID[sends_all]
        self._torn: dict[int, frozenset[int]] = {}
        """The SubIndexes of the last cycles that were over and not whole, by Counter."""
        self._had_late: set[int] = set()
        """Those of them, by Counter, of which a telegram has been late."""
        self._newest_of: dict[int, int] = {}
        """The last Counter of each SubIndex that was not late."""
        self._owing: set[int] = set()
        """The SubIndexes the next telegrams of which are in ``lost``."""
        self._had = _Counters()

    def take(self, subindex: I64, counter: U16, time_ns: I64, frame: I64) -> tuple[I64, I64]:
        """Take telegrams that follow, and return when the cycles that are over began, and the last frame of each."""
        self.late, self.lost = [], []
        cut = _Cut.of(self.open, subindex, counter, time_ns, frame, self._apart_ns)
        is_whole = cut.size == len(self._all)
        is_whole &= bool(self._all)
        counts_nothing = not self._is_sure and not (is_whole & cut.is_one).any() and not self._owing
        if self._may_say_more(cut, is_whole):
            return self._one_by_one(subindex, counter, time_ns, frame)
        if counts_nothing:
            return self._taken(cut, is_whole)
        if not self._sends_all:
            says_nothing = cut.is_one.all()
            return self._taken(cut, is_whole) if says_nothing else self._one_by_one(subindex, counter, time_ns, frame)
        step = np.diff(np.append(self._newest if self._is_sure else cut.counter[0], cut.counter)).astype(np.int16)
        may_go_on = (step[1:] == 0) & ~is_whole[:-1]
        if cut.is_one.all() and (step >= 0).all() and not may_go_on.any() and not self._owing:
            self._remember(cut, is_whole)
            return self._taken(cut, is_whole)
        return self._one_by_one(subindex, counter, time_ns, frame)

    def _may_say_more(self, cut: _Cut, is_whole: Bool) -> bool:
        """Return whether Counters of each telegram may say something else than SubIndexes and time."""
        goes_on = (cut.base[1:] == cut.base[:-1]) & cut.is_counted[:-1] & ~is_whole[:-1]
        if self._sends_all and goes_on.any() and (self._are_counted or (is_whole & cut.is_counted).any()):
            return True
        falls = cut.subindex[1:] < cut.subindex[:-1]
        falls[cut.start[1:] - 1] = False
        place = np.flatnonzero(falls)
        return bool(len(place)) and not cut.is_one[np.searchsorted(cut.start, place, "right") - 1].all()

    def _one_by_one(self, subindex: I64, counter: U16, time_ns: I64, frame: I64) -> tuple[I64, I64]:
        """Take telegrams one after the other."""
        columns = (one.tolist() for one in (subindex, counter, time_ns, frame))
        over = [one for row in zip(*columns, strict=True) for one in self._one(*row)]
        return np.array([one.begin_ns for one in over], np.int64), np.array([one.frame for one in over], np.int64)

    def end(self) -> Open | None:
        """Return the cycle that was open; it is over."""
        over, self.open = self.open, None
        if over is not None and self._is_sure:
            self._note_torn(over.counter, frozenset(over.counters))
        return over

    def _taken(self, cut: _Cut, is_whole: Bool) -> tuple[I64, I64]:
        """Return the cycles of a cut; the last one may be open."""
        begin_ns, last = cut.begin_ns, cut.frame
        self.open = None
        if is_whole.any():
            whole = cut.cycle(int(np.flatnonzero(is_whole)[-1]))
            self._see_whole(whole)
            if not self._sends_all:
                self._is_sure = whole.is_one
                self._said = set() if whole.is_one else self._said
        if not is_whole[-1]:
            self.open = cut.cycle(-1)
            begin_ns, last = begin_ns[:-1], last[:-1]
        return begin_ns, last

    def _remember(self, cut: _Cut, is_whole: Bool) -> None:
        """Remember what cycles say of which each has one Counter, none less than that before it."""
        # The cycle that was open had its Counter noted when it began.
        first, noted = 0, int(self._is_sure and self.open is not None)
        if not self._is_sure:
            first = noted = int(np.argmax(is_whole))
            self._is_sure, self._torn, self._had, self._newest_of = True, {}, _Counters(), {}
        if is_whole.any():
            self._said = set()
        self._newest = int(cut.counter[-1])
        newest: dict[int, int] = {}
        for row in range(len(is_whole) - 1, max(first, len(is_whole) - WINDOW) - 1, -1):
            newest = cut.cycle(row).counters | newest
            if is_whole[row]:
                break
        self._newest_of |= newest
        for one in cut.counter[noted:][-2 * WINDOW :].tolist():
            self._had.take(one)
        torn = cut.counter[~is_whole].tolist()
        for row in np.flatnonzero(np.isin(cut.counter, [*self._torn, *torn])).tolist():
            self._torn.pop(int(cut.counter[row]), None)
            if first <= row < len(is_whole) - 1 and not is_whole[row]:
                self._note_torn(int(cut.counter[row]), frozenset(cut.cycle(row).counters))

    def _note_torn(self, counter: int, subindexes: frozenset[int]) -> None:
        self._torn.pop(counter, None)
        self._had_late.discard(counter)
        self._torn[counter] = subindexes
        if len(self._torn) > WINDOW:
            del self._torn[next(iter(self._torn))]

    def _one(self, subindex: int, counter: int, time_ns: int, frame: int) -> list[Open]:
        """Take one telegram, and return the cycles that are over for it."""
        over, going = [], self.open
        is_believed = self._is_sure and (counter in self._said or len(self._said) < self._most_said)
        if going is not None and going.is_one and self._is_again(subindex, counter):
            self.late.append(frame)
            return []
        if self._is_late(subindex, counter, is_believed=is_believed):
            self._said = self._said or {counter}
            if counter in self._torn:
                self._torn[counter] |= {subindex}
            else:
                self._note_torn(counter, frozenset({subindex}))
            if not 1 <= (self._newest_of.get(subindex, counter) - counter) % _WRAP <= WINDOW:
                self._owing.add(subindex)
            elif counter not in self._had_late:
                # The next one of its SubIndex has come, and nothing told that this one was missing.
                self.lost.append(frame)
            self._had_late = {counter, *(self._had_late & self._torn.keys())}
            self.late.append(frame)
            return []
        self._newest_of[subindex] = counter
        if subindex in self._owing:
            self._owing.discard(subindex)
            self.lost.append(frame)
        if going is not None:
            is_next = subindex in going.counters
            if not is_next and time_ns - going.last_ns > self._apart_ns:
                is_next = not self._sends_all or not self._goes_on(going, subindex, counter, is_believed=is_believed)
            is_next = is_next or (self._rises and going.is_in_front_of(subindex, counter))
            if not is_next and is_believed and 1 <= (counter - going.counter) % _WRAP <= WINDOW:
                self._said, is_next = self._said | {counter}, True
            if is_next:
                over += [one for one in [self.end()] if one]
        if self.open is None:
            self._torn.pop(counter, None)
            self._newest = counter
            self._had.take(counter)
            self.open = Open(time_ns, frame, time_ns, {subindex: counter})
        else:
            self.open = Open(self.open.begin_ns, frame, time_ns, self.open.counters | {subindex: counter})
        if self._all and self.open.counters.keys() == self._all:
            over.append(self.open)
            self._end_whole(self.open)
        return over

    def _goes_on(self, going: Open, subindex: int, counter: int, *, is_believed: bool) -> bool:
        """Return whether a telegram is of the open cycle, however late: the one before had another Counter."""
        if self._are_counted and _base(subindex, counter) == going.base:
            return True
        is_same = self._is_sure and going.is_one and counter == going.counter and self._had.has_moved
        return is_same and (is_believed or self._had.one_by_one)

    def _is_behind(self, counter: int) -> bool:
        """Return whether a Counter is known to be of a cycle before the one that began last."""
        return self._sends_all and self._is_sure and 1 <= (self._newest - counter) % _WRAP <= WINDOW

    def _is_late(self, subindex: int, counter: int, *, is_believed: bool) -> bool:
        """Return whether a telegram is of a cycle that was over, or had none, in the middle of another."""
        if not self._is_behind(counter):
            return False
        if counter in self._torn:
            return subindex not in self._torn[counter] and (is_believed or self._had.one_by_one)
        return self._had.one_by_one and self._had.passed_over(counter)

    def _is_again(self, subindex: int, counter: int) -> bool:
        """Return whether a telegram was there: it is sent once more, in the middle of a later cycle."""
        if not self._is_behind(counter):
            return False
        was_there = subindex in self._torn[counter] if counter in self._torn else self._had.had(counter)
        return was_there and self._had.has_moved and self._had.one_by_one

    def _see_whole(self, cycle: Open) -> None:
        self._are_counted, self._rises = cycle.base is not None, cycle.rises

    def _end_whole(self, cycle: Open) -> None:
        self.open = None
        self._see_whole(cycle)
        if cycle.is_one:
            if not self._is_sure:
                self._torn, self._had = {}, _Counters()
                self._had.take(cycle.counter)
                self._newest_of = dict(cycle.counters)
            self._newest, self._said = cycle.counter, set()
        self._is_sure = cycle.is_one


class _Counters:
    """The Counters that the last cycles began with, as far back as they have counted on since in no long step."""

    def __init__(self) -> None:
        self._last = 0
        self._reach = 0
        """How far back they are known."""
        self._had: set[int] = set()
        self.has_moved = False
        """Whether the last one is another than the one before, and counts on from that."""

    def take(self, counter: int) -> None:
        """Take the next one."""
        step = (counter - self._last) % _WRAP
        self.has_moved = bool(self._had) and 1 <= step <= WINDOW
        if not self._had or step > WINDOW:
            self._had, self._reach, step = set(), 0, 0
        self._last, self._reach = counter, min(self._reach + step, WINDOW)
        self._had = {one for one in [*self._had, counter] if (counter - one) % _WRAP <= self._reach}

    @property
    def one_by_one(self) -> bool:
        """Whether most of those there may be were there."""
        return 3 * len(self._had) >= 2 * (self._reach + 1)

    def had(self, counter: int) -> bool:
        """Return whether a cycle had a Counter."""
        return counter in self._had

    def passed_over(self, counter: int) -> bool:
        """Return whether no cycle had a Counter that lies between those known."""
        return counter not in self._had and (self._last - counter) % _WRAP <= self._reach


class _Cut(NamedTuple):
    """Cycles as SubIndexes and time tell them, of which the last may be open; a column a cycle.

    ``counter`` is that of the first telegram, ``is_one`` whether it is that of all; ``base`` and ``is_counted`` say the
    same of the Counter that SubIndex 0 has where each telegram is counted. ``frame`` is that of the last one.
    """

    begin_ns: I64
    frame: I64
    size: I64
    counter: U16
    is_one: Bool
    base: U16
    is_counted: Bool
    last_ns: int
    start: I64
    subindex: I64
    counters: U16

    @staticmethod
    def of(going: Open | None, subindex: I64, counter: U16, time_ns: I64, frame: I64, apart_ns: int) -> _Cut:
        """Cut telegrams that follow an open cycle."""
        begin_ns = int(time_ns[0])
        if going is not None:
            begin_ns, known = going.begin_ns, len(going.counters)
            subindex, frame = np.append(list(going.counters), subindex), np.append(np.full(known, going.frame), frame)
            time_ns = np.append(np.full(known, going.last_ns), time_ns)
            counter = np.append(np.array([*going.counters.values()], np.uint16), counter)
        start = _starts(subindex, time_ns[1:] - time_ns[:-1] > apart_ns)
        size = np.diff(np.append(start, len(frame)))
        begin = time_ns[start].copy()
        begin[0] = begin_ns
        base: U16 = counter - subindex.astype(np.uint16)
        is_one, is_counted = (
            np.logical_and.reduceat(own == np.repeat(own[start], size), start) for own in (counter, base)
        )
        last_ns, last = int(time_ns[-1]), frame[start + size - 1]
        return _Cut(
            begin, last, size, counter[start], is_one, base[start], is_counted, last_ns, start, subindex, counter
        )  # fmt: skip

    def cycle(self, number: int) -> Open:
        """Return one of the cycles, which may be open if it is the last one."""
        number %= len(self.start)
        own = slice(self.start[number], self.start[number] + self.size[number])
        counters = dict(zip(self.subindex[own].tolist(), self.counters[own].tolist(), strict=True))
        return Open(int(self.begin_ns[number]), int(self.frame[number]), self.last_ns, counters)


def _starts(subindex: I64, is_late: Bool) -> I64:
    """Return where cycles begin in telegrams of one sender; ``is_late`` are those, but the first, that are too late."""
    count = len(subindex)
    order = np.argsort(subindex, kind="stable")
    again = np.full(count, count)
    same = subindex[order[1:]] == subindex[order[:-1]]
    again[order[:-1][same]] = order[1:][same]
    # What is the next to be there already, of all from one on; or to be late.
    following = np.minimum.accumulate(again[::-1])[::-1]
    late = np.append(np.flatnonzero(is_late) + 1, count)
    following = np.minimum(following, late[np.searchsorted(late, np.arange(count), "right")])
    # Mostly, they come in their order.
    start = np.append(0, np.flatnonzero((subindex[1:] <= subindex[:-1]) | is_late) + 1)
    if (following[start] == np.append(start[1:], count)).all():
        return start
    found, ahead = [0], following.tolist()
    while ahead[found[-1]] < count:
        found.append(ahead[found[-1]])
    return np.array(found)
