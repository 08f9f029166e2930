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
from msgspec import Struct

from dissectors.batch import I64, U8, U32, Bool, PacketBatch, Records
from dissectors.claims import NO_CLAIMS, Claims
from dissectors.layout import Bit, Field, Layout, take_rows
from dissectors.link import NOTHING_PEELED, Peeled, peel
from dissectors.transport import NO_DATAGRAMS, DatagramBatch

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
    "Network variables (3S-0)",
)  # fmt: skip

KNOWN_SERVICE = np.isin(np.arange(102), [service.value for service in Service])
"""Mask over ID, whose last entry stands for everything above."""

LIST_SERVICES = (Service.ODStateFree, Service.ODAcknowledgement, Service.ODBootUpRequest)
PARAMETER_REQUESTS = (Service.ODReadRequest, Service.ODWriteRequest)
"""What opens a conversation with the Parameter Manager; all others of its services answer."""

PARAMETER_ERRORS = tuple(one for one in Service if Service.ODErrorReplyUnknown <= one <= Service.ODErrorReplyCPUStopped)
"""The error replies of the Parameter Manager, in the order of their numbers."""

IS_PARAMETER = KNOWN_SERVICE.copy()
"""Mask over ID, as ``KNOWN_SERVICE``: the services of the Parameter Manager, whose Index is not that of a list."""

IS_PARAMETER[list(LIST_SERVICES)] = False

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
    def row(self) -> I64:
        """The rows of the packets."""
        return self.datagram.row

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


class Dissection(Struct, frozen=True):
    """A packet batch taken apart: its telegrams, and what else lay in it.

    ``quoted`` are the telegrams that ICMP messages quote as not delivered; how much of them was quoted varies, at least
    up to Index (``quoted.datagram.captured_bytes`` tells). Where there are some, their datagrams are a ``QuotedBatch``.
    """

    telegrams: TelegramBatch
    quoted: TelegramBatch
    peeled: Peeled


NO_TELEGRAMS = TelegramBatch(
    np.zeros(0, np.uint8), NO_DATAGRAMS, np.empty(0, np.int64), np.empty(0, HEADER.dtype), np.empty(0, np.uint8)
)
NOTHING = Dissection(NO_TELEGRAMS, NO_TELEGRAMS, NOTHING_PEELED)


class PortRules(Struct, frozen=True):
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


def dissect(
    packets: PacketBatch, ports: PortRules | None = None, rows: I64 | None = None, claims: Claims = NO_CLAIMS
) -> Dissection:
    """Find and read every telegram of a packet batch: on any port, by its identity, unless ``ports`` has it otherwise.

    Where ``rows`` (rising) are given, only these packets are looked at; ``claims`` are as for ``peel``. Total: wrong
    bytes are telegrams with a fault, or no telegrams; nothing raises.
    """
    if rows is not None and not len(rows):
        return NOTHING
    packets = packets.with_margin(rows=rows)
    peeled = peel(packets, rows, claims)
    telegrams = _telegrams(packets, peeled.udp, LEAST_CAPTURED_BYTES, ports)
    return Dissection(telegrams, _telegrams(packets, peeled.quoted, LEAST_QUOTED_BYTES, ports), peeled)


def _telegrams(
    packets: PacketBatch, datagram: DatagramBatch, least_bytes: int, ports: PortRules | None = None
) -> TelegramBatch:
    if not len(datagram):
        return NO_TELEGRAMS
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
