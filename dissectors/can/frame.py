"""CAN frames as SocketCAN has them: the frame's table, and columns of a whole batch.

Sources: https://www.tcpdump.org/linktypes/LINKTYPE_CAN_SOCKETCAN.html and ``linux/can.h``.

::

     0             4        5          6          7           8
    +-------------+--------+----------+----------+-----------+------------------------
    | Identifier  | Length | FD flags | Reserved | len8_dlc  | Data, up to 8, FD to 64
    +-------------+--------+----------+----------+-----------+------------------------

Link type 227 has the identifier in network byte order. In a cooked frame (SLL, SLL2) libpcap leaves it in the byte
order of the capturing host (libpcap issue 1247 shows ``2301 0000 0800 0000`` for 0x123), so there it is read as
little-endian, as Wireshark does with a capture of a little-endian host.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, U16, U32, Bool, Direction, LinkType, PacketBatch, Records
from dissectors.headers import (
    PACKET_OUTGOING,
    PDU_TAG_DISSECTOR,
    PDU_TAG_END,
    SLL,
    SLL2,
    SLL2_INTERFACE,
    TYPE_CAN,
    TYPE_CAN_FD,
    TYPE_CAN_XL,
    UPPER_PDU_TAG,
)
from dissectors.layout import Bit, Field, Layout

EXTENDED = Bit(31, "extended", "extended frame: an identifier of 29 bits")
REMOTE = Bit(30, "remote", "remote frame: asks for data and holds none")
ERROR = Bit(29, "error", "error frame: made by the controller's driver, never on the bus")
BIT_RATE_SWITCH = Bit(0, "brs", "bit rate switch: the data phase has its own bit rate")
ERROR_STATE = Bit(1, "esi", "error state indicator: the sender is error passive")
FD_FRAME = Bit(2, "fd", "CAN FD frame")

FRAME = Layout(
    "can",
    (
        Field(
            "identifier", ">u4", "Identifier", "CAN identifier, or the classes of an error frame",
            bits=(EXTENDED, REMOTE, ERROR), base="hex",
        ),
        Field("length", "u1", "Length", "bytes of data; of a remote frame the DLC"),
        Field("fd_flags", "u1", "FD flags", "of CAN FD", bits=(BIT_RATE_SWITCH, ERROR_STATE, FD_FRAME), base="hex"),
        Field("reserved", "u1", "Reserved", "zero", base="hex"),
        Field("len8_dlc", "u1", "DLC of 8 bytes", "the DLC of a frame of 8 bytes where it is 9 to 15, else 0"),
    ),
)  # fmt: skip

STANDARD_MASK, EXTENDED_MASK = 0x7FF, 0x1FFF_FFFF
MAX_DATA_BYTES, MAX_FD_DATA_BYTES = 8, 64
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Bytes of data that a DLC of 0 to 15 means in CAN FD (ISO 11898-1)."""

DLC_OF_LENGTH: U8 = np.searchsorted(FD_LENGTHS, np.arange(MAX_FD_DATA_BYTES + 1)).astype(np.uint8)
"""The smallest DLC of CAN FD that holds so many bytes of data, shape (65,)."""

# Frames in the byte order of the host, as Wireshark exports them, are those of cooked captures.
_PDU_DISSECTORS = {b"can-hostendian": TYPE_CAN, b"canfd": TYPE_CAN_FD, b"can-bigendian": 0}
_MAX_PDU_TAGS = 32
_NAME_BYTES = 16
_XL = 0x80  # CANXL_XLF: where classic and FD frames have their length, CAN XL has flags, this one always set
_COOKED = {LinkType.LINUX_SLL: SLL, LinkType.LINUX_SLL2: SLL2}
_KNOWN_FD_FLAGS = sum(bit.mask for bit in FRAME["fd_flags"].bits)


class Fault(IntEnum):
    """What is wrong with a CAN frame; the first that applies, in this order."""

    NONE = 0
    SHORT = 1  # fewer than 8 bytes captured: nothing is known of it
    XL = 2  # a frame of CAN XL, which nothing here reads
    TOO_LONG = 3  # length above 64
    CLASSIC_TOO_LONG = 4  # length above 8 in a frame that is not CAN FD
    TRUNCATED = 5  # less data captured than the length says
    IDENTIFIER = 6  # a standard frame whose identifier has bits above the lower 11: these are ignored


