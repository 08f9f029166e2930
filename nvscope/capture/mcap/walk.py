"""Goes from record to record of an MCAP file, as far as they are whole."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

from dissectors.batch import U8
from nvscope.capture.mcap.records import HEAD_BYTES, MAGIC, Op

_HEAD = struct.Struct("<BQ")
_FOOTER_BYTES = HEAD_BYTES + 20


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


def places(data: U8, at: int, end: int) -> Iterator[Place]:
    """Yield the records that are whole between two places."""
    while (place := place_at(data, at, end)) is not None and place.end <= end:
        yield place
        at = place.end


def summary_of(data: U8, end: int) -> Iterator[Place]:
    """Yield the records of the summary of a file that lies in a buffer as a whole; none where it has no end."""
    footer = place_at(data, end - len(MAGIC) - _FOOTER_BYTES, end) if end >= 2 * len(MAGIC) + _FOOTER_BYTES else None
    if footer is None or footer.kind != Op.FOOTER or data[end - len(MAGIC) : end].tobytes() != MAGIC:
        return
    (begin,) = struct.unpack_from("<Q", data.data, footer.content)
    if len(MAGIC) <= begin <= footer.begin:
        yield from places(data, begin, footer.begin)
