"""Instants: when the values of a session are taken, in the time of the packets.

::

    interval   every samplingInterval, at multiples of it since 1970: the same packets give the same instants, whenever
               a recording of them begins
    cycles     behind each cycle of a list: its telegrams, which come one shortly behind the other

An instant stands behind all packets that had come by then. It is told by the number of the last of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dissectors.batch import I64
from nvscope.engine.told import Told
from nvscope.view.rows.defined import DefinedRows

HOLE_NS = 3_600_000_000_000
"""Where there is no packet at all for so long, nobody captured, and nothing is taken."""

SET_BACK_NS = 1_000_000_000
"""A clock that steps back by more than this was set; what is less, is packets that were captured out of order."""

MOST_AT_ONCE = 1 << 14
_NEVER = -(1 << 63)


@dataclass(frozen=True, slots=True)
class Instants:
    """Moments, and the frames behind which they are; int64 (n,), frames rising.

    ``begins``: in front of the first of them nobody captured for a while.
    """

    time_ns: I64
    frame: I64
    begins: bool = False

    def take(self, rows: slice) -> Instants:
        """Return some of them, which follow each other."""
        return Instants(self.time_ns[rows], self.frame[rows], self.begins and not rows.start)


class Interval:
    """Instants in an interval, as packets come."""

    def __init__(self, interval_ns: int) -> None:
        self._interval_ns = interval_ns
        self._now_ns = _NEVER
        self._next_ns: int | None = None
        self._frame = 0
        self._begins = False

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
                set_back = ts_ns[first] < self._now_ns
                yield from self._closed(unseen=not set_back)
        if told.until_ns is not None and self._next_ns is not None and told.until_ns > self._now_ns:
            yield from self._until(np.array([told.until_ns]), self._frame + 1, packets=0)
        if told.is_deaf:
            yield from self._closed(unseen=True)

    def end(self) -> Iterator[Instants]:
        """Yield the instants up to the last packet: nothing follows it."""
        yield from self._closed(unseen=False)

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
            yield Instants(time_ns, frame, self._begins)
            self._begins = False

    def _closed(self, *, unseen: bool) -> Iterator[Instants]:
        """Yield the instants up to the last time, and wait for a packet to begin anew; ``unseen``: nobody captures."""
        if self._next_ns is None:
            return
        last = np.array([self._now_ns])
        yield from self._between(self._now_ns + 1, last, self._frame)
        self._next_ns, self._now_ns = None, _NEVER
        self._begins |= unseen


class Cycles:
    """Instants behind the cycles of a list, as its telegrams come.

    ``places`` are those of the list, with their SubIndexes in ``subindexes``; a cycle is over with the last of these,
    with a SubIndex that does not follow, or with one that comes later than ``apart_ns`` behind the one before.
    """

    def __init__(self, places: Sequence[int], subindexes: Sequence[int], apart_ns: int) -> None:
        self._places = np.array(sorted(places), np.int64)
        self._last = max(subindexes, default=0)
        self._apart_ns = apart_ns
        self._open: dict[int, tuple[int, int, int, int]] = {}
        self._begins = False

    def take(self, told: Told, rows: DefinedRows) -> Iterator[Instants]:
        """Yield the instants of the cycles that are over with a batch."""
        place = np.searchsorted(self._places, rows.place)
        own = np.flatnonzero(
            (place < len(self._places)) & (self._places[np.minimum(place, len(self._places) - 1)] == rows.place)
        )
        if len(own):
            if self._last == 0:
                yield self._told(rows.ts_ns[own], rows.frame[own])
            else:
                yield from self._cut(rows, own)
        if told.is_deaf:
            yield from self.end()
            self._begins = True

    def end(self) -> Iterator[Instants]:
        """Yield the instants of the cycles that are open."""
        waiting = sorted(self._open.values(), key=lambda one: one[1])
        self._open.clear()
        if waiting:
            yield self._told(np.array([one[0] for one in waiting]), np.array([one[1] for one in waiting]))

    def _told(self, time_ns: I64, frame: I64) -> Instants:
        begins, self._begins = self._begins, False
        return Instants(time_ns, frame, begins)

    def _cut(self, rows: DefinedRows, own: I64) -> Iterator[Instants]:
        """Cut the telegrams of each sender into cycles: the last frame of each that is over, and when it began."""
        found: list[tuple[I64, I64]] = []
        sender = rows.sender[own]
        for number in np.flatnonzero(np.bincount(sender)).tolist():
            mine = own[sender == number]
            found.append(self._of_sender(number, rows.subindex[mine], rows.ts_ns[mine], rows.frame[mine]))
        time_ns, frame = (np.concatenate([one[column] for one in found]) for column in (0, 1))
        order = np.argsort(frame, kind="stable")
        if len(order):
            yield self._told(time_ns[order], frame[order])

    def _of_sender(self, number: int, subindex: I64, time_ns: I64, frame: I64) -> tuple[I64, I64]:
        if number in self._open:
            begin_ns, last_frame, last_ns, last_subindex = self._open.pop(number)
            subindex, frame = np.append(last_subindex, subindex), np.append(last_frame, frame)
            time_ns = np.append(last_ns, time_ns)
        else:
            begin_ns = int(time_ns[0])
        begins = np.ones(len(frame), np.bool_)
        begins[1:] = (subindex[1:] <= subindex[:-1]) | (time_ns[1:] - time_ns[:-1] > self._apart_ns)
        start = np.flatnonzero(begins)
        stop = np.append(start[1:], len(frame))
        begin, last = time_ns[start].copy(), stop - 1
        begin[0] = begin_ns
        if subindex[-1] < self._last:
            self._open[number] = int(begin[-1]), int(frame[-1]), int(time_ns[-1]), int(subindex[-1])
            begin, last = begin[:-1], last[:-1]
        return begin, frame[last]