class CanBatch(Struct, frozen=True):
    """The CAN frames of a packet batch, in its order, with bad ones as rows that have a fault.

    ``data`` is the buffer that ``at`` points into: ``captured`` bytes of a frame's data lie from ``at``, none of a
    remote frame. ``row`` is the row of the packet, ``channel`` the bus (for SLL2 in a batch without channels: the index
    of the interface). ``direction`` is a ``Direction``, from the capture or a cooked header. ``identifier`` has no flag
    bits; of an error frame it holds the classes
    (``dissectors.can.error``). An error frame is neither extended nor remote, and no FD frame is remote or error.
    ``length`` is what the frame tells, be it possible or not; ``dlc`` is the data length code on the wire: up to 8, for
    CAN FD up to 15, and of a classic frame of 8 bytes 9 to 15 where the frame tells it (``len8_dlc``). Where ``fault``
    is SHORT, all that is told is 0.
    All columns have shape (n,); row, ts_ns and at int64, channel uint16, identifier uint32, direction, length, dlc,
    captured and fault (``Fault``) uint8, the rest bool.
    """

    data: U8
    row: I64
    ts_ns: I64
    channel: U16
    direction: U8
    identifier: U32
    extended: Bool
    remote: Bool
    error: Bool
    fd: Bool
    brs: Bool
    esi: Bool
    length: U8
    dlc: U8
    at: I64
    captured: U8
    fault: U8

    def __len__(self) -> int:
        return len(self.row)

    def take(self, rows: I64 | Bool | slice) -> CanBatch:
        """Return the frames at the given positions, of a slice, or where the mask is set."""
        columns = (name for name in self.__struct_fields__ if name != "data")
        return CanBatch(self.data, *(getattr(self, name)[rows] for name in columns))

    def payload(self, position: int) -> bytes:
        """Return a copy of the captured data of one frame."""
        start = int(self.at[position])
        return self.data[start : start + int(self.captured[position])].tobytes()


def dissect_can(packets: PacketBatch, rows: I64 | None = None) -> CanBatch:
    """Find and read every CAN frame of a packet batch: of link type 227, inside of SLL and SLL2, in exported PDUs.

    Where ``rows`` (rising) are given, only these packets are looked at. Total: wrong bytes are frames with a fault, or
    no frames; nothing raises.
    """
    packets = packets.with_margin()
    spans = _spans(packets, rows)
    head = FRAME.gather(packets.data, spans.at)
    room = spans.end - spans.at - FRAME.size_bytes
    short = room < 0
    any_short = bool(short.any())
    if any_short:
        head[short] = np.zeros((), FRAME.dtype)
    word = head["identifier"].astype(np.uint32)
    if spans.cooked:
        word = np.where(spans.protocol != 0, word.byteswap(), word)
    length = np.ascontiguousarray(head["length"])
    flags = (word >> np.uint32(29)).astype(np.uint8)
    fd = _is_fd(head, spans)
    if any_short:
        fd &= ~short
    error = _bit(flags, 0)
    error &= ~fd
    plain = ~(error | fd)
    remote = _bit(flags, 1)
    remote &= plain
    extended = _bit(flags, 2)
    extended &= ~error
    identifier = word & np.where(extended | error, np.uint32(EXTENDED_MASK), np.uint32(STANDARD_MASK))
    captured = np.minimum(room, length)
    np.maximum(captured, 0, out=captured)
    captured[remote] = 0

    fault = np.zeros(len(head), np.uint8)
    bad = short | (length > np.where(fd, np.uint8(MAX_FD_DATA_BYTES), np.uint8(MAX_DATA_BYTES)))
    bad |= (captured < length) & ~remote
    bad |= identifier != (word & np.uint32(EXTENDED_MASK))
    if spans.cooked:
        bad |= spans.protocol == TYPE_CAN_XL
    wrong = np.flatnonzero(bad)
    if len(wrong):
        told = length[wrong]
        fault[wrong] = np.select(
            [
                short[wrong],
                (told >= _XL) | (spans.protocol[wrong] == TYPE_CAN_XL),
                told > MAX_FD_DATA_BYTES,
                (told > MAX_DATA_BYTES) & ~fd[wrong],
                (captured[wrong] < told) & ~remote[wrong],
            ],
            [Fault.SHORT, Fault.XL, Fault.TOO_LONG, Fault.CLASSIC_TOO_LONG, Fault.TRUNCATED],
            Fault.IDENTIFIER,
        )
    at = spans.at + FRAME.size_bytes
    if any_short:
        np.minimum(at, spans.end, out=at)
    brs = esi = fd
    if fd.any():
        fd_flags = head["fd_flags"]
        brs, esi = fd & _bit(fd_flags, BIT_RATE_SWITCH.position), fd & _bit(fd_flags, ERROR_STATE.position)
    whole = len(spans.row) == len(packets)
    ts_ns = packets.ts_ns if whole else packets.ts_ns[spans.row]
    return CanBatch(
        packets.data, spans.row, ts_ns, _channels(packets, spans), _directions(packets, spans), identifier, extended,
        remote, error, fd, brs, esi, length, _dlc(head, length, fd, error), at, captured.astype(np.uint8), fault,
    )  # fmt: skip


