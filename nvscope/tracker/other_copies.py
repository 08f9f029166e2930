"""Other copies: bytes that come again, and differ from those that came first.

Who sends a segment again sends the same bytes (RFC 9293, section 3.8.1). Where they differ, the capture shows the first
ones, and the receiver may have taken the others. Only what comes again is compared, with the last ``REACH_BYTES`` of
its stream that came without a hole: however a capture is cut into batches.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dissectors.batch import U8
from nvscope.engine.runs import runs_of
from nvscope.tracker.pieces import Again, Brought, OtherBytes, PieceKind

REACH_BYTES = 1 << 12

_AT_A_TIME = 16
"""So many pieces are as many as mostly reach so far."""

MOST_LAST_BYTES = 1 << 25
"""So much is kept of all streams together. Of more, what comes again to those that are silent for longest is compared
with nothing."""


class OtherCopies:
    """The last bytes of streams, and what differs from them."""

    def __init__(self) -> None:
        # By stream, those of which nothing came for the longest time first.
        self._last: dict[int, bytes] = {}
        self._kept_bytes = 0

    def forget(self) -> None:
        """Forget all bytes."""
        self._last.clear()
        self._kept_bytes = 0

    def keep(self, numbers: Mapping[int, int]) -> None:
        """Forget all connections but some, which are numbered anew."""
        last, self._last = self._last, {}
        for stream, data in last.items():
            if stream >> 1 in numbers:
                self._last[2 * numbers[stream >> 1] + (stream & 1)] = data
        self._kept_bytes = sum(map(len, self._last.values()))

    def observe(self, buffer: U8, brought: Brought) -> list[OtherBytes]:
        """Take what a batch brings; ``buffer`` is that of its packets."""
        pieces = brought.pieces
        start, stop = runs_of(pieces.stream)
        streams = pieces.stream[start]
        found = list(brought.others)
        runs: dict[int, _Run] = {}
        for again in self._not_plainly_same(buffer, brought):
            run = runs.get(again.stream)
            if run is None:
                run = runs[again.stream] = _Run(buffer, brought, again.stream, self._last.get(again.stream, b""))
            first, skipped = run.in_front_of(again)
            copy = _data(buffer, brought, again.payload, again.captured)
            size = differing(first, copy[skipped : again.size])
            if size:
                found.append(OtherBytes(again.stream, again.order, size, copy))
        ended = pieces.kind[stop - 1] == int(PieceKind.END)
        for stream in streams[ended].tolist():
            self._take_out(stream)
        columns = streams[~ended], start[~ended], stop[~ended]
        for stream, begin, end in zip(*(column.tolist() for column in columns), strict=True):
            last = self._up_to(buffer, brought, stream, begin, end)
            self._take_out(stream)
            self._last[stream] = last
            self._kept_bytes += len(last)
        while self._kept_bytes > MOST_LAST_BYTES:
            self._take_out(next(iter(self._last)))
        return found

    def _take_out(self, stream: int) -> None:
        self._kept_bytes -= len(self._last.pop(stream, b""))

    @staticmethod
    def _not_plainly_same(buffer: U8, brought: Brought) -> list[Again]:
        """Return what comes again, but for what is the same as the end of the piece before: that is most of it."""
        if not len(brought.again) or not len(brought.pieces):
            return [Again(*row) for row in brought.again.tolist()]
        pieces = brought.pieces
        stream, order, back, payload, size, _ = brought.again.T
        first = min(int(pieces.order.min()), int(order.min()))
        bits = (max(int(pieces.order.max()), int(order.max())) - first).bit_length()
        place = np.searchsorted(pieces.stream << bits | pieces.order - first, stream << bits | order - first) - 1
        behind = pieces.start[place] + pieces.size[place]
        is_plain = (place >= 0) & (pieces.stream[place] == stream) & (pieces.kind[place] == int(PieceKind.DATA))
        is_plain &= (payload >= 0) & (pieces.start[place] >= 0) & (back <= pieces.size[place]) & (back <= REACH_BYTES)
        data = memoryview(buffer.data)
        columns = is_plain, behind - back, payload, size
        rest = []
        for number, (plain, one, other, count) in enumerate(zip(*(each.tolist() for each in columns), strict=True)):
            if not plain or bytes(data[one : one + count]) != bytes(data[other : other + count]):
                rest.append(Again(*brought.again[number].tolist()))
        return rest

    def _up_to(self, buffer: U8, brought: Brought, stream: int, start: int, stop: int) -> bytes:
        """Return the last bytes of a stream up to a piece, behind the last hole; no more than within reach."""
        parts: list[bytes] = []
        size = 0
        pieces = brought.pieces
        while stop > start and size < REACH_BYTES:
            own = slice(max(stop - _AT_A_TIME, start), stop)
            stop = own.start
            kinds, begins, sizes = (column[own].tolist() for column in (pieces.kind, pieces.start, pieces.size))
            for kind, begin, length in zip(reversed(kinds), reversed(begins), reversed(sizes), strict=True):
                if kind != PieceKind.DATA:
                    return b"".join(reversed(parts))
                parts.append(_data(buffer, brought, begin, length))
                size += length
                if size >= REACH_BYTES:
                    break
        if size < REACH_BYTES:
            parts.append(self._last.get(stream, b""))
        return b"".join(reversed(parts))[-REACH_BYTES:]


class _Run:
    """What a batch brings of a stream, behind the ``last`` bytes of earlier ones: put together once."""

    def __init__(self, buffer: U8, brought: Brought, stream: int, last: bytes) -> None:
        pieces = brought.pieces
        start, stop = np.searchsorted(pieces.stream, (stream, stream + 1)).tolist()
        self._order = pieces.order[start:stop]
        parts, at, known_from = [last], len(last), 0
        # In front of each piece, and behind all: how much there is, and from where on without a hole.
        self._ends, self._known_from = [at], [known_from]
        for place in range(start, stop):
            if pieces.kind[place] == int(PieceKind.DATA):
                parts.append(_data(buffer, brought, int(pieces.start[place]), int(pieces.size[place])))
                at += len(parts[-1])
            else:
                known_from = at
            self._ends.append(at)
            self._known_from.append(known_from)
        self._data = b"".join(parts)

    def in_front_of(self, again: Again) -> tuple[bytes, int]:
        """Return what came first of what comes again, as far as it is known, and how much of its begin is not."""
        place = int(np.searchsorted(self._order, again.order))
        end = self._ends[place]
        known_from = max(self._known_from[place], end - REACH_BYTES)
        begin = end - again.back
        skipped = min(max(known_from - begin, 0), again.size)
        return self._data[begin + skipped : begin + again.size], skipped


def _data(buffer: U8, brought: Brought, begin: int, size: int) -> bytes:
    return brought.kept[~begin][:size] if begin < 0 else buffer[begin : begin + size].tobytes()


def differing(first: bytes, second: bytes) -> int:
    """Return how many bytes differ, of two that are equally long."""
    if first == second:
        return 0
    return int(np.count_nonzero(np.frombuffer(first, np.uint8) != np.frombuffer(second, np.uint8)))
