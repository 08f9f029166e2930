"""Goes from record to record of an MCAP file, as far as they are whole."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np

from dissectors.batch import U8
from nvscope.capture.mcap.records import HEAD_BYTES, MAGIC, ChunkHead, Damaged, Op

_HEAD = struct.Struct("<BQ")
_GROUP = struct.Struct("<BQQ")
_FOOTER_BYTES = HEAD_BYTES + 20
_SEARCHED_BYTES = 1 << 20
_HEAD_MOST_BYTES = 100


_KINDS = frozenset(Op) | frozenset(range(0x80, 0x100))
"""Of other records no recording knows; those from 0x80 on are for whoever wants them."""


class Place(NamedTuple):
    """Where a record lies in a buffer, and where its content does."""

    kind: int
    begin: int
    content: int
    end: int


def place_at(data: U8, at: int, end: int) -> Place | None:
    """Return the record that begins at a place; None where its head is not whole in front of the end."""
    if at + HEAD_BYTES > end:
        return None
    kind, length = _HEAD.unpack_from(data.data, at)
    return Place(kind, at, at + HEAD_BYTES, at + HEAD_BYTES + length)


def record_at(data: U8, at: int, end: int) -> Place | None:
    """Return the record that begins at a place and is whole in front of the end; None where none can be there."""
    place = place_at(data, at, end)
    return place if place is not None and place.end <= end and is_record(place) else None


def is_record(place: Place) -> bool:
    """Tell whether it begins as a record does; one of which nothing but the begin is there may be any."""
    return place.kind in _KINDS or place.end == place.begin


def places(data: U8, at: int, end: int) -> Iterator[Place]:
    """Yield the records that are whole between two places."""
    while (place := place_at(data, at, end)) is not None and place.end <= end:
        yield place
        at = place.end


def chunk_behind(data: U8, at: int, end: int) -> int | None:
    """Return where the first chunk begins from a place on that lies in no record; None where there is none.

    What looks like the head of one, and fits into the file, is one.
    """
    while at < end:
        stop = min(at + _SEARCHED_BYTES, end)
        for begin in (np.flatnonzero(data[at:stop] == Op.CHUNK) + at).tolist():
            place = place_at(data, begin, end)
            if place is None or place.end > end:
                continue
            try:
                head = ChunkHead.of(data[place.content : min(place.end, place.content + _HEAD_MOST_BYTES)].tobytes())
            except Damaged:
                continue
            if head.first_ns <= head.last_ns and place.content + head.at + head.packed_bytes == place.end:
                return int(begin)
        at = stop
    return None


def summary_of(data: U8, end: int, kinds: Collection[Op]) -> Iterator[Place]:
    """Yield the records of some kinds in the summary of a file that lies in a buffer as a whole.

    There are none where the file has no end. Where the summary tells where its groups are, others are passed over: the
    indexes of the chunks of weeks take longer to walk than all else.
    """
    footer = place_at(data, end - len(MAGIC) - _FOOTER_BYTES, end) if end >= 2 * len(MAGIC) + _FOOTER_BYTES else None
    if footer is None or footer.kind != Op.FOOTER or data[end - len(MAGIC) : end].tobytes() != MAGIC:
        return
    begin, offsets = struct.unpack_from("<QQ", data.data, footer.content)
    if not len(MAGIC) <= begin <= footer.begin:
        return
    groups = [(begin, footer.begin)]
    if begin <= offsets < footer.begin:
        told = [one for one in places(data, offsets, footer.begin) if one.kind == Op.SUMMARY_OFFSET]
        known = [_GROUP.unpack_from(data.data, one.content) for one in told if one.end - one.content >= _GROUP.size]
        groups = [(at, at + size) for kind, at, size in known if kind in kinds]
    for at, until in groups:
        if begin <= at <= until <= footer.begin:
            yield from (place for place in places(data, at, until) if place.kind in kinds)
