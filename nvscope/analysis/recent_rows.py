"""RecentRows: some frames of a ring by their numbers, recognised as if the whole capture had been read."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.batch import I64, Bool, PacketBatch
from dissectors.can.frame import CanBatch
from dissectors.can.pdo import words
from dissectors.carried import Carrier
from dissectors.netvar import TelegramBatch
from nvscope.analysis.recent_frames import recogniser_of, told_of
from nvscope.capture.packed import packed
from nvscope.engine.ring import Chunk, Recent
from nvscope.engine.told import Told
from nvscope.view.rows.frames import CAN, NETVAR, FrameRows

if TYPE_CHECKING:
    from nvscope.analysis.watching import Scene

_LOOKS_BACK = (256, 4_096, 32_768)
"""So many frames are searched for the one of the same stream before, and none behind them: somebody waits for it."""


class RecentRows:
    """Frames of the rings of one session.

    What is taken is put together in one small batch, wherever it lies; what frames have in common is learned once.
    """

    def __init__(self, scene: Scene) -> None:
        self._channels = scene.channels
        # Whoever asks knows which frames are wanted: others than those that protocols read may be among them.
        reading = scene.inquiry.reading(all_frames=True)
        self._recogniser = recogniser_of(reading, scene.snapshot.infos, lambda: self._channels)

    def rows(self, scene: Scene, numbers: I64, shown_before: int | None = None) -> FrameRows:
        """Return the frames of some numbers, rising, as far as the ring has them.

        ``shown_before`` is the number of the frame that is shown before the first of them.
        """
        self._channels = scene.channels
        recent = scene.recent
        parts: list[PacketBatch] = []
        found: list[I64] = []
        before: list[I64] = []
        for chunk, at in _by_chunk(recent, numbers):
            ts_ns = chunk.packets.ts_ns
            parts.append(_only(chunk.packets, at))
            found.append(at + chunk.first_frame)
            before.append(np.where(at > 0, ts_ns[at - 1], chunk.before_ns))
        if not parts:
            return FrameRows.nothing(0)
        packets = packed(parts)
        (told,) = told_of(self._recogniser, Chunk(packets, 1, int(before[0][0])), recent)
        rows = FrameRows.of(told, told.wanted).placed(np.concatenate(found), np.concatenate(before))
        if shown_before is not None:
            since_ns = np.diff(rows.ts_ns, prepend=recent.time_of(shown_before) or rows.ts_ns[0])
            rows = rows.shown_after(since_ns)
        return rows

    def before_in_stream(self, scene: Scene, number: int) -> FrameRows | None:
        """Return the last frame before one that is of the same stream: the same list, SubIndex, sender and service.

        None where there is none among the last ones before it, and for frames that are of no stream.
        """
        recent = scene.recent
        stream = _stream_of(self.rows(scene, np.array([number])))
        if stream is None:
            return None
        stop = number
        for count in _LOOKS_BACK:
            start = max(number - count, recent.first_frame)
            for chunk in reversed(list(recent.pieces(start, stop))):
                for told in reversed(told_of(self._recogniser, chunk, recent)):
                    same = _rows_of(told, stream)
                    if len(same):
                        return self.rows(scene, same[-1:] + told.first_frame)
            if start == recent.first_frame:
                return None
            stop = start
        return None


_Stream = tuple[str, tuple[int, ...]]
"""The protocol, and what tells a stream there."""


def _stream_of(rows: FrameRows) -> _Stream | None:
    """Return the stream of a frame, None where it is of none."""
    if not len(rows) or (name := rows.name_of(0)) not in _COLUMNS:
        return None
    return name, tuple(int(column[0]) for column in _COLUMNS[name](rows.parts[name].part))


def _columns_of_telegrams(telegrams: TelegramBatch) -> tuple[Any, ...]:
    datagram, header = telegrams.datagram, telegrams.header
    return (
        datagram.source_hi, datagram.source_lo, datagram.destination_port, header["id"], header["index"],
        header["subindex"],
    )  # fmt: skip


def _columns_of_can(frames: CanBatch) -> tuple[Any, ...]:
    return frames.channel, words(frames), frames.remote, frames.error


_COLUMNS: dict[str, Callable[[Any], tuple[Any, ...]]] = {NETVAR: _columns_of_telegrams, CAN: _columns_of_can}


def _rows_of(told: Told, stream: _Stream) -> I64:
    """Return which packets of a batch are of a stream."""
    name, wanted = stream
    if name == CAN:
        if told.can is None:
            return np.empty(0, np.int64)
        return told.can.row[_alike(_columns_of_can(told.can), wanted)].astype(np.int64)
    varieties = told.varieties
    numbers = np.flatnonzero(varieties.carried.carrier == Carrier.UDP)
    own = np.zeros(len(varieties), np.bool_)
    own[numbers] = _alike(_columns_of_telegrams(varieties.telegrams_of(numbers)), wanted)
    return np.flatnonzero(own[told.variety])


def _alike(columns: tuple[Any, ...], wanted: tuple[int, ...]) -> Bool:
    same = np.ones(len(columns[0]), np.bool_)
    for column, value in zip(columns, wanted, strict=True):
        same &= column == column.dtype.type(value)
    return same


def _by_chunk(recent: Recent, numbers: I64) -> Iterator[tuple[Chunk, I64]]:
    """Yield the chunks that have some of the numbers, with the rows of these."""
    numbers = numbers[(numbers >= recent.first_frame) & (numbers < recent.stop_frame)]
    at = 0
    while at < len(numbers):
        place = bisect_right(recent.chunks, int(numbers[at]), key=lambda chunk: chunk.first_frame) - 1
        chunk = recent.chunks[place]
        stop = at + int(np.searchsorted(numbers[at:], chunk.stop_frame))
        yield chunk, numbers[at:stop] - chunk.first_frame
        at = stop


def _only(packets: PacketBatch, rows: I64) -> PacketBatch:
    """Return some packets of a batch, over the same buffer."""

    return packets.take(rows)
