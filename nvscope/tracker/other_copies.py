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
from nvscope.tracker.pieces import ORDER_BITS, Again, Brought, Order, OtherBytes, PieceKind

REACH_BYTES = 1 << 12


class OtherCopies:
    """The last bytes of streams, and what differs from them."""

    def __init__(self) -> None:
        self._last: dict[int, bytes] = {}

    def forget(self) -> None:
        """Forget all bytes."""
        self._last.clear()

    def keep(self, numbers: Mapping[int, int]) -> None:
        """Forget all connections but some, which are numbered anew."""
        last, self._last = self._last, {}
        for stream, data in last.items():
            if stream >> 1 in numbers:
                self._last[2 * numbers[stream >> 1] + (stream & 1)] = data

    def observe(self, buffer: U8, brought: Brought) -> list[OtherBytes]:
        """Take what a batch brings; ``buffer`` is that of its packets."""
        pieces = brought.pieces
        start, stop = runs_of(pieces.stream)
        streams = pieces.stream[start]
        found = list(brought.others)
        for again in self._not_plainly_same(buffer, brought):
            run = slice(*np.searchsorted(pieces.stream, (again.stream, again.stream + 1)).tolist())
            size = self._differing(buffer, brought, again, run)
            if size:
                found.append(OtherBytes(again.stream, again.frame << ORDER_BITS | int(Order.OWN), size))
        ended = pieces.kind[stop - 1] == int(PieceKind.END)
        if self._last:
            known = np.array(list(self._last), np.int64)
            for stream in known[np.isin(known, streams[ended])].tolist():
                del self._last[stream]
        columns = streams[~ended], start[~ended], stop[~ended]
        for stream, begin, end in zip(*(column.tolist() for column in columns), strict=True):
            self._last[stream] = self._up_to(buffer, brought, stream, begin, end)
        return found

    @staticmethod
    def _not_plainly_same(buffer: U8, brought: Brought) -> list[Again]:
        """Return what comes again, but for what is the same as the end of the piece before: that is most of it."""
        if not len(brought.again) or not len(brought.pieces):
            return [Again(*row) for row in brought.again.tolist()]
        pieces = brought.pieces
        stream, frame, back, payload, size = brought.again.T
        first = min(int(pieces.order.min()), int(frame.min()) << ORDER_BITS)
        order = (frame << ORDER_BITS | int(Order.OWN)) - first
        bits = max(int(pieces.order.max()) - first, int(order.max())).bit_length()
        place = np.searchsorted(pieces.stream << bits | pieces.order - first, stream << bits | order) - 1
        behind = pieces.start[place] + pieces.size[place]
        is_plain = (place >= 0) & (pieces.stream[place] == stream) & (pieces.kind[place] == int(PieceKind.DATA))
        is_plain &= (pieces.start[place] >= 0) & (back <= pieces.size[place]) & (back <= REACH_BYTES)
        data = memoryview(buffer.data)
        columns = is_plain, behind - back, payload, size
        rest = []
        for number, (plain, one, other, count) in enumerate(zip(*(each.tolist() for each in columns), strict=True)):
            if not plain or bytes(data[one : one + count]) != bytes(data[other : other + count]):
                rest.append(Again(*brought.again[number].tolist()))
        return rest

    def _differing(self, buffer: U8, brought: Brought, again: Again, run: slice) -> int:
        start, stop = run.start, run.stop
        order = again.frame << ORDER_BITS | int(Order.OWN)
        stop = start + int(np.searchsorted(brought.pieces.order[start:stop], order))
        first = self._up_to(buffer, brought, again.stream, start, stop, again.back)
        skipped = max(again.back - len(first), 0)
        if skipped >= again.size:
            return 0
        begin = len(first) - again.back + skipped
        first = first[begin : begin + again.size - skipped]
        second = buffer[again.payload + skipped : again.payload + again.size].tobytes()
        return differing(first, second)

    def _up_to(
        self, buffer: U8, brought: Brought, stream: int, start: int, stop: int, most: int = REACH_BYTES
    ) -> bytes:  # fmt: skip
        """Return the last bytes of a stream up to a piece, behind the last hole; no more than within reach."""
        most = min(most, REACH_BYTES)
        parts: list[bytes] = []
        size = 0
        place = stop
        pieces = brought.pieces
        while place > start and size < most:
            place -= 1
            if pieces.kind[place] != int(PieceKind.DATA):
                return b"".join(reversed(parts))
            part = _data(buffer, brought, place)
            parts.append(part)
            size += len(part)
        if size < most:
            parts.append(self._last.get(stream, b""))
        return b"".join(reversed(parts))[-most:]


def _data(buffer: U8, brought: Brought, place: int) -> bytes:
    pieces = brought.pieces
    begin, size = int(pieces.start[place]), int(pieces.size[place])
    # Of a long piece, what is within reach is enough.
    skipped = max(size - REACH_BYTES, 0)
    if begin < 0:
        return brought.kept[~begin][skipped:size]
    return buffer[begin + skipped : begin + size].tobytes()


def differing(first: bytes, second: bytes) -> int:
    """Return how many bytes differ, of two that are equally long."""
    if first == second:
        return 0
    return sum(one != other for one, other in zip(first, second, strict=True))
