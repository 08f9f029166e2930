"""Moment: what the variables of each stream were at a time, which is the last telegram up to it.

A timeline whose clock steps back passes a time more than once: the moment is the last frame whose time is not later,
and everything captured before that frame counts, whatever its time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dissectors.batch import U8, PacketBatch
from dissectors.can.pdo import PdoRules
from dissectors.netvar import HEADER, PortRules
from dissectors.varieties import Choose
from nvscope.definition.layouts import Layouts
from nvscope.definition.packing import TelegramLayout
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream


@dataclass(frozen=True, slots=True)
class LastTelegram:
    """The last telegram of a stream that its definition fits; ``data`` are the bytes behind the header."""

    stream: Stream
    layout: TelegramLayout
    data: U8
    frame: int
    time_ns: int


class Moment:
    """The last telegram of each stream up to a time, or up to a frame (from 1), that one included.

    Exactly one of ``time_ns`` and ``frame`` is given. ``streams`` are what was seen until then, by stream number;
    ``last_frame`` is the last frame that counts (0: none), ``frames`` those observed. ``known`` are all streams seen,
    also after the moment; ``start_ns`` is the time of the first frame, ``end_ns`` the latest one of any. ``read`` tells
    what was looked at.
    """

    def __init__(
        self,
        layouts: Layouts,
        *,
        time_ns: int | None = None,
        frame: int | None = None,
        ports: PortRules | None = None,
        choose: Choose | None = None,
        pdos: PdoRules | None = None,
    ) -> None:
        self._layouts = layouts
        self._time_ns = time_ns
        self._frame = frame
        self.read = DataTelegrams(ports, choose, pdos)
        self._now: dict[int, LastTelegram] = {}
        self.streams: dict[int, LastTelegram] = {}
        self.last_frame = 0
        self.last_frame_ns: int | None = None
        self.known: dict[int, Stream] = {}
        self.start_ns: int | None = None
        self.end_ns: int | None = None

    @property
    def frames(self) -> int:
        return self.read.frames

    def observe(self, packets: PacketBatch) -> None:
        """Take the packets that follow those observed so far."""
        if not len(packets):
            return
        time_ns = packets.ts_ns
        if self.start_ns is None:
            self.start_ns = int(time_ns[0])
        latest = int(time_ns.max())
        self.end_ns = latest if self.end_ns is None else max(self.end_ns, latest)
        until = self._until(packets)
        if until:
            self._take(packets[:until])
            # Replaced as a whole, so that what follows does not change it.
            self.streams = dict(self._now)
            self.last_frame, self.last_frame_ns = self.frames, int(time_ns[until - 1])
        self._take(packets[until:])

    def _until(self, packets: PacketBatch) -> int:
        """Return how many of the packets count, up to the last one that does."""
        if self._frame is not None:
            return max(0, min(len(packets), self._frame - self.frames))
        assert self._time_ns is not None
        counts = np.flatnonzero(packets.ts_ns <= self._time_ns)
        return int(counts[-1]) + 1 if len(counts) else 0

    def _take(self, packets: PacketBatch) -> None:
        for piece in self.read.pieces(packets):
            for telegrams in piece:
                stream = telegrams.stream
                shape = telegrams.items, HEADER.size_bytes + telegrams.data.shape[1]
                layout = self._layouts.telegram_of(stream.port, stream.index, stream.subindex, shape)
                if layout is None or shape != (layout.items, layout.length):
                    continue
                self.known[stream.number] = stream
                frame = int(telegrams.frame[-1])
                before = self._now.get(stream.number)
                if before is None or before.frame < frame:
                    data = telegrams.data[-1].copy()
                    self._now[stream.number] = LastTelegram(stream, layout, data, frame, int(telegrams.time_ns[-1]))
