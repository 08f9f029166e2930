"""Moment: what the variables of each stream were at a time, which is the last telegram up to it.

A timeline whose clock steps back passes a time more than once: the moment is the last frame whose time is not later,
and everything captured before that frame counts, whatever its time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import U8
from nvscope.definition.layouts import Layouts
from nvscope.definition.packing import TelegramLayout
from nvscope.engine.told import Told
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream, Telegrams


class LastTelegram(Struct, frozen=True):
    """The last telegram of a stream that its definition fits; ``data`` are the bytes behind the header."""

    stream: Stream
    layout: TelegramLayout
    data: U8
    frame: int
    time_ns: int


class Moment:
    """The last telegram of each stream up to a time, or up to a frame (from 1), that one included.

    Exactly one of ``at`` and ``frame`` is given; ``at`` returns the time, given that of the capture's first frame, and
    ``time_ns`` is what it returned. ``streams`` are what was seen until then, by stream number;
    ``last_frame`` is the last frame that counts (0: none), ``frames`` those observed. ``known`` are all streams seen,
    also after the moment; ``start_ns`` is the time of the first frame, ``end_ns`` the latest one of any. ``read`` tells
    what was looked at.
    """

    by_stream: ClassVar[bool] = True

    def __init__(
        self, layouts: Layouts, *, at: Callable[[int], int] | None = None, frame: int | None = None
    ) -> None:  # fmt: skip
        self._layouts = layouts
        self._at = at
        self._frame = frame
        self.time_ns: int | None = None
        self.read = DataTelegrams()
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

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not len(told):
            return
        time_ns = told.packets.ts_ns
        if self.start_ns is None:
            self.start_ns = told.start_ns
            self.time_ns = self._at(told.start_ns) if self._at else None
        latest = int(time_ns.max())
        self.end_ns = latest if self.end_ns is None else max(self.end_ns, latest)
        until = self._until(told)
        telegrams = self.read.of(told)
        if until:
            self._take(telegrams, 0, told.first_frame + until)
            # Replaced as a whole, so that what follows does not change it.
            self.streams = dict(self._now)
            self.last_frame, self.last_frame_ns = told.first_frame + until - 1, int(time_ns[until - 1])
        self._take(telegrams, told.first_frame + until, told.first_frame + len(told))

    def _until(self, told: Told) -> int:
        """Return how many of the packets count, up to the last one that does."""
        if self._frame is not None:
            return max(0, min(len(told), self._frame - (told.first_frame - 1)))
        assert self.time_ns is not None
        counts = np.flatnonzero(told.packets.ts_ns <= self.time_ns)
        return int(counts[-1]) + 1 if len(counts) else 0

    def _take(self, telegrams: Sequence[Telegrams], begin: int, end: int) -> None:
        """Take those of the telegrams that are in frames from ``begin`` to before ``end``."""
        for part in telegrams:
            first, after = np.searchsorted(part.frame, (begin, end))
            if first == after:
                continue
            stream = part.stream
            shape = part.items, part.data.shape[1]
            layout = self._layouts.telegram_of(stream.list, stream.subindex, shape)
            if layout is None or shape != layout.shape:
                continue
            self.known[stream.number] = stream
            frame = int(part.frame[after - 1])
            before = self._now.get(stream.number)
            if before is None or before.frame < frame:
                data, time_ns = part.data[after - 1].copy(), int(part.time_ns[after - 1])
                self._now[stream.number] = LastTelegram(stream, layout, data, frame, time_ns)
