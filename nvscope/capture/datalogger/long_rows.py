"""Records that are longer than a page has room for, put together from the pages in which they go on."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from nvscope.capture.datalogger.damage import Harm
from nvscope.capture.datalogger.leaf_rows import POINTER_BYTES
from nvscope.capture.datalogger.page_file import PageFile

MOST_ROW_BYTES = 1 << 20
"""No row of a DataLogger is longer: 996 texts of 255 bytes take a quarter of it."""


class LongRows(Struct, frozen=True):
    """Records one behind the other in ``data``; those with a ``harm`` are not there, and have no bytes."""

    data: U8
    start: I64
    length: I64
    harm: list[Harm | None]


def put_together(file: PageFile, seen: Bool, first: list[bytes], length: list[int]) -> LongRows:
    """Return records by their first bytes, behind which the next page's number stands, and by their lengths."""
    parts: list[bytes] = []
    harms: list[Harm | None] = []
    for local, size in zip(first, length, strict=True):
        record: bytes | Harm = Harm.TOO_LONG if size > MOST_ROW_BYTES else _record(file, seen, local, size)
        harms.append(record if isinstance(record, Harm) else None)
        parts.append(b"" if isinstance(record, Harm) else record)
    sizes = np.array([len(part) for part in parts], np.int64)
    return LongRows(np.frombuffer(b"".join(parts), np.uint8), np.cumsum(sizes) - sizes, sizes, harms)


def _record(file: PageFile, seen: Bool, local: bytes, size: int) -> bytes | Harm:
    parts, left = [local[:-POINTER_BYTES]], size - (len(local) - POINTER_BYTES)
    number = int.from_bytes(local[-POINTER_BYTES:], "big")
    room = file.header.usable_bytes - POINTER_BYTES
    while left > 0:
        # A page belongs to one row: so the time that all of them take is bounded by the file.
        if not 1 < number <= file.pages or seen[number]:
            return Harm.BAD_OVERFLOW
        seen[number] = True
        page = file.page(number)
        if page is None:
            return Harm.BAD_OVERFLOW
        part = page[POINTER_BYTES : POINTER_BYTES + min(room, left)]
        parts.append(part)
        left -= len(part)
        number = int.from_bytes(page[:POINTER_BYTES], "big")
    return b"".join(parts)
