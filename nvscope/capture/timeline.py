"""Several captures as one timeline: always the packet next whose capture has the earliest one to offer.

Every capture keeps its own order, also where its clock steps back. That is the order of the packets sorted by the
latest time of their capture so far, then by capture, then by place in it; so it is computed, a stretch at a time.
Captures are ordered by their first time, then by path, so that the order in which they are given does not matter.

Packets tell of which capture they are; where one ends while others go on or follow, the next batch says so, and which
one begins there (``nvscope.capture.recordings``).

A capture that is silent says so by ``until_ns``: no packet up to there will come of it. It counts like the time of a
packet, so that the others need not wait for one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from heapq import heapify, heapreplace
from itertools import chain
from types import MappingProxyType
from typing import Literal, Protocol
from weakref import ReferenceType, ref

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, End, PacketBatch
from dissectors.can.frame import channels_of
from dissectors.can.pdo import channel_name
from nvscope.capture.between import Between
from nvscope.capture.packed import gathered, logged_of
from nvscope.capture.recordings import is_apart, is_seamless
from nvscope.capture.source import Attachment, FileSource, Source, SourceInfo
from nvscope.capture.spans import BATCH_BYTES, stretches
from nvscope.capture.stoppable import StoppableBatches
from nvscope.capture.time_span import TimeSpan

_MAX_CHANNEL = 0xFFFF


class Track(Source, Protocol):
    """A source that can be merged with others; files are read when their time comes, all others from the beginning."""

    path: str

    def read(self, share: int, span: TimeSpan) -> Iterator[PacketBatch]:
        """Yield the packets as ``nvscope.capture.between.Spanned.read`` says."""
        ...


_Rank = tuple[int, str, int]
"""Which track's packet goes first at equal times: first time of the track, path, number among the tracks."""

_NEVER_NS = int(np.iinfo(np.int64).min)
_MANY_HEADS = 32
_DISORDER_NS = 1_000_000
"""Where a capture is rotated, frames of several interfaces may be so far out of order."""

_ENDED_NS = int(np.iinfo(np.int64).max)
_Piece = tuple[PacketBatch, I64]
"""Packets, and the keys that sort them."""

_NOBODY: _Rank = (1 << 63, "", 0)
"""A rank behind all others."""


class _Head:
    """A track that is being read: those of its packets in memory that are not yet passed on, and what sorts them.

    ``eager`` are tracks that never wait: more of them can be read than is due.
    """

    def __init__(self, rank: _Rank, batches: Iterator[PacketBatch], *, eager: bool) -> None:
        self.rank = rank
        self.eager = eager
        self._batches = batches
        self.latest_ns = self._until_ns = _NEVER_NS
        self.ended = False
        self._pieces: deque[_Piece] = deque()

    @property
    def packets(self) -> int:
        """How many packets are in memory."""
        return sum(len(keys) for _, keys in self._pieces)

    @property
    def bytes(self) -> int:
        """How many bytes they keep in memory, what lies between them in their files included."""
        return sum(batch.data.nbytes for batch, _ in self._pieces)

    @property
    def bound(self) -> tuple[int, _Rank]:
        """The key and the rank up to which nothing can come of the track that is not in memory."""
        if self.ended:
            return _ENDED_NS, _NOBODY
        if self._until_ns >= self.latest_ns:
            return self._until_ns, _NOBODY
        return self.latest_ns, self.rank

    def advance(self) -> bool:
        """Take the next batch, or learn that time has passed without one; False at the end of the track."""
        for batch in self._batches:
            if batch.until_ns is None and not len(batch):
                continue
            if len(batch):
                keys = np.maximum.accumulate(batch.ts_ns)
                np.maximum(keys, max(self.latest_ns, self._until_ns), out=keys)
                self._pieces.append((batch, keys))
                if self.rank[0] == _NEVER_NS:
                    # The rank is known with the first packet; before, there is nothing to be compared with others.
                    self.rank = int(keys[0]), *self.rank[1:]
                self.latest_ns = int(keys[-1])
            if batch.until_ns is not None:
                self._until_ns = max(self._until_ns, batch.until_ns)
            return True
        self.ended = True
        return False

    def take(self, bound: tuple[int, _Rank]) -> list[_Piece]:
        """Take away the packets, and their keys, that are not behind a key of a rank."""
        side: Literal["left", "right"] = "right" if self.rank <= bound[1] else "left"
        taken: list[_Piece] = []
        while self._pieces:
            batch, keys = self._pieces.popleft()
            count = int(np.searchsorted(keys, bound[0], side))
            if count:
                taken.append((batch[:count], keys[:count]))
            if count < len(keys):
                self._pieces.appendleft((batch[count:], keys[count:]))
                break
        return taken


