"""The shapes that data has between a capture and the tracker: columns over one buffer.

No packet is ever an object: a batch is a set of numpy columns of equal length, and a packet is a row.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

if TYPE_CHECKING:
    import numpy.typing as npt

    from dissectors.datalogger.logged import Logged

    U8 = npt.NDArray[np.uint8]
    U16 = npt.NDArray[np.uint16]
    U32 = npt.NDArray[np.uint32]
    I32 = npt.NDArray[np.int32]
    I64 = npt.NDArray[np.int64]
    U64 = npt.NDArray[np.uint64]
    Bool = npt.NDArray[np.bool_]
    Records = npt.NDArray[np.void]
else:  # importing numpy.typing takes longer than reading a small capture
    U8 = U16 = U32 = I32 = I64 = U64 = Bool = Records = np.ndarray


MARGIN_BYTES = 64
PAD_BYTES = 128


class LinkType(IntEnum):
    """Link types as numbered in capture files (https://www.tcpdump.org/linktypes.html).

    Rows of databases have a number of ours, and are in no capture file.
    """

    NULL = 0
    ETHERNET = 1
    RAW = 101
    LOOP = 108
    LINUX_SLL = 113
    CAN_SOCKETCAN = 227
    IPV4 = 228
    IPV6 = 229
    UPPER_PDU = 252
    LINUX_SLL2 = 276
    DATABASE_ROW = 0xDB00


class Direction(IntEnum):
    """Which way a packet went where it was captured, as ``epb_flags`` of pcapng number it."""

    UNKNOWN = 0
    RX = 1
    TX = 2


DIRECTION_NAMES = ("", "Rx", "Tx")
"""What CAN tools call directions, by number; '' where it is unknown."""


class End(NamedTuple):
    """The end of one of several sources, by its number, at the time of its last packet.

    ``following`` is the source that begins where it ends, if there is one, ``seamless`` whether it surely goes on with
    it; ``last``: no other source is left.
    """

    source: int
    time_ns: int
    following: int | None = None
    last: bool = False
    seamless: bool = False


class PacketBatch(Struct, frozen=True):
    """Some packets of a capture, in the order of the capture.

    ``data`` is a flat uint8 buffer (a mapped file, a receive buffer). Row *i* is the packet whose captured
    bytes are ``data[offset[i] : offset[i] + captured[i]]``; ``original[i]`` is its length on the wire, which
    may be larger (snap length). ``ts_ns`` are int64 nanoseconds since 1970-01-01 UTC, not necessarily rising.
    From every row's offset at least ``PAD_BYTES`` bytes of ``data`` can be read, be they of the packet or not.
    ``link`` holds the link type of each row as uint16, usually one broadcast value. ``channel`` tells as uint16 on
    which of several buses or interfaces a packet was captured; None where all are of number 0.
    ``until_ns``: time has passed up to here, behind the packets, and nothing comes any more from before; an empty batch
    with it says "nothing until then". None where nobody says so; of a slice, unless it is the whole batch.
    ``direction`` (``Direction``, uint8) is None where it is unknown of all.
    ``source`` tells as int32 of which of several sources a packet is, usually one broadcast value; None where there is
    one alone. ``ends`` are the sources that ended in front of the packets; of a slice, where it begins with the first.
    ``logged`` tells of packets that are rows of databases of which tables they are; None where there is none.
    Shapes: all columns (n,); offset int64, captured int32, original int64, ts_ns int64, link uint16.
    """

    data: U8
    offset: I64
    captured: I32
    original: I64
    ts_ns: I64
    link: U16
    channel: U16 | None = None
    until_ns: int | None = None
    direction: U8 | None = None
    source: I32 | None = None
    ends: tuple[End, ...] = ()
    logged: Logged | None = None

    def __len__(self) -> int:
        return len(self.offset)

    def __getitem__(self, rows: slice) -> PacketBatch:
        """Return the packets of a slice, over the same buffer; ``until_ns`` is that of the whole batch alone."""
        channel = None if self.channel is None else self.channel[rows]
        whole = self.until_ns is not None and rows.indices(len(self)) == (0, len(self), 1)
        return PacketBatch(
            self.data, self.offset[rows], self.captured[rows], self.original[rows], self.ts_ns[rows], self.link[rows],
            channel, self.until_ns if whole else None, None if self.direction is None else self.direction[rows],
            None if self.source is None else self.source[rows], () if rows.indices(len(self))[0] else self.ends,
            None if self.logged is None else self.logged.take(rows),
        )  # fmt: skip

    def take(self, rows: I64) -> PacketBatch:
        """Return some packets, over the same buffer; nothing is told of time and of ends."""
        link = self.single_link
        return PacketBatch(
            self.data, self.offset[rows], self.captured[rows], self.original[rows], self.ts_ns[rows],
            self.link[rows] if link is None else PacketBatch.link_column(link, len(rows)),
            None if self.channel is None else self.channel[rows],
            direction=None if self.direction is None else self.direction[rows],
            source=None if self.source is None else self.source[rows],
            logged=None if self.logged is None else self.logged.take(rows),
        )  # fmt: skip

    @staticmethod
    def of(packets: Sequence[bytes], link: int, ts_ns: Sequence[int] | I64 = ()) -> PacketBatch:
        """Return a batch of packets that were captured whole, of one link type; without times, all are at 0."""
        size = np.array([len(packet) for packet in packets], np.int64)
        data = np.frombuffer(b"".join(packets) + bytes(PAD_BYTES), np.uint8)
        times = np.array(ts_ns, np.int64) if len(ts_ns) else np.zeros(len(packets), np.int64)
        return PacketBatch(
            data, np.cumsum(size) - size, size.astype(np.int32), size, times,
            PacketBatch.link_column(link, len(packets)),
        )  # fmt: skip

    @staticmethod
    def nothing(until_ns: int | None = None) -> PacketBatch:
        """Return a batch without packets, which says up to when there are none."""
        none = np.empty(0, np.int64)
        return PacketBatch(
            np.zeros(PAD_BYTES, np.uint8), none, np.empty(0, np.int32), none, none, PacketBatch.link_column(0, 0),
            until_ns=until_ns,
        )  # fmt: skip

    @staticmethod
    def ended(*ends: End) -> PacketBatch:
        """Return a batch without packets, which says that sources have ended."""
        return replace(PacketBatch.nothing(), ends=ends)

    def with_margin(self, lead_bytes: int = 0, rows: I64 | None = None) -> PacketBatch:
        """Return the batch over a buffer with at least ``MARGIN_BYTES`` bytes behind the end of every packet.

        Headers are gathered whole before it is known whether they were captured whole; the margin keeps that inside
        the buffer. In front of every packet there are at least ``lead_bytes``. Only a batch that reaches its buffer's
        ends is copied, or, where only some ``rows`` are to be gathered, one in which these do.
        """
        offset, captured = (self.offset, self.captured) if rows is None else (self.offset[rows], self.captured[rows])
        if not len(offset):
            return self
        start, stop = int(offset.min()), int(offset.max()) + int(captured.max())
        if start >= lead_bytes and stop + MARGIN_BYTES <= len(self.data):
            return self
        start, stop = int(self.offset.min()), int((self.offset + self.captured).max())
        if start >= lead_bytes and stop + MARGIN_BYTES <= len(self.data):
            return self
        data = np.zeros(lead_bytes + stop - start + MARGIN_BYTES, np.uint8)
        data[lead_bytes : lead_bytes + stop - start] = self.data[start:stop]
        return replace(self, data=data, offset=self.offset - start + lead_bytes)

    def packet(self, row: int) -> bytes:
        """Return a copy of the captured bytes of one packet."""
        start = int(self.offset[row])
        return self.data[start : start + int(self.captured[row])].tobytes()

    @staticmethod
    def link_column(link: int, count: int) -> U16:
        """Return one link type as a column of ``count`` rows that takes no memory."""
        value = np.array(link, np.uint16)
        value.flags.writeable = False
        # As broadcast_to does it, which takes many times as long: a reader asks for one a batch.
        return np.ndarray((count,), np.uint16, value, 0, (0,))

    @staticmethod
    def source_column(source: int, count: int) -> I32:
        """Return the number of one source as a column of ``count`` rows that takes no memory."""
        value = np.array(source, np.int32)
        value.flags.writeable = False
        return np.ndarray((count,), np.int32, value, 0, (0,))

    @property
    def channels(self) -> U16:
        """The channel of each row."""
        return PacketBatch.link_column(0, len(self)) if self.channel is None else self.channel

    @property
    def directions(self) -> U8:
        """The direction of each row."""
        return np.zeros(len(self), np.uint8) if self.direction is None else self.direction

    @property
    def single_link(self) -> int | None:
        """The link type that all rows share, or None where the batch is mixed or empty."""
        if not len(self.link):
            return None
        first = int(self.link[0])
        if self.link.strides == (0,) or bool((self.link == first).all()):
            return first
        return None
