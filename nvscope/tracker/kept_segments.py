"""Kept segments: what waits behind a hole of a stream, and what of a segment is kept of it already."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from operator import attrgetter

from msgspec import Struct

from dissectors.batch import U8
from nvscope.tracker.other_copies import differing
from nvscope.tracker.pieces import PieceKind


class Kept(Struct):
    """Something that waits behind a hole, or is about to be passed on, at ``begin`` along the stream.

    ``source`` is where its data is in the batch's buffer, the data itself, or None where it was not captured; of SYN
    and FIN (``kind`` ``BEGIN`` and ``END``), which take one place, it says nothing. ``acknowledged`` is as in
    ``Pieces``.
    """

    begin: int
    size: int
    kind: PieceKind
    source: int | bytes | None
    place: int
    time_ns: int
    acknowledged: int = -1
    is_passed: bool = False

    @property
    def end(self) -> int:
        """Where it ends along the stream."""
        return self.begin + self.size

    def part(self, begin: int, end: int) -> Kept:
        """Return what lies from ``begin`` to ``end``."""
        skipped = begin - self.begin
        source = self.source
        if isinstance(source, int):
            source += skipped
        elif isinstance(source, bytes):
            source = source[skipped : skipped + end - begin]
        return Kept(begin, end - begin, self.kind, source, self.place, self.time_ns, self.acknowledged)


BEGIN = attrgetter("begin")


def missing_of(kept: Sequence[Kept], part: Kept) -> Iterator[Kept]:
    """Yield what is not kept of a part."""
    begin = part.begin
    for one in kept[max(bisect_right(kept, begin, key=BEGIN) - 1, 0) :]:
        if one.begin >= part.end:
            break
        if one.begin > begin:
            yield part.part(begin, one.begin)
        begin = max(begin, one.end)
    if begin < part.end:
        yield part.part(begin, part.end)


def others_of(kept: Sequence[Kept], part: Kept, data: U8) -> int:
    """Return how many bytes of a part differ from what is kept; ``data`` is the batch's buffer."""
    found = 0
    if part.kind is not PieceKind.DATA or not kept:
        return found
    place = max(bisect_right(kept, part.begin, key=BEGIN) - 1, 0)
    while place < len(kept) and kept[place].begin < part.end:
        one = kept[place]
        begin, end = max(one.begin, part.begin), min(one.end, part.end)
        if begin < end and one.kind is PieceKind.DATA:
            found += differing(_bytes(one.part(begin, end), data), _bytes(part.part(begin, end), data))
        place += 1
    return found


def _bytes(part: Kept, data: U8) -> bytes:
    source = part.source
    return data[source : source + part.size].tobytes() if isinstance(source, int) else source or b""
