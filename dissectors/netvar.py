"""3S-0 telegrams: the header table, the services and the flags.

Source: Network Functionality in CoDeSys V2.3, document version 1.7, section 2.4.1.

::

     0       4       8     10        12      14       16        18      19         20
    +-------+-------+-------+---------+-------+--------+---------+-------+----------+------
    |Identit| ID    | Index | SubIndex| Items | Length | Counter | Flags | Checksum | Data
    +-------+-------+-------+---------+-------+--------+---------+-------+----------+------
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from dissectors.batch import I64, U8, U32, Bool, LinkType, PacketBatch, Records
from dissectors.layout import Bit, Field, Layout, gather_bytes, take_rows
from dissectors.link import (
    ETHERNET,
    IPV4,
    IPV4_HIGH,
    IPV4_LOW,
    NO_DATAGRAMS,
    PROTOCOL_ICMP,
    PROTOCOL_UDP,
    TYPE_IPV4,
    TYPE_IPV6,
    UDP,
    VLAN_TYPES,
    DatagramBatch,
    Peeled,
    broadcast_ipv4,
    peel,
)

PORT = 1202
IDENTITY = 0x33532D00  # b"\x00-S3" read as a little-endian number
IDENTITY_ASCII = 0x33532D30  # b"0-S3", as the document prints it: accepted, reported, never produced


class Service(IntEnum):
    """Kinds of telegrams, named as in the enumeration NetVarOD_Service_Udp of the document."""

    ODStateFree = 0
    ODReadRequest = 1
    ODReadRequestReply = 2
    ODWriteRequest = 3
    ODWriteRequestReply = 4
    ODAcknowledgement = 5
    ODBootUpRequest = 6
    ODErrorReplyUnknown = 20
    ODErrorReplyItems = 21
    ODErrorReplyAccess = 22
    ODErrorReplyIdx = 23
    ODErrorReplySub = 24
    ODErrorReplyLen = 25
    ODErrorWrongService = 26
    ODErrorTimeOut = 27
    ODErrorReplyCPUStopped = 28
    ODStateBusy = 100


ACKNOWLEDGE_WANTED = Bit(0, "ack", "acknowledgement wanted")
CHECKSUM_PRESENT = Bit(1, "checksum", "checksum present")
CHECKSUM_INVALID = Bit(2, "invalid", "invalid checksum: negative acknowledgement")
RESERVED_FLAGS = 0xF8

HEADER = Layout(
    "nv",
    (
        Field("identity", "<u4", "Identity", "protocol identity, 00 2D 53 33", base="hex", default=IDENTITY),
        Field("id", "<u4", "ID", "service", values={s.value: s.name for s in Service}),
        Field("index", "<u2", "Index", "list identifier (COB-ID)"),
        Field("subindex", "<u2", "SubIndex", "number of the telegram (packed) or of the variable (unpacked)"),
        Field("items", "<u2", "Items", "elementary variables in this telegram"),
        Field("length", "<u2", "Length", "header and data in bytes, the UDP payload length"),
        Field("counter", "<u2", "Counter", "number of this telegram; its scope depends on the sender"),
        Field(
            "flags", "u1", "Flags", "bits 3 to 7 are undocumented",
            bits=(ACKNOWLEDGE_WANTED, CHECKSUM_PRESENT, CHECKSUM_INVALID), base="hex",
        ),
        Field("checksum", "u1", "Checksum", "opaque signature of the definition", base="hex"),
    ),
)  # fmt: skip

KNOWN_SERVICE = np.isin(np.arange(102), [service.value for service in Service])
"""Mask over ID, whose last entry stands for everything above."""

LEAST_CAPTURED_BYTES = HEADER.offset_of("items")
"""A payload is told to be a telegram, and of which list, from its first 12 bytes."""


LEAST_QUOTED_BYTES = HEADER.offset_of("subindex")
"""A telegram that an ICMP message quotes tells its list from so many bytes."""


class Fault(IntEnum):
    """What is wrong with a telegram; the first that applies, in this order."""

    NONE = 0
    HEADER_CUT = 1  # fewer than 20 bytes captured of a longer payload: nothing behind SubIndex is known
    SHORT = 2  # payload shorter than the header
    LENGTH = 3  # Length is not the payload's
    BYTE_SWAPPED = 4  # Length is the payload's once its bytes are swapped
    SERVICE = 5  # ID is none of the known ones


@dataclass(frozen=True, slots=True)
class TelegramBatch:
    """The telegrams of a packet batch, in its order.

    ``data`` is the buffer that ``datagram.payload`` points into. ``header`` is a structured array of ``HEADER.dtype``;
    where ``fault`` is HEADER_CUT or SHORT, fields behind SubIndex hold no bytes of the telegram. ``fault`` is uint8
    (``Fault``). All columns have shape (n,); ``ts_ns`` is int64. A telegram is *truncated* where fewer bytes were
    captured than its payload has.
    """

    data: U8
    datagram: DatagramBatch
    ts_ns: I64
    header: Records
    fault: U8

    def __len__(self) -> int:
        return len(self.fault)

    @property
    def truncated(self) -> Bool:
        return self.datagram.captured_bytes < self.datagram.payload_bytes

    def take(self, rows: I64 | Bool) -> TelegramBatch:
        """Return the telegrams at the given positions or where the mask is set."""
        header = take_rows(self.header, rows)
        return TelegramBatch(self.data, self.datagram.take(rows), self.ts_ns[rows], header, self.fault[rows])

    def payload(self, position: int) -> bytes:
        """Return a copy of the captured bytes of one telegram, header included."""
        start = int(self.datagram.payload[position])
        return self.data[start : start + int(self.datagram.captured_bytes[position])].tobytes()


@dataclass(frozen=True, slots=True)
class Dissection:
    """A packet batch taken apart: its telegrams, and what else lay in it.

    ``quoted`` are the telegrams that ICMP messages quote as not delivered; how much of them was quoted varies, at least
    up to Index (``quoted.datagram.captured_bytes`` tells).
    """

    telegrams: TelegramBatch
    quoted: TelegramBatch
    peeled: Peeled


@dataclass(frozen=True, slots=True)
class PortRules:
    """UDP ports, either side's, of which it was decided by hand what is on them.

    What goes over a port of ``telegrams`` is read as telegrams whatever its identity; what goes over one of ``others``
    never is. Everything else is told by identity.
    """

    telegrams: tuple[int, ...] = ()
    others: tuple[int, ...] = ()

    def decide(self, datagram: DatagramBatch, by_identity: Bool) -> Bool:
        """Return which datagrams are telegrams, given which have the identity of one."""
        source, destination = datagram.source_port, datagram.destination_port
        chosen = np.isin(source, self.telegrams) | np.isin(destination, self.telegrams)
        excluded = np.isin(source, self.others) | np.isin(destination, self.others)
        return (by_identity | chosen) & ~excluded


def dissect(packets: PacketBatch, ports: PortRules | None = None) -> Dissection:
    """Find and read every telegram of a packet batch: on any port, by its identity, unless ``ports`` has it otherwise.

    Total: wrong bytes are telegrams with a fault, or no telegrams; nothing raises.
    """
    packets = packets.with_margin()
    if ports:
        peeled = peel(packets)
        telegrams = _telegrams(packets, peeled.udp, LEAST_CAPTURED_BYTES, ports)
        return Dissection(telegrams, _telegrams(packets, peeled.quoted, LEAST_QUOTED_BYTES, ports), peeled)
    plain, rest = _plain_telegrams(packets)
    if rest is not None and not len(rest):
        return Dissection(plain, _telegrams(packets, NO_DATAGRAMS, 0), Peeled(NO_DATAGRAMS, NO_DATAGRAMS, 0, None))
    peeled = peel(packets, rest)
    telegrams = _telegrams(packets, peeled.udp, LEAST_CAPTURED_BYTES)
    quoted = _telegrams(packets, peeled.quoted, LEAST_QUOTED_BYTES)
    return Dissection(_joined(plain, telegrams), quoted, peeled)


PLAIN = np.dtype([(layout.name, layout.dtype) for layout in (ETHERNET, IPV4, UDP, HEADER)])
"""The headers of nearly all telegrams: Ethernet without tag, IPv4 without options, UDP, 3S-0."""


def _plain_telegrams(packets: PacketBatch) -> tuple[TelegramBatch, I64 | None]:
    """Read the telegrams of the plain shape with one copy each; return them and the rows that are to be peeled.

    A short cut through ``peel`` that leaves out nothing but generality. Not to be peeled are, besides, packets whose
    plain headers show that nothing for us is in them. None stands for all rows.
    """
    if packets.single_link != LinkType.ETHERNET:
        return _telegrams(packets, NO_DATAGRAMS, 0), None
    payload_at = PLAIN.itemsize - HEADER.size_bytes
    head = gather_bytes(packets.data, packets.offset, PLAIN.itemsize).view(PLAIN)
    identity, ip, udp = head["nv"]["identity"].copy(), head["ip"], head["udp"]
    plain = (identity == IDENTITY) | (identity == IDENTITY_ASCII)
    plain &= head["eth"]["type"] == TYPE_IPV4
    plain &= (ip["version_ihl"] == 0x45) & (ip["protocol"] == PROTOCOL_UDP) & ((ip["fragment"] & 0x3FFF) == 0)
    plain &= packets.captured >= payload_at + LEAST_CAPTURED_BYTES
    udp_length = udp["length"].astype(np.int64)
    plain &= ip["total_length"] == udp_length + IPV4.size_bytes
    plain &= udp_length >= UDP.size_bytes + LEAST_CAPTURED_BYTES
    rows, rest, everything = np.flatnonzero(plain), np.flatnonzero(~plain), head
    offset, captured, ts_ns = packets.offset, packets.captured, packets.ts_ns
    if len(rows) != len(packets):
        head, udp_length = take_rows(head, rows), udp_length[rows]
        offset, captured, ts_ns = offset[rows], captured[rows], ts_ns[rows]
    eth, ip, udp, header = (head[layout.name] for layout in (ETHERNET, IPV4, UDP, HEADER))
    payload_bytes = udp_length - UDP.size_bytes
    source, destination = ip["source"].astype(np.uint64), ip["destination"].astype(np.uint64)
    high = np.broadcast_to(IPV4_HIGH, (len(rows),))
    datagram = DatagramBatch(
        rows, offset + payload_at, payload_bytes, np.minimum(captured - payload_at, payload_bytes),
        high, source | IPV4_LOW, high, destination | IPV4_LOW,
        udp["source_port"].astype(np.uint16), udp["destination_port"].astype(np.uint16),
        broadcast_ipv4(eth["group"] & np.uint8(1), destination),
    )  # fmt: skip
    telegrams = TelegramBatch(packets.data, datagram, ts_ns, header, _faults(datagram, header))
    return telegrams, rest[_may_hold_telegrams(take_rows(everything, rest))]


def _may_hold_telegrams(head: Records) -> Bool:
    """Tell which frames may hold a telegram, or quote one, in other than the plain shape."""
    ethertype = head["eth"]["type"].astype(np.uint16)
    tagged = np.zeros(len(head), np.bool_)
    for known in (TYPE_IPV6, *VLAN_TYPES):
        tagged |= ethertype == known
    ip, identity = head["ip"], head["nv"]["identity"]
    simple = (ip["version_ihl"] == 0x45) & ((ip["fragment"] & 0x3FFF) == 0)
    told = (identity == IDENTITY) | (identity == IDENTITY_ASCII)
    idle = simple & (ip["protocol"] != PROTOCOL_ICMP) & ((ip["protocol"] != PROTOCOL_UDP) | ~told)
    may: Bool = tagged | ((ethertype == TYPE_IPV4) & ~idle)
    return may


def _joined(first: TelegramBatch, second: TelegramBatch) -> TelegramBatch:
    """Return the telegrams of two batches over one buffer in the order of their packets."""
    if not len(first) or not len(second):
        return first if len(first) else second
    row = np.concatenate([first.datagram.row, second.datagram.row])
    order = np.argsort(row, kind="stable")
    return TelegramBatch(
        first.data,
        DatagramBatch.joined([first.datagram, second.datagram]),
        np.concatenate([first.ts_ns, second.ts_ns])[order],
        take_rows(np.concatenate([first.header, second.header]), order),
        np.concatenate([first.fault, second.fault])[order],
    )


def _telegrams(
    packets: PacketBatch, datagram: DatagramBatch, least_bytes: int, ports: PortRules | None = None
) -> TelegramBatch:
    header = HEADER.gather(packets.data, datagram.payload)
    identity = header["identity"]
    mine = (identity == IDENTITY) | (identity == IDENTITY_ASCII)
    if ports:
        mine = ports.decide(datagram, mine)
    mine &= datagram.captured_bytes >= least_bytes
    if not mine.all():
        datagram, header = datagram.take(mine), take_rows(header, mine)
    ts_ns = packets.ts_ns if len(datagram) == len(packets) else packets.ts_ns[datagram.row]
    return TelegramBatch(packets.data, datagram, ts_ns, header, _faults(datagram, header))


def _faults(datagram: DatagramBatch, header: Records) -> U8:
    fault = np.zeros(len(header), np.uint8)
    service: U32 = header["id"]
    good = header["length"] == datagram.payload_bytes
    good &= datagram.captured_bytes >= HEADER.size_bytes
    good &= service <= Service.ODBootUpRequest
    bad = np.flatnonzero(~good)
    if len(bad):
        payload_bytes, captured_bytes = datagram.payload_bytes[bad], datagram.captured_bytes[bad]
        length = header["length"][bad]
        known = KNOWN_SERVICE[np.minimum(service[bad], len(KNOWN_SERVICE) - 1)]
        fits = length == payload_bytes
        fault[bad] = np.select(
            [
                (captured_bytes < HEADER.size_bytes) & (captured_bytes < payload_bytes),
                payload_bytes < HEADER.size_bytes,
                fits & known,
                fits,
                length.byteswap() == payload_bytes,
            ],
            [Fault.HEADER_CUT, Fault.SHORT, Fault.NONE, Fault.SERVICE, Fault.BYTE_SWAPPED],
            Fault.LENGTH,
        )
    return fault
