"""Several captures as one timeline: always the packet next whose capture has the earliest one to offer.

Every capture keeps its own order, also where its clock steps back. That is the order of the packets sorted by the
latest time of their capture so far, then by capture, then by place in it; so it is computed, a stretch at a time.
Captures are ordered by their first time, then by path, so that the order in which they are given does not matter.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from dissectors.batch import I64, PAD_BYTES, U8, PacketBatch
from dissectors.can.frame import channels_of
from dissectors.can.pdo import channel_name
from nvscope.capture.source import SourceInfo
from nvscope.capture.spans import BATCH_BYTES, copy_spans, stretches

_MAX_CHANNEL = 0xFFFF


class Track(Protocol):
    """A source that can be merged with others."""

    path: str

    @property
    def infos(self) -> list[SourceInfo]: ...

    @property
    def channels(self) -> Sequence[str]: ...

    @property
    def size_bytes(self) -> int | None: ...

    @property
    def position_bytes(self) -> int: ...

    def first_ts_ns(self) -> int | None:
        """Return the time of the first packet, or None where there is none."""
        ...

    def first_batches(self) -> list[PacketBatch]:
        """Return what the source begins with, if anything; it is read again later."""
        ...

    def read(self, share: int) -> Iterator[PacketBatch]:
        """Yield the packets, with a ``share``-th of the memory that a single source would take."""
        ...


class _Head:
    """A track that is being read: those of its packets in memory that are not yet passed on, and what sorts them."""

    def __init__(self, rank: int, batches: Iterator[PacketBatch]) -> None:
        self.rank = rank
        self._batches = batches
        self._latest_ns = np.iinfo(np.int64).min
        self.batch: PacketBatch
        self.keys: I64 = np.empty(0, np.int64)

    def advance(self) -> bool:
        """Take the next batch; False at the end of the track."""
        for batch in self._batches:
            if len(batch):
                self.batch = batch
                self.keys = np.maximum.accumulate(batch.ts_ns)
                np.maximum(self.keys, self._latest_ns, out=self.keys)
                self._latest_ns = int(self.keys[-1])
                return True
        return False

    def take(self, bound: tuple[int, int]) -> tuple[PacketBatch, I64]:
        """Take away the packets, and their keys, that are not behind a key of a rank."""
        count = int(np.searchsorted(self.keys, bound[0], "right" if self.rank <= bound[1] else "left"))
        taken = self.batch[:count], self.keys[:count]
        self.batch, self.keys = self.batch[count:], self.keys[count:]
        return taken


class Timeline:
    """The packets of several tracks by time, and what is known of the tracks in the order they were given.

    Channels of one name are one channel, whichever track they are of; those beyond 65 536 names are the last one.
    """

    def __init__(self, tracks: Sequence[Track], *, batch_packets: int = 32_768, batch_bytes: int = BATCH_BYTES) -> None:
        self._tracks = tracks
        self.channels: list[str] = []
        self._numbers: dict[str, int] = {}
        self._batch_packets = batch_packets
        self._batch_bytes = batch_bytes

    @property
    def infos(self) -> list[SourceInfo]:
        return [info for track in self._tracks for info in track.infos]

    @property
    def size_bytes(self) -> int | None:
        """The bytes of all tracks, or None where one does not know how many it has."""
        sizes = [track.size_bytes for track in self._tracks]
        return None if None in sizes else sum(size for size in sizes if size is not None)

    @property
    def position_bytes(self) -> int:
        return sum(track.position_bytes for track in self._tracks)

    def first_batches(self) -> Iterator[PacketBatch]:
        """Yield what each track begins with, if anything; it is read again later."""
        for track in self._tracks:
            yield from track.first_batches()

    def __iter__(self) -> Iterator[PacketBatch]:
        starts: list[tuple[int, str, int]] = []
        for number, track in enumerate(self._tracks):
            first_ns = track.first_ts_ns()
            if first_ns is not None:
                starts.append((first_ns, track.path, number))
            else:
                # Nothing comes of it, but what is wrong with it is found out by reading it.
                for _ in track.read(1):
                    pass
        waiting = [(first_ns, rank, number) for rank, (first_ns, _, number) in enumerate(sorted(starts))]
        waiting.reverse()
        heads: list[_Head] = []
        while heads or waiting:
            # Up to here no packet can still come that would have to be before.
            bound = min(((int(head.keys[-1]), head.rank) for head in heads), default=None)
            if bound is None or (waiting and waiting[-1][:2] < bound):
                _, rank, number = waiting.pop()
                track = self._tracks[number]
                head = _Head(rank, self._named(track, track.read(max(1, len(heads)))))
                if head.advance():
                    heads.append(head)
                continue
            pieces = [head.take(bound) for head in heads]
            yield from self._merge([piece for piece in pieces if len(piece[0])])
            heads = [head for head in heads if len(head.keys) or head.advance()]

    def _named(self, track: Track, batches: Iterator[PacketBatch]) -> Iterator[PacketBatch]:
        """Yield batches with the channel numbers of the timeline in place of the track's own.

        A channel without a name gets the one that it would be called by if its track were alone.
        """
        for batch in batches:
            own = channels_of(batch)
            number = np.zeros(int(own.max(initial=0)) + 1, np.uint16)
            for place in np.flatnonzero(np.bincount(own)).tolist():
                name = channel_name(track.channels, place)
                if name not in self._numbers and len(self.channels) <= _MAX_CHANNEL:
                    self._numbers[name] = len(self.channels)
                    self.channels.append(name)
                number[place] = self._numbers.get(name, _MAX_CHANNEL)
            if batch.channel is None and not number.any() and not own.any():
                yield batch
            else:
                yield replace(batch, channel=number[own])

    def _merge(self, pieces: list[tuple[PacketBatch, I64]]) -> Iterator[PacketBatch]:
        batches = [batch for batch, _ in pieces]
        if len(batches) == 1:
            yield batches[0]
            return
        order = np.argsort(np.concatenate([keys for _, keys in pieces]), kind="stable")
        origin = np.repeat(np.arange(len(batches)), [len(batch) for batch in batches])[order]
        captured = np.concatenate([batch.captured for batch in batches])[order]
        original = np.concatenate([batch.original for batch in batches])[order]
        ts_ns = np.concatenate([batch.ts_ns for batch in batches])[order]
        links = {batch.single_link for batch in batches}
        only = links.pop() if len(links) == 1 else None
        link = np.concatenate([batch.link for batch in batches])[order] if only is None else None
        channel = None
        if any(batch.channel is not None for batch in batches):
            channel = np.concatenate([batch.channels for batch in batches])[order]
        done = [0] * len(batches)
        for rows in stretches(captured, self._batch_packets, self._batch_bytes):
            counts = np.bincount(origin[rows], minlength=len(batches)).tolist()
            parts = [batch[at : at + count] for batch, at, count in zip(batches, done, counts, strict=True)]
            data, offsets = _gather(parts)
            offset = np.empty(rows.stop - rows.start, np.int64)
            for number, part in enumerate(offsets):
                offset[origin[rows] == number] = part
            column = PacketBatch.link_column(only or 0, len(offset)) if link is None else link[rows]
            own = None if channel is None else channel[rows]
            yield PacketBatch(data, offset, captured[rows], original[rows], ts_ns[rows], column, own)
            done = [at + count for at, count in zip(done, counts, strict=True)]


def _gather(parts: list[PacketBatch]) -> tuple[U8, list[I64]]:
    """Copy the packets of batches over different buffers to one; return it and the offsets of each batch in it."""
    regions: list[U8] = []
    offsets: list[I64] = []
    size = 0
    for part in parts:
        if not len(part):
            offsets.append(part.offset)
            continue
        first = int(part.offset.min())
        region = part.data[first : int((part.offset + part.captured).max())]
        captured = part.captured.astype(np.int64)
        start = part.offset - first
        if len(region) > 2 * int(captured.sum()) + 64 * len(part):
            packed_start = np.cumsum(captured) - captured
            packed = np.empty(int(captured.sum()), np.uint8)
            copy_spans(packed, packed_start, region, start, captured)
            region, start = packed, packed_start
        offsets.append(start + size)
        regions.append(region)
        size += len(region)
    regions.append(np.zeros(PAD_BYTES, np.uint8))
    return np.concatenate(regions), offsets
