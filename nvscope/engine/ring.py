"""FrameRing: the frames that came last, kept in a bounded number of bytes, to be read again as a source."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import PacketBatch
from nvscope.capture.packed import packed
from nvscope.capture.source import Attachment, Source, SourceInfo
from nvscope.capture.spans import stretches
from nvscope.capture.time_span import TimeSpan
from nvscope.engine.told import Told

RING_BYTES = 256 << 20
"""So much is kept unless somebody says otherwise: minutes of a busy plant."""

_CHUNK_PACKETS = 65_536
_LEAST_CHUNKS = 8
"""What has to go when more comes is at most such a part of all."""

_COLUMNS_BYTES = 40
"""What a frame takes beside its bytes."""

_CHUNK_BYTES = 2048
"""What a chunk takes beside its frames."""


class Chunk(Struct, frozen=True):
    """Frames that follow each other, the first of which has the number ``first_frame``; ``before_ns`` is the time of
    the frame before it, its own where there is none."""

    packets: PacketBatch
    first_frame: int
    before_ns: int

    @property
    def stop_frame(self) -> int:
        """The number of the frame behind the last one."""
        return self.first_frame + len(self.packets)

    @property
    def bytes(self) -> int:
        return self.packets.data.nbytes + _COLUMNS_BYTES * len(self.packets) + _CHUNK_BYTES


class Recent(Struct, frozen=True):
    """The frames that a ring held at a moment; a value that stays as it is.

    Frames are told by their numbers in the capture, from 1. ``start_ns`` is the time of the capture's first frame,
    ``bytes`` what the frames take of ``most_bytes``, ``passed`` how many frames the ring has let go.
    """

    chunks: Sequence[Chunk] = ()
    start_ns: int = 0
    bytes: int = 0
    passed: int = 0
    most_bytes: int = RING_BYTES

    @property
    def first_frame(self) -> int:
        """The number of the oldest frame."""
        return self.chunks[0].first_frame if self.chunks else self.passed + 1

    @property
    def stop_frame(self) -> int:
        """The number of the frame behind the last one."""
        return self.chunks[-1].stop_frame if self.chunks else self.passed + 1

    def __len__(self) -> int:
        return self.stop_frame - self.first_frame

    @property
    def first_ns(self) -> int | None:
        """The time of the oldest frame, None without any."""
        return int(self.chunks[0].packets.ts_ns[0]) if self.chunks else None

    def pieces(self, first_frame: int = 0, stop_frame: int | None = None) -> Iterator[Chunk]:
        """Yield the frames from one number to before another, as far as they are there, in their order."""
        stop = self.stop_frame if stop_frame is None else min(stop_frame, self.stop_frame)
        place = max(bisect_right(self.chunks, first_frame, key=lambda chunk: chunk.first_frame) - 1, 0)
        for chunk in self.chunks[place:]:
            if chunk.first_frame >= stop:
                return
            begin, end = max(first_frame - chunk.first_frame, 0), min(stop, chunk.stop_frame) - chunk.first_frame
            if begin >= end:
                continue
            before_ns = int(chunk.packets.ts_ns[begin - 1]) if begin else chunk.before_ns
            yield Chunk(chunk.packets[begin:end], chunk.first_frame + begin, before_ns)

    def frame_at(self, time_ns: int) -> int:
        """Return the number of the last frame that is not later than a time, where times rise; the first if all are."""
        found = self.first_frame
        for chunk in self.chunks:
            ts_ns = chunk.packets.ts_ns
            if int(ts_ns[0]) > time_ns:
                break
            found = chunk.first_frame + max(int(np.searchsorted(ts_ns, time_ns, "right")) - 1, 0)
        return found

    def time_of(self, frame: int) -> int | None:
        """Return the time of a frame, None where it is not there."""
        for chunk in self.pieces(frame, frame + 1):
            return int(chunk.packets.ts_ns[0])
        return None


class FrameRing:
    """Keeps the frames that came last, of ``most_bytes`` at most; an observer.

    Small batches are put together, so that their number stays small; each frame is copied a few times at most.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, most_bytes: int = RING_BYTES) -> None:
        self.most_bytes = most_bytes
        self._chunks: deque[Chunk] = deque()
        self._bytes = 0
        self._start_ns = 0
        self._passed = 0

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not len(told):
            return
        self._start_ns = told.start_ns
        most = self.most_bytes // _LEAST_CHUNKS
        frames = max(min(most // (2 * _COLUMNS_BYTES), _CHUNK_PACKETS), 1)
        for rows in stretches(told.packets.captured, frames, most // 2):
            before_ns = int(told.packets.ts_ns[rows.start - 1]) if rows.start else told.before_ns
            self._take(Chunk(packed([told.packets[rows]]), told.first_frame + rows.start, before_ns))

    def _take(self, chunk: Chunk) -> None:
        self._append(chunk)
        chunks = self._chunks
        # As sizes double towards the oldest, a frame is copied once for each doubling.
        while len(chunks) > 1 and len(chunks[-2].packets) < 2 * len(chunks[-1].packets):
            if len(chunks[-2].packets) + len(chunks[-1].packets) > _CHUNK_PACKETS:
                break
            if chunks[-2].bytes + chunks[-1].bytes > self.most_bytes // _LEAST_CHUNKS:
                break
            last, before = self._pop(), self._pop()
            self._append(Chunk(packed([before.packets, last.packets]), before.first_frame, before.before_ns))
        while self._bytes > self.most_bytes and len(chunks) > 1:
            oldest = chunks.popleft()
            self._bytes -= oldest.bytes
            self._passed += len(oldest.packets)

    def recent(self) -> Recent:
        """Return what is kept at this moment."""
        return Recent(tuple(self._chunks), self._start_ns, self._bytes, self._passed, self.most_bytes)

    def _append(self, chunk: Chunk) -> None:
        self._chunks.append(chunk)
        self._bytes += chunk.bytes

    def _pop(self) -> Chunk:
        chunk = self._chunks.pop()
        self._bytes -= chunk.bytes
        return chunk


class RecentSource:
    """Recent frames, from one number to before another, as a source that can be read again.

    What else is known of the source that they came from is as ``infos`` and ``channels`` say.
    """

    def __init__(
        self, recent: Recent, infos: Sequence[SourceInfo] = (), channels: Sequence[str] = (), first_frame: int = 0,
        stop_frame: int | None = None, span: TimeSpan | None = None,
    ) -> None:  # fmt: skip
        self._recent = recent
        self.infos = infos
        self.channels = channels
        self._first, self._stop_frame = first_frame, stop_frame
        self._span = span or TimeSpan()
        self._stopped = False

    @property
    def attachments(self) -> Sequence[Attachment]:
        return ()

    def __iter__(self) -> Iterator[PacketBatch]:
        for chunk in self._recent.pieces(self._first, self._stop_frame):
            if self._stopped:
                return
            part = self._span.part(chunk.packets)
            if part is not None:
                yield part

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        span = self._span & TimeSpan.of(start_ns, end_ns)
        return RecentSource(self._recent, self.infos, self.channels, self._first, self._stop_frame, span)

    def stop(self) -> None:
        self._stopped = True
