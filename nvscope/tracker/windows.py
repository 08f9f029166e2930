"""Windows: what was counted in each stretch of time of one length, whatever the batches."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from typing import ClassVar

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import PacketBatch
from nvscope.capture.derived import DerivedSource
from nvscope.capture.source import Source
from nvscope.engine.events import Listeners
from nvscope.engine.told import Told
from nvscope.errors import UsageError
from nvscope.tracker.counted import Counted
from nvscope.tracker.joins import Extremes, extremes_of, forget_extremes
from nvscope.tracker.state import TrackerState


class Window(Struct, frozen=True):
    """What was counted from ``start_ns`` to ``end_ns``, the latter not included; numbers are from 0.

    One that is not ``complete`` ends where the traffic does.
    """

    number: int
    start_ns: int
    end_ns: int
    counted: Counted
    complete: bool = True


_BEFORE = -1
"""The number of all that comes before the first window."""


class Windows:
    """Windows of ``length_ns`` from the first frame on, or from ``start_ns``; what came before that is in none.

    Time is that of the latest frame so far: where a clock steps back, frames count for the window that is open. A wait
    in vain counts for the window in which its deadline lies. A window without any frame is a window too; it ends when a
    later frame comes, or the source says that time has passed. A clock that jumps by years leaves many of them.

    Batches have to be cut at the edges: whoever runs this observer runs it on ``cut(source)``. It folds a state of its
    own, which forgets the extremes at each edge: nobody could tell those of a window otherwise. ``listeners`` are told
    of the events of that state, as those of ``TrackerState``.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, length_ns: int, start_ns: int | None = None, *, listeners: Listeners = ()) -> None:
        if length_ns <= 0:
            raise UsageError("a window has to be longer than 0 s", next_step="give a length such as 1s")
        self.length_ns = length_ns
        self._state = TrackerState(listeners=listeners)
        self._start_ns = start_ns
        self._latest_ns: int | None = None
        self._number = _BEFORE
        self._begun = False
        self._extremes: Extremes | None = None
        self._before = Counted.of(self._state)
        self._closed: deque[tuple[int, int, Counted]] = deque()

    @property
    def state(self) -> TrackerState:
        """What was counted so far, in all windows and before them."""
        return self._state

    def cut(self, source: Source) -> Source:
        """Return a source with its batches cut at the edges; the times that it says have passed, too."""
        return _Cut(source, self)

    def pieces(self, packets: PacketBatch) -> Iterator[PacketBatch]:
        """Yield a batch, which follows those before, in pieces without an edge in them; at each edge, time passes."""
        until_ns = packets.until_ns
        if packets.ends:
            # Before time passes behind the ends: then nobody has listened to what they leave open.
            yield PacketBatch.ended(*packets.ends)
            packets = replace(packets, ends=())
        if not len(packets):
            if until_ns is not None:
                yield from self._edges(until_ns)
                yield packets
            return
        if self._start_ns is None:
            self._start_ns = int(packets.ts_ns[0])
        # Where a clock stepped back, there may be more pieces than edges: that does no harm.
        time_ns = np.maximum.accumulate(packets.ts_ns)
        window = np.maximum((time_ns - self._start_ns) // self.length_ns, _BEFORE)
        bounds = [0, *(np.flatnonzero(np.diff(window)) + 1).tolist(), len(packets)]
        for start, stop in pairwise(bounds):
            yield from self._edges(int(time_ns[start]))
            yield replace(packets[start:stop], until_ns=None)
        if until_ns is not None:
            yield from self._edges(until_ns)
            yield PacketBatch.nothing(until_ns)

    def observe(self, told: Told) -> None:
        """Take a piece of a batch, which follows those observed so far."""
        if len(told):
            first_ns, last_ns = int(told.packets.ts_ns[0]), int(told.packets.ts_ns.max())
            self._start_ns = first_ns if self._start_ns is None else self._start_ns
            self._latest_ns = first_ns if self._latest_ns is None else max(first_ns, self._latest_ns)
            number = self._window_of(self._latest_ns)
            self._latest_ns = max(last_ns, self._latest_ns)
            if self._window_of(self._latest_ns) != number or (number > self._number and self._begun):
                raise ValueError("the batch has an edge of a window in it: run the observer on `windows.cut(source)`")
            self._leave_empty(number)
            self._begun = True
        self._state.observe(told)
        if told.until_ns is not None and self._start_ns is not None:
            self._latest_ns = told.until_ns if self._latest_ns is None else max(told.until_ns, self._latest_ns)
            self._end(self._window_of(self._latest_ns))

    def closed(self) -> Iterator[Window]:
        """Yield the windows that have ended since the last call, in their order; each once."""
        while self._closed:
            first, count, counted = self._closed.popleft()
            for number in range(first, first + count):
                yield self._window(number, counted)

    def ended(self) -> Iterator[tuple[Window, int]]:
        """Yield what ``closed`` would, with how many of its like follow each other: of empty ones, the first only."""
        while self._closed:
            first, count, counted = self._closed.popleft()
            yield self._window(first, counted), count

    def open(self) -> Window | None:
        """Return what the window that is open has so far; None where none is. It stays open."""
        if self._number == _BEFORE:
            return None
        assert self._start_ns is not None
        assert self._latest_ns is not None
        start_ns = self._start_ns + self._number * self.length_ns
        counted = (
            Counted.of(self._state, self._extremes)
            .since(self._before, extremes=True)
            .between(start_ns, self._latest_ns)
        )
        return Window(self._number, start_ns, self._latest_ns, counted, complete=False)

    def _window(self, number: int, counted: Counted) -> Window:
        assert self._start_ns is not None
        start_ns = self._start_ns + number * self.length_ns
        end_ns = start_ns + self.length_ns
        return Window(number, start_ns, end_ns, counted.between(start_ns, end_ns))

    def _window_of(self, time_ns: int) -> int:
        """Return the number of the window that a time lies in; all that lies before the first one is ``_BEFORE``."""
        assert self._start_ns is not None
        return max((time_ns - self._start_ns) // self.length_ns, _BEFORE)

    def _edges(self, time_ns: int) -> Iterator[PacketBatch]:
        """Say at each edge up to a time that it has passed, as long as something can end a wait behind it."""
        if self._start_ns is None or self._latest_ns is None:
            return
        # Waits end within the timeout.
        last_ns = min(time_ns, self._latest_ns + self._state.lists.acknowledgement.timeout_ns + self.length_ns)
        edge_ns = self._start_ns + (self._window_of(self._latest_ns) + 1) * self.length_ns
        if edge_ns <= time_ns:
            last_ns = max(last_ns, edge_ns)
        while edge_ns <= last_ns:
            yield PacketBatch.nothing(edge_ns)
            edge_ns += self.length_ns

    def _end(self, number: int) -> None:
        """End all windows before a window; nobody has seen anything of what follows yet."""
        if number <= self._number:
            return
        moment = Counted.of(self._state, self._extremes)
        if self._number > _BEFORE:
            self._closed.append((self._number, 1, moment.since(self._before, extremes=True)))
        self._extremes = extremes_of(self._state, self._extremes)
        forget_extremes(self._state)
        self._before, self._begun = moment, False
        self._number += 1
        self._leave_empty(number)

    def _leave_empty(self, number: int) -> None:
        """End the windows up to a window, in none of which anything was counted."""
        first = max(self._number, 0)
        if number > first:
            nothing = self._before.since(self._before)
            forget_extremes(nothing.state)
            self._closed.append((first, number - first, replace(nothing, extremes=True)))
        self._number = max(number, self._number)


class _Cut(DerivedSource):
    """A source whose batches are cut at the edges of windows."""

    def __init__(self, source: Source, windows: Windows) -> None:
        super().__init__(source)
        self._windows = windows

    def __iter__(self) -> Iterator[PacketBatch]:
        for packets in self._source:
            yield from self._windows.pieces(packets)

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        """Return the part of the source that lies between two times, cut in the same way."""
        return _Cut(self._source.between(start_ns, end_ns), self._windows)
