"""Packets as MCAP messages: many to a message, column by column, and then their bytes.

Numbers are little-endian. A message begins with the number of packets (uint32) and with the sum of the flags of its
columns (uint32); then the columns of ``COLUMNS`` that are there, each with an entry a packet or one for all; then what
was captured, one packet behind the other.

The packets of a message come within a second, and none is later than the last one, whose time is that of the message.
Its sequence is how many packets were recorded before it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, PacketBatch
from nvscope.capture.mcap.records import Damaged
from nvscope.capture.spans import copy_spans, stretches
from nvscope.capture.time_span import TIME_LIMIT_NS

TOPIC = "/nvscope/packets"
ENCODING = "nvscope.packets"
SCHEMA_NAME = "nvscope.packets/1"

LONGEST_NS = 1_000_000_000
"""Packets of a message lie within so long before its own time: where packets of a time are is known without them."""

MOST_ROWS, MOST_BYTES = 32_768, 4 << 20
_HEAD = np.dtype([("count", "<u4"), ("flags", "<u4")])


class Column(Struct, frozen=True):
    """A column of a message: its name, its numpy type, which flag says that it is there, and what it tells.

    Without a flag it always is. With ``flag_is_single``, it always is, and the flag says that one entry is that of all
    packets.
    """

    name: str
    kind: str
    meaning: str
    flag: int = 0
    flag_is_single: bool = False

    def entries(self, flags: int, count: int) -> int:
        """Return how many entries there are, in a message of so many packets."""
        if self.flag_is_single:
            return 1 if flags & self.flag else count
        return count if not self.flag or flags & self.flag else 0

    @property
    def entry_bytes(self) -> int:
        return int(self.kind[-1])


COLUMNS = (
    Column("time_ns", "<i8", "when it was captured, since 1970-01-01 UTC: of the first packet; of each other one, how "
           "much later it is than the one before"),
    Column("captured", "<u4", "how many bytes of it are here"),
    Column("original", "<u4", "how many bytes it had on the wire; without the column, as many as are here", 1),
    Column("link", "<u2", "link type, numbered as in https://www.tcpdump.org/linktypes.html", 2, flag_is_single=True),
    Column("interface", "<u2", "on which interface it was captured: the number of its name in the metadata "
           "nvscope.interfaces; without the column, 0", 4),
    Column("direction", "<u1", "0: unknown, 1: received, 2: sent; without the column, unknown", 8),
)  # fmt: skip

_FLAG = {column.name: column.flag for column in COLUMNS}
_KNOWN_FLAGS = sum(_FLAG.values())


def cut(batch: PacketBatch) -> Iterator[PacketBatch]:
    """Yield the packets of a batch in parts, each of which is a message: few enough, and close enough in time."""
    for rows in stretches(batch.captured, MOST_ROWS, MOST_BYTES):
        part = batch[rows]
        steps_back = np.flatnonzero(np.diff(part.ts_ns) < 0) + 1
        edges = [0, *steps_back.tolist(), len(part)]
        for begin, end in pairwise(edges):
            place = begin
            while place < end:
                # Between two edges, times rise.
                behind = int(np.searchsorted(part.ts_ns[place:end], int(part.ts_ns[place]) + LONGEST_NS))
                yield part[place : place + behind]
                place += behind


def message(batch: PacketBatch) -> bytes:
    """Return packets, at least one, as the data of a message."""
    captured = batch.captured.astype(np.int64)
    original = np.clip(batch.original, 0, 0xFFFFFFFF)
    link = batch.single_link
    columns: dict[str, Any] = {
        "time_ns": np.diff(batch.ts_ns, prepend=np.int64(0)),
        "captured": captured,
        "original": None if np.array_equal(original, captured) else original,
        "link": batch.link if link is None else np.array([link]),
        "interface": batch.channel if batch.channel is not None and batch.channel.any() else None,
        "direction": batch.direction if batch.direction is not None and batch.direction.any() else None,
    }
    flags = sum(
        column.flag for column in COLUMNS
        if (link is not None if column.flag_is_single else columns[column.name] is not None)
    )  # fmt: skip
    parts = [np.array([(len(batch), flags)], _HEAD).tobytes()]
    parts += [columns[one.name].astype(one.kind).tobytes() for one in COLUMNS if columns[one.name] is not None]
    return b"".join([*parts, _behind_one_another(batch, captured)])


def _behind_one_another(batch: PacketBatch, captured: I64) -> bytes:
    ends = np.cumsum(captured)
    packed = np.empty(int(ends[-1]), np.uint8)
    copy_spans(packed, ends - captured, batch.data, batch.offset, captured)
    return packed.tobytes()


def packets_in(data: U8, begin: int, end: int) -> PacketBatch:
    """Return the packets of the message that lies between two places of a buffer, over that buffer.

    Raises Damaged where none lies there.
    """
    if end - begin < _HEAD.itemsize:
        raise Damaged("a message of packets without its begin")
    count, flags = np.frombuffer(data.data, _HEAD, 1, begin)[0].tolist()
    if flags & ~_KNOWN_FLAGS:
        raise Damaged(f"packets with the flags {flags:#x}, as a later version may write them")
    entries = {column.name: column.entries(flags, count) for column in COLUMNS}
    at = begin + _HEAD.itemsize
    bytes_at = at + sum(entries[column.name] * column.entry_bytes for column in COLUMNS)
    if bytes_at > end:
        raise Damaged(f"{count} packets in a message of {end - begin} bytes")
    found: dict[str, Any] = {}
    for column in COLUMNS:
        found[column.name] = np.frombuffer(data.data, column.kind, entries[column.name], at)
        at += entries[column.name] * column.entry_bytes
    captured = found["captured"].astype(np.int64)
    ends = np.cumsum(captured)
    size = int(ends[-1]) if count else 0
    if size != end - bytes_at:
        raise Damaged(f"packets of {size} bytes, of which {end - bytes_at} are there")
    link = found["link"]
    return PacketBatch(
        data, bytes_at + ends - captured, captured.astype(np.int32),
        found["original"].astype(np.int64) if entries["original"] else captured,
        np.clip(np.cumsum(found["time_ns"], dtype=np.int64), -TIME_LIMIT_NS, TIME_LIMIT_NS),
        PacketBatch.link_column(int(link[0]), count) if flags & _FLAG["link"] else link.astype(np.uint16),
        found["interface"].astype(np.uint16) if entries["interface"] else None,
        direction=found["direction"].astype(np.uint8) if entries["direction"] else None,
    )  # fmt: skip
