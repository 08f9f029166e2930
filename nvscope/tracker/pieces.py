"""Pieces: what a batch brings of the streams of TCP connections."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from functools import partial
from typing import NamedTuple

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, U8
from dissectors.columns import Columns
from dissectors.stretches import Uncopied, copy_stretches


class PieceKind(IntEnum):
    """What a piece of a stream is.

    ``BEGIN``: a direction begins; its ``size`` has ``IN_STEP`` where its first bytes are known to be the first ones,
    and ``ANEW`` where the connection begins with it. ``HOLE``: so many bytes are missing. ``END``: nothing follows; its
    ``size`` has ``BROKEN_OFF`` where that was not in order, and then ``BY_CLIENT`` where the client did it, and
    ``REPLACED`` where another connection begins between the same ends: how this one ended was not captured.
    """

    DATA = 0
    HOLE = 1
    BEGIN = 2
    END = 3


IN_STEP, ANEW = 1, 2
BROKEN_OFF, BY_CLIENT, REPLACED = 1, 2, 4


class Order(IntEnum):
    """What comes first of that which happens with one segment.

    ``OLD_END`` is the end of a connection that another one takes the place of, ``PROVEN`` what it shows to be of that,
    which came before.
    """

    ACKNOWLEDGED = 0
    OLD_CLIENT = 1
    OLD_SERVER = 2
    OLD_END = 3
    PROVEN = 4
    OWN = 5
    END_CLIENT = 6
    END_SERVER = 7


MOMENT_BITS = 3
PLACE_BITS = 8
"""A frame may let others be taken that were held back (``nvscope.tracker.held_back``): so many, in their order."""

ORDER_BITS = PLACE_BITS + MOMENT_BITS

NEVER = int(np.iinfo(np.int64).max)
"""The order, or the frame, of what does not happen."""


class Pieces(Columns, Struct, frozen=True):
    """What a batch brings, by stream, and of each in its order; columns of int64, shape (n,).

    ``stream`` is twice the number of the connection, plus 1 for what the server sends. ``kind`` is a ``PieceKind``.
    ``start`` is where the data begins in the batch's buffer, or, below 0, ``~start`` which of the ``kept`` pieces it
    is; ``size`` how many bytes there are. ``order`` is the frame that brought it, shifted left by ``PLACE_BITS``, with
    which of the segments it was that are taken with that frame; this, the place of it, shifted left by ``MOMENT_BITS``,
    with what came first there (``Order``). ``arrival_ns`` is the time of the last frame, as they were captured, that
    brought anything up to there, which may be one long before that. ``behind`` is the sequence number of the byte
    behind it, and ``acknowledged`` what the segment that carried it acknowledged, or -1; of a hole, what that in front
    of it did. Who makes captures up may leave that 0, which says nothing.
    """

    stream: I64
    kind: I64
    start: I64
    size: I64
    order: I64
    arrival_ns: I64
    behind: I64
    acknowledged: I64


class Again(NamedTuple):
    """Bytes that come again: of which stream, with which order, how far behind the place where that was.

    ``payload`` is where they begin in the batch's buffer, or, below 0, ``~payload`` which of the ``kept`` pieces they
    begin; ``captured`` is how much of the whole segment there is. A single
    byte, at the place of the last one that was sent so far, is none: it may be garbage that asks whether the other end
    is still there (RFC 1122, section 4.2.3.6).
    """

    stream: int
    order: int
    back: int
    payload: int
    size: int
    captured: int


class OtherBytes(NamedTuple):
    """So many bytes of a stream came again, with an order, and were others: in a segment with the data ``copy``."""

    stream: int
    order: int
    size: int
    copy: bytes


class Brought(Struct, frozen=True):
    """Pieces, and the bytes of those that were kept from earlier batches.

    ``again`` are bytes that had been passed on before, a row each with the columns of ``Again``, ``others`` those that
    differ from what is kept. ``disordered`` are connections that have shown, each with a frame, that they were captured
    in another order than that of the wire. ``together`` is the data of all pieces, one behind the other, where whoever
    put them in order has put it there; None where it is to be had of the buffer and of ``kept``.
    """

    pieces: Pieces
    kept: Sequence[bytes] = ()
    again: I64 = field(default_factory=lambda: np.empty((0, len(Again._fields)), np.int64))
    others: Sequence[OtherBytes] = ()
    disordered: Sequence[tuple[int, int]] = ()
    together: memoryview | None = None

    def sizes(self) -> I64:
        """Return how many bytes each piece has: those that are no data have none."""
        size: I64 = np.where(self.pieces.kind == int(PieceKind.DATA), self.pieces.size, 0)
        return size

    def joined(self, buffer: U8, rests: Sequence[tuple[int, bytes]]) -> bytes:
        """Return the data of all pieces, with some other data in front of that of a few places (rising)."""
        together = self.together
        if together is None:
            together = self.data(buffer).copied()
        ends, begin = np.cumsum(self.sizes()), 0
        parts: list[bytes | memoryview] = []
        for place, rest in rests:
            end = int(ends[place - 1]) if place else 0
            parts += together[begin:end], rest
            begin = end
        return b"".join([*parts, together[begin:]])

    def data(self, buffer: U8) -> Uncopied:
        """Return the data of all pieces, one behind the other; ``buffer`` is that of the packets."""
        sizes = self.sizes()
        return Uncopied(int(sizes.sum()), partial(self._copy, buffer, sizes))

    def _copy(self, buffer: U8, sizes: I64, place: U8) -> None:
        start, ends = self.pieces.start, sizes.cumsum()
        is_here = (sizes > 0) & (start >= 0)
        copy_stretches(buffer, start[is_here], sizes[is_here], (ends - sizes)[is_here], place)
        for kept in ((sizes > 0) & (start < 0)).nonzero()[0].tolist():
            data = self.kept[~start[kept]]
            place[ends[kept] - len(data) : ends[kept]] = np.frombuffer(data, np.uint8)


def no_pieces() -> Pieces:
    """Return no pieces."""
    return Pieces(*[np.empty(0, np.int64) for _ in Pieces.__match_args__])
