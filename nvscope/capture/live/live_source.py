"""A live source: packets of an inlet as they come, until somebody or something ends it.

Where nothing comes it says so (``until_ns``), so that waits end and others are not held back.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from msgspec import Struct

from dissectors.batch import PacketBatch
from nvscope.capture.live.heap import Heap
from nvscope.capture.live.inlet import Inlet
from nvscope.capture.live.system_clock import SystemClock
from nvscope.capture.live.wait import Wait
from nvscope.capture.source import Attachment, LostSpan, Source, SourceInfo
from nvscope.capture.time_span import TimeSpan

TICK_NS = 200_000_000
"""Time passes at least so often."""

_LOOK_NS = 10_000_000
"""While packets are gathered, it looks so often whether there is room for more."""

_MOST_TIMES = 10_000


class Autostop(Struct, frozen=True):
    """When a live source ends by itself: after a time, a number of packets, or of bytes; None for never."""

    duration_ns: int | None = None
    packets: int | None = None
    size_bytes: int | None = None


class LiveSource:
    """The packets of an inlet; a ``Source``, and a track of a timeline.

    ``wait`` is shared by sources that are read beside each other. ``stop`` takes in nothing more; what the kernel has
    taken until then still comes. It can be iterated once.
    """

    def __init__(self, inlet: Inlet, wait: Wait, autostop: Autostop | None = None) -> None:
        self.path = inlet.path
        self._inlet = inlet
        self._wait = wait
        self._autostop = autostop or Autostop()
        self._clock = SystemClock()
        self._heap = Heap()
        self._opened_ns = time.monotonic_ns()
        self._info = SourceInfo(inlet.path, inlet.format, is_live=True, hears_answers=inlet.hears_answers)
        self._stopping = False
        self._begun = False
        self._taken_ns = 0
        self._carrier: list[tuple[int, int | None]] = []
        self._lost: list[LostSpan] = []
        self._now_ns: int | None = None
        self._told_ns: int | None = None
        self._longest_wait_ns = TICK_NS
        if inlet.fileno() >= 0:
            wait.add(inlet.fileno())

    @property
    def infos(self) -> Sequence[SourceInfo]:
        return [self._info]

    @property
    def channels(self) -> Sequence[str]:
        return self._inlet.channels

    @property
    def attachments(self) -> Sequence[Attachment]:
        return ()

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        return _Part(self, TimeSpan.of(start_ns, end_ns))

    def stop(self) -> None:
        """Take in nothing more; for any thread and signal handlers, also repeatedly."""
        self._stopping = True
        self._wait.wake()

    def __iter__(self) -> Iterator[PacketBatch]:
        return self.read(1, TimeSpan())

    def read(self, share: int, span: TimeSpan) -> Iterator[PacketBatch]:
        """Yield what comes; those outside the span are not left out."""
        if self._begun:
            return
        self._begun = True
        try:
            while not self._is_over():
                self._gather()
                batch = self._inlet.take()
                if batch is None:
                    self._wait.wait(min(self._longest_wait_ns, self._left_ns()))
                # In front of the last take: who is stopped between the two (Ctrl-Z) must not miss what came meanwhile.
                until_ns = self._look()
                if batch is None:
                    batch = self._inlet.take()
                self._taken_ns = time.monotonic_ns()
                self._heap.give_back()
                if batch is None:
                    self._tell()
                    yield PacketBatch.nothing(until_ns)
                else:
                    yield self._counted(batch)
            for batch in self._inlet.drain():
                yield self._counted(batch)
            self._look()
            self._tell()
        finally:
            self._close()

    def _look(self) -> int | None:
        """Look at clock and carrier; return up to when all that came has been given out, None if nobody knows."""
        now_ns = self._now_ns = self._clock.look()
        self._look_at_carrier(now_ns)
        return now_ns - self._inlet.lag_ns

    def _gather(self) -> None:
        """Wait until it pays to take what is there: sources that are read beside each other do so at the same time."""
        until_ns = self._taken_ns + self._inlet.gather_ns
        while (left_ns := min(until_ns - time.monotonic_ns(), self._left_ns())) > 0 and not self._stopping:
            if self._inlet.is_filling():
                return
            self._wait.pause(min(left_ns, _LOOK_NS))

    def _is_over(self) -> bool:
        limits, info = self._autostop, self._info
        return (
            self._stopping
            or self._left_ns() <= 0
            or (limits.packets is not None and info.frames >= limits.packets)
            or (limits.size_bytes is not None and info.bytes >= limits.size_bytes)
            or bool(self._inlet.failure())
        )

    def _left_ns(self) -> int:
        duration_ns = self._autostop.duration_ns
        return TICK_NS if duration_ns is None else self._opened_ns + duration_ns - time.monotonic_ns()

    def _counted(self, batch: PacketBatch) -> PacketBatch:
        """Count the packets of a batch, or of as many of them as are wanted."""
        if self._autostop.packets is not None:
            batch = batch[: max(self._autostop.packets - self._info.frames, 0)]
        if len(batch):
            start_ns, end_ns = int(batch.ts_ns[0]), int(batch.ts_ns[-1])
            self._info = replace(
                self._info,
                frames=self._info.frames + len(batch),
                bytes=self._info.bytes + int(batch.captured.sum(dtype=np.int64)),
                start_ns=start_ns if self._info.start_ns is None else self._info.start_ns,
                end_ns=end_ns,
            )
        self._tell()
        return batch

    def _tell(self) -> None:
        drops = self._inlet.drops()
        self._note_lost(0 if drops is None else sum(drops.values()) - (self._info.drops or 0))
        self._info = replace(
            self._info,
            drops=None if drops is None else sum(drops.values()),
            drops_by={} if drops is None else _Drops(drops),
            clock_steps=self._clock.steps,
            failure="" if self._stopping else self._inlet.failure(),
            without_carrier=tuple(self._carrier),
            lost=tuple(self._lost),
        )

    def _note_lost(self, packets: int) -> None:
        """Note that so many packets more were lost since somebody looked last."""
        since_ns, self._told_ns = self._told_ns, self._now_ns
        if packets <= 0:
            return
        last = self._lost[-1] if self._lost else None
        # Times that follow each other are one; of too many, the last one goes on.
        if last is not None and (last.until_ns == since_ns or len(self._lost) >= _MOST_TIMES):
            self._lost[-1] = LostSpan(last.since_ns, self._now_ns, last.packets + packets)
        else:
            self._lost.append(LostSpan(since_ns, self._now_ns, packets))

    def _look_at_carrier(self, now_ns: int) -> None:
        """Note when the inlet loses its carrier, and when that is over."""
        without = bool(self._carrier) and self._carrier[-1][1] is None
        if self._inlet.has_carrier() != without:
            return
        if without:
            self._carrier[-1] = self._carrier[-1][0], now_ns
        elif len(self._carrier) < _MOST_TIMES:
            self._carrier.append((now_ns, None))

    def _close(self) -> None:
        with suppress(OSError, ValueError):
            self._wait.remove(self._inlet.fileno())
        self._inlet.close()


class _Drops(dict[str, int]):
    """Drops by part; not to be changed."""

    def __init__(self, told: Mapping[str, int]) -> None:
        super().__init__({name: count for name, count in told.items() if count})


class _Part:
    """What of a live source lies in a span of time."""

    def __init__(self, source: LiveSource, span: TimeSpan) -> None:
        self._source, self._span = source, span

    @property
    def infos(self) -> Sequence[SourceInfo]:
        return self._source.infos

    @property
    def channels(self) -> Sequence[str]:
        return self._source.channels

    @property
    def attachments(self) -> Sequence[Attachment]:
        return ()

    def stop(self) -> None:
        self._source.stop()

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        return _Part(self._source, self._span & TimeSpan.of(start_ns, end_ns))

    def __iter__(self) -> Iterator[PacketBatch]:
        for batch in self._source:
            part = self._span.part(batch)
            if part is not None:
                yield part