def _dlc(head: Records, length: U8, fd: Bool, error: Bool) -> U8:
    """Return the data length codes of frames."""
    dlc = np.minimum(length, np.uint8(MAX_DATA_BYTES))
    fast = np.flatnonzero(fd) if fd.any() else ()
    if len(fast):
        dlc[fast] = DLC_OF_LENGTH[np.minimum(length[fast], MAX_FD_DATA_BYTES)]
    told = np.flatnonzero(head["len8_dlc"] > MAX_DATA_BYTES)
    if len(told):
        # Old captures have noise in the bytes between length and data.
        part = head[told]
        sound = (part["fd_flags"] == 0) & (part["reserved"] == 0) & (part["len8_dlc"] <= 15)
        told = told[sound & (length[told] == MAX_DATA_BYTES) & ~(fd[told] | error[told])]
        dlc[told] = head["len8_dlc"][told]
    return dlc


class _Spans(Struct, frozen=True):
    """Where the SocketCAN frames of a packet batch lie, in its order.

    ``row`` is the row of the packet; ``at`` and ``end`` are absolute offsets of the frame and of the end of what was
    captured, int64. ``protocol`` is uint16: 0 where the link type says CAN, else the cooked frame's ``TYPE_CAN…``.
    ``interface`` (uint32) is the index that an SLL2 header tells, 0 elsewhere; ``direction`` (uint8) is what the packet
    type of a cooked header says. ``cooked`` is False where all protocols are 0. All columns have shape (n,).
    """

    row: I64
    at: I64
    end: I64
    protocol: U16
    interface: U32
    direction: U8
    cooked: bool


def _spans(batch: PacketBatch, rows: I64 | None = None) -> _Spans:
    """Find the CAN frames of a packet batch, or of some of its rows (rising).

    Of link type 227, in SLL and SLL2, and in PDUs that Wireshark exported.
    """
    if rows is None:
        rows, links = np.arange(len(batch)), batch.link
        at, captured = batch.offset, batch.captured
    else:
        links, at, captured = batch.link[rows], batch.offset[rows], batch.captured[rows]
    end = at + captured
    if batch.single_link == LinkType.CAN_SOCKETCAN:
        nothing = np.broadcast_to(np.uint32(0), (len(rows),))
        unknown = np.broadcast_to(np.uint8(Direction.UNKNOWN), (len(rows),))
        return _Spans(rows, at, end, PacketBatch.link_column(0, len(rows)), nothing, unknown, False)
    protocol, interface = np.zeros(len(rows), np.uint16), np.zeros(len(rows), np.uint32)
    direction = np.zeros(len(rows), np.uint8)
    start = at.copy()
    mine = links == LinkType.CAN_SOCKETCAN
    for link, layout in _COOKED.items():
        positions = np.flatnonzero((links == link) & (captured >= layout.size_bytes))
        if len(positions):
            head = layout.gather(batch.data, at[positions])
            kind = head["type"].astype(np.uint16)
            protocol[positions] = kind
            mine[positions] = (kind >= TYPE_CAN) & (kind <= TYPE_CAN_XL)
            direction[positions] = np.where(head["packet_type"] == PACKET_OUTGOING, Direction.TX, Direction.RX)
            if layout is SLL2:
                inside = np.ascontiguousarray(head["interface"]).view(SLL2_INTERFACE.dtype)
                interface[positions] = inside["index"]
            start[positions] += layout.size_bytes
    exported = np.flatnonzero(links == LinkType.UPPER_PDU)
    if len(exported):
        begin, kind = start[exported], protocol[exported]
        mine[exported] = _inside_pdus(batch.data, at[exported], end[exported], begin, kind)
        start[exported], protocol[exported] = begin, kind
    return _Spans(
        rows[mine], start[mine], end[mine], protocol[mine], interface[mine], direction[mine], True
    )  # fmt: skip


