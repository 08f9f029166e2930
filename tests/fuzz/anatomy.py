"""Where in a capture file the records, their numbers and their packets lie, for mutations to aim at.

Written for files that were right before something was changed in them; of others the part up to the damage is known.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Literal, NamedTuple

PCAP_ORDERS = {
    struct.pack(order + "I", magic): order for order in "<>" for magic in (0xA1B2C3D4, 0xA1B23C4D)
}  # fmt: skip
PCAPNG_ORDERS = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
SECTION_MAGIC = b"\x0a\x0d\x0d\x0a"
PCAP_HEADER_BYTES = 24
PCAP_RECORD_BYTES = 16

PCAP_RECORD = -1
SECTION, INTERFACE, OBSOLETE_PACKET, SIMPLE_PACKET, STATISTICS, ENHANCED_PACKET = 0x0A0D0D0A, 1, 2, 3, 5, 6
_PACKET_AT = {OBSOLETE_PACKET: 28, SIMPLE_PACKET: 12, ENHANCED_PACKET: 28}
_OPTIONS_AT = {SECTION: 24, INTERFACE: 16, STATISTICS: 20}

IDENTITIES = (b"\x00-S3", b"0-S3")


class Number(NamedTuple):
    """Where an unsigned number stands, and in which byte order ('<' or '>')."""

    at: int
    size: int
    order: str

    def read(self, data: bytes) -> int:
        return int.from_bytes(data[self.at : self.at + self.size], _NAMES[self.order])

    def written(self, data: bytes, value: int) -> bytes:
        """Return the data with another number here, cut to its size."""
        content = (value & ((1 << 8 * self.size) - 1)).to_bytes(self.size, _NAMES[self.order])
        return data[: self.at] + content + data[self.at + self.size :]


_NAMES: dict[str, Literal["little", "big"]] = {"<": "little", ">": "big"}


class Record(NamedTuple):
    """A record of pcap (``kind`` PCAP_RECORD) or a block of pcapng, and the span of the packet in it, if any."""

    data: bytes
    order: str
    kind: int
    packet: slice | None

    def content(self) -> bytes:
        return b"" if self.packet is None else self.data[self.packet]

    def with_packet(self, content: bytes) -> Record:
        """Return the record around another packet, all its lengths right; a simple block stays as it is."""
        if self.packet is None or self.kind == SIMPLE_PACKET:
            return self
        begin = self.packet.start
        size = struct.pack(self.order + "I", len(content))
        if self.kind == PCAP_RECORD:
            return self._replace(data=self.data[:8] + size + self.data[12:16] + content, packet=slice(16, None))
        body = self.data[8:20] + size + self.data[24:28] + content + bytes(-len(content) % 4)
        after = self.data[begin + (self.packet.stop - begin + 3) // 4 * 4 : -4]
        length = struct.pack(self.order + "I", len(body) + len(after) + 12)
        data = self.data[:4] + length + body + after + length
        return self._replace(data=data, packet=slice(begin, begin + len(content)))

    def numbers(self) -> list[Number]:
        """The numbers of the header, the lengths among them, and of a block also of its end and of its options."""
        if self.kind == PCAP_RECORD:
            return [Number(at, 4, self.order) for at in (0, 4, 8, 12)]
        spans = [(0, 4), (4, 4), (len(self.data) - 4, 4)]
        match self.kind:
            case _ if self.kind == SECTION:
                spans += [(8, 4), (12, 2), (14, 2), (16, 8)]
            case _ if self.kind == INTERFACE:
                spans += [(8, 2), (12, 4)]
            case _ if self.kind == SIMPLE_PACKET:
                spans += [(8, 4)]
            case _ if self.kind == OBSOLETE_PACKET:
                spans += [(8, 2), (10, 2), (12, 4), (16, 4), (20, 4), (24, 4)]
            case _ if self.kind in (STATISTICS, ENHANCED_PACKET):
                spans += [(8, 4), (12, 4), (16, 4), (20, 4), (24, 4)][: 5 if self.kind == ENHANCED_PACKET else 3]
        at = _OPTIONS_AT.get(self.kind, len(self.data))
        if self.kind in (OBSOLETE_PACKET, ENHANCED_PACKET) and self.packet is not None:
            at = (self.packet.stop + 3) // 4 * 4
        while at + 8 <= len(self.data):
            size = Number(at + 2, 2, self.order).read(self.data)
            spans += [(at, 2), (at + 2, 2), (at + 4, 1)]
            if size >= 8:
                spans.append((at + 4, 8))
            at += 4 + (size + 3) // 4 * 4
        return [Number(at, size, self.order) for at, size in spans if at + size <= len(self.data)]

    def time(self) -> list[Number]:
        """The high and the low part of the time of the packet, if it has one."""
        if self.kind == PCAP_RECORD:
            return [Number(0, 4, self.order), Number(4, 4, self.order)]
        if self.kind in (OBSOLETE_PACKET, ENHANCED_PACKET):
            return [Number(12, 4, self.order), Number(16, 4, self.order)]
        return []


@dataclass(frozen=True)
class Anatomy:
    """The parts of a capture file: its header (pcap only), its records, and what follows the last that is whole."""

    head: bytes
    records: list[Record]
    rest: bytes

    def assembled(self) -> bytes:
        return self.head + b"".join(record.data for record in self.records) + self.rest

    def with_records(self, records: list[Record]) -> Anatomy:
        return Anatomy(self.head, records, self.rest)

    def packets(self) -> list[int]:
        """The places of the records that hold a packet."""
        return [place for place, record in enumerate(self.records) if record.packet is not None]


def anatomy_of(raw: bytes) -> Anatomy | None:
    """Return the parts of a capture file, or None where it begins like no capture file."""
    if len(raw) >= PCAP_HEADER_BYTES and raw[:4] in PCAP_ORDERS:
        return _pcap(raw, PCAP_ORDERS[raw[:4]])
    if raw[:4] == SECTION_MAGIC:
        return _pcapng(raw)
    return None


def _pcap(raw: bytes, order: str) -> Anatomy:
    records = []
    at = PCAP_HEADER_BYTES
    while at + PCAP_RECORD_BYTES <= len(raw):
        end = at + PCAP_RECORD_BYTES + Number(at + 8, 4, order).read(raw)
        if end > len(raw):
            break
        records.append(Record(raw[at:end], order, PCAP_RECORD, slice(PCAP_RECORD_BYTES, None)))
        at = end
    return Anatomy(raw[:PCAP_HEADER_BYTES], records, raw[at:])


def _pcapng(raw: bytes) -> Anatomy:
    records: list[Record] = []
    order = "<"
    at = 0
    while at + 12 <= len(raw):
        if raw[at : at + 4] == SECTION_MAGIC:
            order = PCAPNG_ORDERS.get(raw[at + 8 : at + 12], order)
        kind, length = struct.unpack(order + "II", raw[at : at + 8])
        if length < 12 or length % 4 or at + length > len(raw):
            break
        data = raw[at : at + length]
        packet = None
        begin = _PACKET_AT.get(kind, 0)
        if begin and length >= begin + 4:
            size = Number(begin - (4 if kind == SIMPLE_PACKET else 8), 4, order).read(data)
            packet = slice(begin, min(begin + size, length - 4))
        records.append(Record(data, order, kind, packet))
        at += length
    return Anatomy(b"", records, raw[at:])


# Before the identity: ports and length of UDP; total length, fragment, protocol, addresses of IPv4; version and header
# length of both. After it: the fields of the telegram, in its own byte order.
_BEFORE = (
    (-8, 2), (-6, 2), (-4, 2), (-28, 1), (-26, 2), (-22, 2), (-19, 1), (-16, 4), (-12, 4), (-9, 1), (-48, 1), (-44, 2),
    (-42, 1), (-30, 2), (-50, 2), (-34, 2),
)  # fmt: skip
_AFTER = ((0, 4), (4, 4), (8, 2), (10, 2), (12, 2), (14, 2), (16, 2), (18, 1), (19, 1))
_FRONT = ((0, 1), (0, 2), (0, 4), (2, 2), (6, 1), (9, 1), (10, 1), (12, 2), (14, 1), (14, 2), (16, 2))


def packet_numbers(packet: bytes) -> list[Number]:
    """Return the numbers in a packet: of link layer and IP where they mostly stand, of UDP and the telegram exactly."""
    found = [(at, size, ">") for at, size in _FRONT]
    for identity in IDENTITIES:
        at = packet.find(identity)
        while at >= 0:
            found += [(at + shift, size, ">") for shift, size in _BEFORE]
            found += [(at + shift, size, "<") for shift, size in _AFTER]
            at = packet.find(identity, at + 1)
    return [Number(at, size, order) for at, size, order in found if at >= 0 and at + size <= len(packet)]
