"""Messages of the Parameter Manager as the document has them, by struct alone."""

from __future__ import annotations

import struct
from typing import NamedTuple

READ, READ_REPLY, WRITE, WRITE_REPLY, ACKNOWLEDGEMENT, BUSY = 1, 2, 3, 4, 5, 100
ITEMS, ACCESS, INDEX, SUBINDEX, LENGTH, STOPPED = 21, 22, 23, 24, 25, 28
_HEADER = struct.Struct("<4sIHHHHHBB")


class Heard(NamedTuple):
    """What stands in a telegram."""

    service: int
    index: int
    subindex: int
    counter: int
    items: int
    data: bytes


def said(
    service: int, index: int = 0x2000, subindex: int = 1, counter: int = 7, items: int = 1, data: bytes = b"",
    *, identity: bytes = b"\0-S3", length: int | None = None,
) -> bytes:  # fmt: skip
    """Return the bytes of a telegram."""
    length = 20 + len(data) if length is None else length
    return _HEADER.pack(identity, service, index, subindex, items, length, counter, 0, 0) + data


def heard(payload: bytes) -> Heard:
    """Return what a telegram says, of which everything else is as the document has it."""
    identity, service, index, subindex, items, length, counter, flags, checksum = _HEADER.unpack_from(payload)
    assert (identity, length, flags, checksum) == (b"\0-S3", len(payload), 0, 0)
    return Heard(service, index, subindex, counter, items, payload[20:])