def _dissectors(data: U8, at: I64, size: I64) -> I64:
    """Return the places in ``_PDU_DISSECTORS``, from 1, of the names of at most ``_NAME_BYTES`` bytes; 0 of others."""
    every: Records = np.ndarray((len(data) - _NAME_BYTES + 1,), f"V{_NAME_BYTES}", data, strides=(1,))
    text = every[at].view(np.uint8).reshape(-1, _NAME_BYTES)
    text[np.arange(_NAME_BYTES) >= size[:, np.newaxis]] = 0
    number = np.zeros(len(at), np.int64)
    for place, name in enumerate(_PDU_DISSECTORS, 1):
        number[(text == np.frombuffer(name.ljust(_NAME_BYTES, b"\0"), np.uint8)).all(axis=1)] = place
    return number


def _inside_pdus(data: U8, at: I64, end: I64, start: I64, protocol: U16) -> Bool:
    """Find the frames inside of PDUs that Wireshark exported: fill in ``start`` and ``protocol`` of those that are CAN.

    Tags stand in front of a frame, and one has the name of its dissector.
    """
    found: Bool = np.zeros(len(at), np.bool_)
    named = np.zeros(len(at), np.int64)
    here = at.copy()
    rows = np.flatnonzero(here + UPPER_PDU_TAG.size_bytes <= end)
    for _ in range(_MAX_PDU_TAGS):
        if not len(rows):
            break
        tag = UPPER_PDU_TAG.gather(data, here[rows])
        size = tag["length"].astype(np.int64)
        here[rows] += UPPER_PDU_TAG.size_bytes
        told = np.flatnonzero(
            (tag["tag"] == PDU_TAG_DISSECTOR) & (size <= _NAME_BYTES) & (here[rows] + size <= end[rows])
        )
        if len(told):
            named[rows[told]] = _dissectors(data, here[rows[told]], size[told])
        ends = tag["tag"] == PDU_TAG_END
        here[rows] += size
        ended = rows[ends]
        found[ended] = named[ended] > 0
        rows = rows[~ends]
        rows = rows[here[rows] + UPPER_PDU_TAG.size_bytes <= end[rows]]
    start[found] = here[found]
    protocol[found] = np.array([0, *_PDU_DISSECTORS.values()], np.uint16)[named[found]]
    return found


def _bit(numbers: U8, position: int) -> Bool:
    return ((numbers >> np.uint8(position)) & np.uint8(1)).view(np.bool_)


def _is_fd(head: Records, spans: _Spans) -> Bool:
    """Tell which frames are CAN FD.

    A cooked frame's protocol says it. Elsewhere it is the flag's word, as in Wireshark only where all around it is 0:
    old captures have noise in these bytes.
    """
    fd = _bit(head["fd_flags"], FD_FRAME.position)
    if fd.any():
        fd &= (head["fd_flags"] & np.uint8(0xFF & ~_KNOWN_FD_FLAGS)) == 0
        fd &= (head["reserved"] == 0) & (head["len8_dlc"] == 0)
    if spans.cooked:
        fd = np.where(spans.protocol == 0, fd, spans.protocol == TYPE_CAN_FD)
    return fd


def channels_of(packets: PacketBatch) -> U16:
    """Return the channel of each packet, uint16: that of the batch, else the index of the interface in SLL2 headers."""
    if packets.channel is not None or LinkType.LINUX_SLL2 not in packets.link:
        return packets.channels
    spans = _spans(packets)
    column = np.zeros(len(packets), np.uint16)
    column[spans.row] = _channels(packets, spans)
    return column


def _directions(packets: PacketBatch, spans: _Spans) -> U8:
    if packets.direction is None:
        return spans.direction
    told = packets.direction if len(spans.row) == len(packets) else packets.direction[spans.row]
    return np.where(told == Direction.UNKNOWN, spans.direction, told) if spans.cooked else told


def _channels(packets: PacketBatch, spans: _Spans) -> U16:
    if packets.channel is not None:
        return packets.channel if len(spans.row) == len(packets) else packets.channel[spans.row]
    if spans.cooked:
        return np.minimum(spans.interface, 0xFFFF).astype(np.uint16)
    return PacketBatch.link_column(0, len(spans.row))
