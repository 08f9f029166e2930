"""Sender cycles: which telegrams of one sender make a cycle of a list, and which come too late for theirs.

Senders that count by stream, or by send, give all telegrams of a cycle one Counter. Where the last whole cycle had it
so, Counters tell what SubIndexes and time do not::

    A1 A2 B1 B2      B1 is of the cycle that A1 began and A2 ended: it is late, and makes no cycle with A2
    A1 B2 A2         B2 begins the next cycle

    A1 C1 B1 B2 C2   B is late as a whole, in the middle of C
    A1 A2 B1 A2      A2 is sent once more

    A1 …      A2     A goes on, however late: the cycle before it had another Counter

Of senders that count over all that they send, nobody knows. Nor is a second Counter believed that says so before
another whole cycle has come: the sender may count in another way since. One that is late is, of a sender whose cycles
count on one by one; of one that does not, nobody knows which Counters there are to come.

What is late is lost, as if it had not come: the next telegram of its SubIndex is behind that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U16, Bool
from nvscope.tracker.steps import WINDOW

_WRAP = 1 << 16


class Open(NamedTuple):
    """A cycle that may go on: when it began, its last telegram, and the Counter of its first, ``is_one``: of all."""

    begin_ns: int
    frame: int
    last_ns: int
    subindexes: frozenset[int]
    counter: int
    is_one: bool


class SenderCycles:
    """Cuts the telegrams of one sender into cycles.

    ``subindexes`` are those of a whole cycle, empty where nobody knows all; ``sends_all``: all of them are sent each
    time, and Counters tell something. What comes later than ``apart_ns`` behind
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
        self._newest = 0
        """The Counter that the last cycle began with."""
        self._doubted: int | None = None
        """The Counter that has told something since the last whole cycle."""
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
        if not self._sends_all or (not self._is_sure and not (is_whole & cut.is_one).any()):
            return self._taken(cut, is_whole)
        step = np.diff(np.append(self._newest if self._is_sure else cut.counter[0], cut.counter)).astype(np.int16)
        may_go_on = (step[1:] == 0) & ~is_whole[:-1]
        if cut.is_one.all() and (step >= 0).all() and not may_go_on.any() and not self._owing:
            self._remember(cut, is_whole)
            return self._taken(cut, is_whole)
        over = [
            one
            for row in zip(subindex.tolist(), counter.tolist(), time_ns.tolist(), frame.tolist(), strict=True)
            for one in self._one(*row)
        ]
        return np.array([one.begin_ns for one in over], np.int64), np.array([one.frame for one in over], np.int64)

    def end(self) -> Open | None:
        """Return the cycle that was open; it is over."""
        over, self.open = self.open, None
        if over is not None and self._is_sure:
            self._note_torn(over.counter, over.subindexes)
        return over

    def _taken(self, cut: _Cut, is_whole: Bool) -> tuple[I64, I64]:
        """Return the cycles of a cut; the last one may be open."""
        begin_ns, last = cut.begin_ns, cut.frame
        self.open = None
        if not is_whole[-1]:
            self.open = Open(
                int(begin_ns[-1]), int(last[-1]), cut.last_ns, cut.subindexes(-1), int(cut.counter[-1]),
                bool(cut.is_one[-1]),
            )  # fmt: skip
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
            self._doubted = None
        self._newest = int(cut.counter[-1])
        newest: dict[int, int] = {}
        for row in range(len(is_whole) - 1, max(first, len(is_whole) - WINDOW) - 1, -1):
            newest = dict.fromkeys(cut.subindexes(row), int(cut.counter[row])) | newest
            if is_whole[row]:
                break
        self._newest_of |= newest
        for one in cut.counter[noted:][-2 * WINDOW :].tolist():
            self._had.take(one)
        torn = cut.counter[~is_whole].tolist()
        for row in np.flatnonzero(np.isin(cut.counter, [*self._torn, *torn])).tolist():
            self._torn.pop(int(cut.counter[row]), None)
            if first <= row < len(is_whole) - 1 and not is_whole[row]:
                self._note_torn(int(cut.counter[row]), cut.subindexes(row))

    def _note_torn(self, counter: int, subindexes: frozenset[int]) -> None:
        self._torn.pop(counter, None)
        self._had_late.discard(counter)
        self._torn[counter] = subindexes
        if len(self._torn) > WINDOW:
            del self._torn[next(iter(self._torn))]

    def _one(self, subindex: int, counter: int, time_ns: int, frame: int) -> list[Open]:
        """Take one telegram, and return the cycles that are over for it."""
        over, going = [], self.open
        is_believed = self._is_sure and self._doubted in (None, counter)
        if going is not None and going.is_one and self._is_again(subindex, counter):
            self.late.append(frame)
            return []
        if self._is_late(subindex, counter, is_believed=is_believed):
            self._doubted = counter if self._doubted is None else self._doubted
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
            is_next = subindex in going.subindexes
            if not is_next and time_ns - going.last_ns > self._apart_ns:
                goes_on = going.is_one and counter == going.counter and self._had.has_moved
                is_next = not goes_on or not (is_believed or self._had.one_by_one)
            if not is_next and is_believed and 1 <= (counter - going.counter) % _WRAP <= WINDOW:
                self._doubted, is_next = counter, True
            if is_next:
                over += [one for one in [self.end()] if one]
        if self.open is None:
            self._torn.pop(counter, None)
            self._newest = counter
            self._had.take(counter)
            self.open = Open(time_ns, frame, time_ns, frozenset({subindex}), counter, is_one=True)
        else:
            is_one = self.open.is_one and self.open.counter == counter
            subindexes = self.open.subindexes | {subindex}
            self.open = Open(self.open.begin_ns, frame, time_ns, subindexes, self.open.counter, is_one)
        if self._all and self.open.subindexes == self._all:
            over.append(self.open)
            self._end_whole(self.open)
        return over

    def _is_late(self, subindex: int, counter: int, *, is_believed: bool) -> bool:
        """Return whether a telegram is of a cycle that was over, or had none, in the middle of another."""
        if not self._is_sure or not 1 <= (self._newest - counter) % _WRAP <= WINDOW:
            return False
        if counter in self._torn:
            return subindex not in self._torn[counter] and (is_believed or self._had.one_by_one)
        return self._had.one_by_one and self._had.passed_over(counter)

    def _is_again(self, subindex: int, counter: int) -> bool:
        """Return whether a telegram was there: it is sent once more, in the middle of a later cycle."""
        if not self._is_sure or not 1 <= (self._newest - counter) % _WRAP <= WINDOW:
            return False
        was_there = subindex in self._torn[counter] if counter in self._torn else self._had.had(counter)
        return was_there and self._had.has_moved and self._had.one_by_one

    def _end_whole(self, cycle: Open) -> None:
        self.open = None
        if cycle.is_one:
            if not self._is_sure:
                self._torn, self._had = {}, _Counters()
                self._had.take(cycle.counter)
                self._newest_of = dict.fromkeys(cycle.subindexes, cycle.counter)
            self._newest, self._doubted = cycle.counter, None
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

    ``counter`` is that of the first telegram, ``is_one`` whether it is that of all; ``frame`` is that of the last one.
    """

    begin_ns: I64
    frame: I64
    size: I64
    counter: U16
    is_one: Bool
    last_ns: int
    start: I64
    subindex: I64

    @staticmethod
    def of(going: Open | None, subindex: I64, counter: U16, time_ns: I64, frame: I64, apart_ns: int) -> _Cut:
        """Cut telegrams that follow an open cycle."""
        begin_ns, is_one = int(time_ns[0]), True
        if going is not None:
            begin_ns, is_one, known = going.begin_ns, going.is_one, np.array(sorted(going.subindexes))
            subindex, frame = np.append(known, subindex), np.append(np.full(len(known), going.frame), frame)
            time_ns = np.append(np.full(len(known), going.last_ns), time_ns)
            counter = np.append(np.full(len(known), going.counter, np.uint16), counter)
        start = _starts(subindex, time_ns[1:] - time_ns[:-1] > apart_ns)
        stop = np.append(start[1:], len(frame))
        begin = time_ns[start].copy()
        begin[0] = begin_ns
        same = np.logical_and.reduceat(counter == np.repeat(counter[start], stop - start), start)
        same[0] &= is_one
        last = stop - 1
        return _Cut(begin, frame[last], stop - start, counter[start], same, int(time_ns[-1]), start, subindex)

    def subindexes(self, cycle: int) -> frozenset[int]:
        """Return the SubIndexes of a cycle."""
        bounds = np.append(self.start, len(self.subindex))
        cycle %= len(self.start)
        return frozenset(self.subindex[bounds[cycle] : bounds[cycle + 1]].tolist())


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
