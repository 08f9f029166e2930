"""Instants: when the values of a session are taken, in the time of the packets.

::

    interval   every samplingInterval, at multiples of it since 1970: the same packets give the same instants, whenever
               a recording of them begins
    cycles     behind each cycle of a list: its telegrams, which come one shortly behind the other

An instant stands behind all packets that had come by then. It is told by the number of the last of them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.datalogger.sender_cycles import SenderCycles
from nvscope.engine.told import Told
from nvscope.view.rows.defined import DefinedRows

HOLE_NS = 3_600_000_000_000
"""Where there is no packet at all for so long, nobody captured, and nothing is taken."""

SET_BACK_NS = 1_000_000_000
"""A clock that steps back by more than this was set; what is less, is packets that were captured out of order."""

MOST_AT_ONCE = 1 << 14
_NEVER = -(1 << 63)
MOST_SENDERS = 1_000
"""Of more senders of a list, nothing is remembered but cycles that may go on, and the values of the last ones."""


class Instants(Struct, frozen=True):
    """Moments, and the frames behind which they are; int64 (n,), frames rising.

    ``sender`` is who sent a cycle, in the numbers of ``DefinedRows.sender``, -1 where it is all the same.
    """

    time_ns: I64
    frame: I64
    sender: I64

    @staticmethod
    def of_all(time_ns: I64, frame: I64) -> Instants:
        """Return instants of whatever sender."""
        return Instants(time_ns, frame, np.full(len(frame), -1))

    def take(self, rows: I64 | slice) -> Instants:
        """Return some of them."""
        return Instants(self.time_ns[rows], self.frame[rows], self.sender[rows])


class Interval:
    """Instants in an interval, as packets come."""

    def __init__(self, interval_ns: int) -> None:
        self._interval_ns = interval_ns
        self._now_ns = _NEVER
        self._next_ns: int | None = None
        self._frame = 0

    def take(self, told: Told, _: DefinedRows) -> Iterator[Instants]:
        """Yield the instants that are over with a batch."""
        first = 0
        ts_ns = told.packets.ts_ns
        while first < len(ts_ns):
            now = np.maximum.accumulate(np.maximum(ts_ns[first:], self._now_ns))
            stop = self._breaks(ts_ns[first:], now)
            yield from self._until(now[:stop], told.first_frame + first)
            first += stop
            if first < len(ts_ns):
                yield from self.end()
        if told.until_ns is not None and self._next_ns is not None and told.until_ns > self._now_ns:
            yield from self._until(np.array([told.until_ns]), self._frame + 1, packets=0)
        if told.is_deaf:
            yield from self.end()

    def end(self) -> Iterator[Instants]:
        """Yield the instants up to the last packet, and wait for another one to begin anew."""
        if self._next_ns is None:
            return
        last = np.array([self._now_ns])
        yield from self._between(self._now_ns + 1, last, self._frame)
        self._next_ns, self._now_ns = None, _NEVER

    def _breaks(self, ts_ns: I64, now: I64) -> int:
        """Return how many of some packets come before the clock is set, or nobody captures for a while."""
        before = np.append(self._now_ns, now[:-1])
        # In front of the first packet, whatever it is, nothing can break.
        known = before > _NEVER
        breaks = known & ((ts_ns < before - SET_BACK_NS) | (ts_ns - before > HOLE_NS))
        if self._next_ns is None:
            breaks[0] = False
        place = np.flatnonzero(breaks)
        return int(place[0]) if len(place) else len(ts_ns)

    def _until(self, now: I64, first_frame: int, packets: int | None = None) -> Iterator[Instants]:
        """Yield the instants in front of the last of some times."""
        if not len(now):
            return
        if self._next_ns is None:
            self._next_ns = -(-int(now[0]) // self._interval_ns) * self._interval_ns
        end_ns = int(now[-1])
        self._now_ns, self._frame = (
            max(end_ns, self._now_ns),
            first_frame + (len(now) if packets is None else packets) - 1,
        )
        yield from self._between(end_ns, now, first_frame)

    def _between(self, end_ns: int, now: I64, first_frame: int) -> Iterator[Instants]:
        """Yield the instants from the next one to before a time."""
        assert self._next_ns is not None
        while self._next_ns < end_ns:
            count = min(-(-(end_ns - self._next_ns) // self._interval_ns), MOST_AT_ONCE)
            time_ns = self._next_ns + self._interval_ns * np.arange(count)
            frame = first_frame + np.searchsorted(now, time_ns, "right") - 1
            self._next_ns += self._interval_ns * count
            yield Instants.of_all(time_ns, frame)


class Cycles:
    """Instants behind the cycles of a list, as its telegrams come.

    ``places`` are those of the list, with their SubIndexes in ``subindexes``, which may come in any order; a cycle is
    over when all of these have come, with a SubIndex that it has already, or with one that comes later than
    ``apart_ns`` behind the one before; and where the clock was set back. ``is_open``: there may be further SubIndexes.
    ``sends_all``: all of them are sent each time, as of a list that is sent cyclically and not on a change.
    ``late`` are the frames of telegrams, of those taken last, that are of a cycle that was over: they are in none.
    ``lost`` are the frames behind which these are missing.
    """

    def __init__(
        self, places: Sequence[int], subindexes: Collection[int], apart_ns: int, *, is_open: bool = False,
        sends_all: bool = False,
    ) -> None:  # fmt: skip
        self._places = np.array(sorted(places), np.int64)
        self._all = frozenset(subindexes)
        self._is_open = is_open
        self._sends_all = sends_all
        self._apart_ns = apart_ns
        self._senders: dict[int, SenderCycles] = {}
        self.late = self.lost = np.empty(0, np.int64)
        self._now_ns = _NEVER

    @property
    def places(self) -> frozenset[int]:
        """The places of the list, where its cycles are of several telegrams."""
        is_one = len(self._all) < 2 and not self._is_open
        return frozenset() if is_one else frozenset(self._places.tolist())

    @property
    def open_frames(self) -> dict[int, int]:
        """The last frames of cycles that may go on, and who sent these."""
        return {one.open.frame: number for number, one in self._senders.items() if one.open}

    def take(self, told: Told, rows: DefinedRows) -> Iterator[Instants]:
        """Yield the instants of the cycles that are over with a batch; within one of them, frames rise."""
        place = np.searchsorted(self._places, rows.place)
        own = np.flatnonzero(
            (place < len(self._places)) & (self._places[np.minimum(place, len(self._places) - 1)] == rows.place)
        )
        if len(self._all) < 2 and not self._is_open:
            if len(own):
                yield Instants.of_all(rows.ts_ns[own], rows.frame[own])
            return
        self.late = self.lost = own[:0]
        ts_ns, first = told.packets.ts_ns, 0
        while first < len(ts_ns):
            stop = first + self._until_set_back(ts_ns[first:])
            bounds = np.searchsorted(rows.frame[own], [told.first_frame + first, told.first_frame + stop])
            if bounds[0] < bounds[1]:
                yield from self._cut(told, rows, own[bounds[0] : bounds[1]])
            if stop < len(ts_ns):
                yield from self.end()
            first = stop
        if told.until_ns is not None:
            self._now_ns = max(self._now_ns, told.until_ns)
        # Packets that are out of order are late by no more than that.
        latest_ns = self._now_ns - self._apart_ns - SET_BACK_NS
        over = {number: one for number, one in self._senders.items() if one.open and one.open.last_ns < latest_ns}
        yield from self._closed(over)
        if len(self._senders) > MOST_SENDERS:
            self._senders = {number: one for number, one in self._senders.items() if one.open}
        if told.is_deaf:
            yield from self.end()

    def end(self) -> Iterator[Instants]:
        """Yield the instants of the cycles that are open."""
        yield from self._closed(self._senders)
        self._senders.clear()
        self._now_ns = _NEVER

    def _closed(self, senders: Mapping[int, SenderCycles]) -> Iterator[Instants]:
        """Yield the instants of the open cycles of some senders."""
        over = [(one.frame, one.begin_ns, number) for number, sender in senders.items() if (one := sender.end())]
        if over:
            frame, begin_ns, number = np.array(sorted(over), np.int64).T
            yield Instants(begin_ns, frame, number)

    def _until_set_back(self, ts_ns: I64) -> int:
        """Return how many of some packets come before the clock is set back, and take their time."""
        now = np.maximum.accumulate(np.maximum(ts_ns, self._now_ns))
        before = np.append(self._now_ns, now[:-1])
        back = np.flatnonzero((before > _NEVER) & (ts_ns < before - SET_BACK_NS))
        stop = int(back[0]) if len(back) else len(ts_ns)
        if stop:
            self._now_ns = int(now[stop - 1])
        return stop

    def _cut(self, told: Told, rows: DefinedRows, own: I64) -> Iterator[Instants]:
        """Cut the telegrams of each sender into cycles: the last frame of each that is over, and when it began."""
        found: list[tuple[I64, I64, I64]] = []
        late: list[int] = []
        lost: list[int] = []
        sender, counter = rows.sender[own], told.batch.counter[rows.frame[own] - told.first_frame]
        for number in np.flatnonzero(np.bincount(sender)).tolist():
            if number not in self._senders:
                subindexes = frozenset[int]() if self._is_open else self._all
                self._senders[number] = SenderCycles(subindexes, self._apart_ns, sends_all=self._sends_all)
            cycles, mine = self._senders[number], np.flatnonzero(sender == number)
            some = rows.take(own[mine])
            begin_ns, last = cycles.take(some.subindex, counter[mine], some.ts_ns, some.frame)
            found.append((begin_ns, last, np.full(len(last), number)))
            late += cycles.late
            lost += cycles.lost
        self.late = np.append(self.late, np.array(sorted(late), np.int64))
        self.lost = np.append(self.lost, np.array(sorted(lost), np.int64))
        instants = Instants(*(np.concatenate(columns) for columns in zip(*found, strict=True)))
        if len(instants.frame):
            yield instants.take(np.argsort(instants.frame, kind="stable"))