class Timeline:
    """The packets of several tracks by time, and what is known of the tracks in the order they were given.

    Channels of one name are one channel, whichever track they are of; those beyond 65 536 names are the last one.
    ``renamed`` are the names that channels are given in place of those that their tracks tell.
    A track that says ``until_ns`` does not hold back the others; where all do, and none has packets, so does the
    timeline.
    """

    def __init__(
        self,
        tracks: Sequence[Track],
        *,
        batch_packets: int = 32_768,
        batch_bytes: int = BATCH_BYTES,
        renamed: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._tracks = tracks
        self._renamed = renamed
        self._files = [track if isinstance(track, FileSource) else None for track in tracks]
        self.channels: list[str] = []
        self._numbers: dict[str, int] = {}
        self._batch_packets = batch_packets
        self._batch_bytes = batch_bytes
        self._stopped = False
        self._running: ReferenceType[StoppableBatches] | None = None

    @property
    def infos(self) -> Sequence[SourceInfo]:
        return [info for track in self._tracks for info in track.infos]

    @property
    def attachments(self) -> Sequence[Attachment]:
        return [attachment for track in self._tracks for attachment in track.attachments]

    @property
    def size_bytes(self) -> int | None:
        """The bytes of all tracks, or None where one does not know how many it has."""
        sizes = [None if file is None else file.size_bytes for file in self._files]
        return None if None in sizes else sum(size for size in sizes if size is not None)

    @property
    def position_bytes(self) -> int:
        return sum(file.position_bytes for file in self._files if file is not None)

    def first_ts_ns(self) -> int | None:
        """Return the time of the first packet of all, or None where there is none."""
        firsts = (file.first_ts_ns() for file in self._files if file is not None)
        return min((first_ns for first_ns in firsts if first_ns is not None), default=None)

    def first_batches(self) -> Iterator[PacketBatch]:
        """Yield what each file begins with, if anything; it is read again later."""
        for file in self._files:
            if file is not None:
                yield from file.first_batches()

    def between(self, start_ns: int | None, end_ns: int | None) -> Between:
        """Return the packets whose time lies between two, both included, None for no bound."""
        return Between(self, TimeSpan.of(start_ns, end_ns))

    def stop(self) -> None:
        """End after the batch in hand, and close all tracks; what live ones have taken still comes."""
        for track in self._tracks:
            track.stop()
        if None in self._files:
            return
        self._stopped = True
        running = None if self._running is None else self._running()
        if running is not None:
            running.stop()

    def __iter__(self) -> Iterator[PacketBatch]:
        return self.read(1, TimeSpan())

    def read(self, share: int, span: TimeSpan) -> Iterator[PacketBatch]:
        """Return the packets as ``nvscope.capture.between.Spanned.read`` says."""
        batches = StoppableBatches(self._read(share, span))
        self._running = ref(batches)
        if self._stopped:
            batches.stop()
        return batches

    def _read(self, share: int, span: TimeSpan) -> Generator[PacketBatch, None, None]:
        waiting: list[_Rank] = []
        for number, (track, file) in enumerate(zip(self._tracks, self._files, strict=True)):
            first_ns = _NEVER_NS if file is None else file.first_ts_ns()
            if first_ns is not None:
                waiting.append((first_ns, track.path, number))
            else:
                # Nothing comes of it, but what is wrong with it is found out by reading it.
                for _ in track.read(share, span):
                    pass
        waiting.sort(reverse=True)
        heads: list[_Head] = []
        followers: set[int] = set()
        ends: list[End] = []
        passed_ns = _NEVER_NS
        while heads or waiting:
            # Up to here no packet can still come that would have to be before.
            bound = min((head.bound for head in heads), default=None)
            if bound is None or (waiting and (waiting[-1][0], waiting[-1]) < bound):
                rank = waiting.pop()
                track = self._tracks[rank[2]]
                batches = track.read(share * max(1, len(heads)), span)
                head = _Head(rank, self._named(rank[2], batches), eager=self._files[rank[2]] is not None)
                if head.advance():
                    heads.append(head)
                continue
            if self._read_ahead(heads, waiting[-1] if waiting else None):
                continue
            heads.sort(key=lambda head: head.rank)
            pieces = [piece for head in heads for piece in head.take(bound)]
            for batch in self._merge(pieces):
                yield replace(batch, ends=tuple(ends)) if ends else batch
                ends = []
            if pieces:
                passed_ns = max(int(keys[-1]) for _, keys in pieces)
            if bound[1] is _NOBODY and passed_ns < bound[0] < _ENDED_NS:
                passed_ns = bound[0]
                yield replace(PacketBatch.nothing(passed_ns), ends=tuple(ends))
                ends = []
            left = [
                head
                for head in heads
                if head.packets or (head.bound[0] < _ENDED_NS and (head.bound > bound or head.advance()))
            ]
            if len(left) < len(heads):
                going = {head.rank[2] for head in left}
                gone = [head for head in heads if head.rank[2] not in going]
                ends += self._ends(gone, left, waiting, followers)
            heads = left
        if ends:
            yield PacketBatch.ended(*ends)

    def _ends(self, gone: list[_Head], left: list[_Head], waiting: list[_Rank], followers: set[int]) -> list[End]:
        """Return the ends of files; ``followers`` are those that go on with others, and these are added to them.

        The last end of all is of interest only where that file goes on with another one. Of many files that are read
        ahead, the ends come behind some packets that are later.
        """
        ends = []
        gone = [head for head in gone if head.eager and head.latest_ns > _NEVER_NS]
        for place, head in enumerate(gone):
            number, is_last = head.rank[2], not (left or waiting or gone[place + 1 :])
            begun = (one.rank for one in left if one.rank[0] >= head.latest_ns - _DISORDER_NS)
            coming = (rank for rank in reversed(waiting) if not is_apart(head.latest_ns, rank[0]))
            following = next((rank for rank in chain(begun, coming) if rank[2] not in followers), None)
            end = End(number, head.latest_ns, last=is_last)
            if following is not None:
                followers.add(following[2])
                seamless = is_seamless(head.latest_ns, head.rank[1], *following[:2])
                end = end._replace(following=following[2], seamless=seamless)
            if not is_last or number in followers:
                ends.append(end)
        return ends

    def _read_ahead(self, heads: list[_Head], following: _Rank | None) -> bool:
        """Read more of the files that hold back the others, as long as little is in memory; tell whether any was read.

        Of thousands of captures that overlap, a few packets of each would be merged at a time otherwise. What comes of
        the track that is ``following`` has to be there before more is read.
        """
        if len(heads) < _MANY_HEADS:
            return False
        packets, size, read = sum(head.packets for head in heads), sum(head.bytes for head in heads), False
        queue = [(head.bound, number) for number, head in enumerate(heads)]
        heapify(queue)
        while packets < self._batch_packets and size < self._batch_bytes:
            bound, number = queue[0]
            head = heads[number]
            if not head.eager or head.ended or (following and (following[0], following) < bound):
                break
            packets, size = packets - head.packets, size - head.bytes
            head.advance()
            packets, size = packets + head.packets, size + head.bytes
            heapreplace(queue, (head.bound, number))
            read = True
        return read

    def _named(self, place: int, batches: Iterator[PacketBatch]) -> Iterator[PacketBatch]:
        """Yield batches of a track with the channel numbers of the timeline in place of its own.

        Those of files tell which track they are of. A channel without a name gets the one that it would be called by if
        its track were alone.
        """
        track, is_file = self._tracks[place], self._files[place] is not None
        for batch in batches:
            if not len(batch):
                yield batch
                continue
            source = PacketBatch.source_column(place, len(batch)) if is_file else None
            own = channels_of(batch)
            number = np.zeros(int(own.max(initial=0)) + 1, np.uint16)
            for channel in np.flatnonzero(np.bincount(own)).tolist():
                told = channel_name(track.channels, channel)
                name = self._renamed.get(told, told)
                if name not in self._numbers and len(self.channels) <= _MAX_CHANNEL:
                    self._numbers[name] = len(self.channels)
                    self.channels.append(name)
                number[channel] = self._numbers.get(name, _MAX_CHANNEL)
            if batch.channel is None and not number.any() and not own.any():
                yield replace(batch, source=source)
            else:
                yield replace(batch, channel=number[own], source=source)

    def _merge(self, pieces: list[tuple[PacketBatch, I64]]) -> Iterator[PacketBatch]:
        batches = [batch for batch, _ in pieces]
        if len(batches) < 2:
            yield from batches
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
        direction = None
        if any(batch.direction is not None for batch in batches):
            direction = np.concatenate([batch.directions for batch in batches])[order]
        source = None
        if all(batch.source is not None for batch in batches):
            source = np.concatenate([batch.source for batch in batches if batch.source is not None])[order]
        logged = logged_of(batches)
        logged = None if logged is None else logged.take(order)
        done = [0] * len(batches)
        for rows in stretches(captured, self._batch_packets, self._batch_bytes):
            counts = np.bincount(origin[rows], minlength=len(batches)).tolist()
            parts = [batch[at : at + count] for batch, at, count in zip(batches, done, counts, strict=True)]
            data, offsets = gathered(parts)
            offset = np.empty(rows.stop - rows.start, np.int64)
            for number, part in enumerate(offsets):
                offset[origin[rows] == number] = part
            column = PacketBatch.link_column(only or 0, len(offset)) if link is None else link[rows]
            own = None if channel is None else channel[rows]
            way = None if direction is None else direction[rows]
            of = None if source is None else source[rows]
            yield PacketBatch(
                data, offset, captured[rows], original[rows], ts_ns[rows], column, own, direction=way, source=of,
                logged=None if logged is None else logged.take(rows),
            )  # fmt: skip
            done = [at + count for at, count in zip(done, counts, strict=True)]
