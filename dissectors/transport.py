"""The transport layer, as columns: UDP datagrams and TCP segments, from whom to whom, and where their data lies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, U16, U32, U64, Bool
from dissectors.columns import Columns
from dissectors.headers import TCP, UDP
from dissectors.layout import take_rows

GROUP_UNKNOWN = 2
"""Value of the group column where no link layer tells whether a frame was a broadcast."""

_TCP_WORD_BYTES = 4
_OFFSET_SHIFT = 4

UNTOLD = -1
"""In place of where a packet ends by its header, where that says no length."""


class Place(Columns, Struct, frozen=True):
    """Rows at the start of a layer: absolute offsets of it and of the end of what was captured.

    ``group`` is 1 where the link layer says that a frame went to everybody, ``GROUP_UNKNOWN`` where none is there.
    """

    row: I64
    at: I64
    end: I64
    group: U8


class IpPackets(Struct, frozen=True):
    """Rows at the start of a transport header, with what the IP header said.

    ``stop`` is where the packet ends by its header, which is behind ``place.end`` where less was captured; ``UNTOLD``
    where that leaves it to hardware to fill in.
    """

    place: Place
    stop: I64
    protocol: U8
    source_hi: U64
    source_lo: U64
    destination_hi: U64
    destination_lo: U64
    is_ipv4: bool

    def take(self, rows: I64 | Bool) -> IpPackets:
        return IpPackets(
            self.place.take(rows), self.stop[rows], self.protocol[rows], self.source_hi[rows], self.source_lo[rows],
            self.destination_hi[rows], self.destination_lo[rows], self.is_ipv4,
        )  # fmt: skip

    def with_room(self, size_bytes: int) -> IpPackets:
        """Keep the rows with room for a header, without copying where all have it."""
        room = self.place.at + size_bytes <= self.place.end
        return self if room.all() else self.take(room)


@dataclass(frozen=True, slots=True)
class IpEnds(Columns):
    """From which address to which frames went, in the order of the packets.

    ``row`` is the row of the packet in its batch, int64. Addresses are two uint64 halves each, IPv4 ones as in
    ``IPV4_HIGH``.
    """

    row: I64
    source_hi: U64
    source_lo: U64
    destination_hi: U64
    destination_lo: U64

    @classmethod
    def joined(cls, parts: Sequence[Any]) -> Self:
        """Return several batches of one buffer, each in the order of the packets, as one in that order."""
        if len(parts) == 1 and isinstance(parts[0], cls):
            return parts[0]
        whole = cls.stacked(parts)
        return whole.take(np.argsort(whole.row, kind="stable"))


@dataclass(frozen=True, slots=True)
class TransportBatch(IpEnds):
    """What datagrams and segments have in common.

    ``payload`` is the absolute offset of the payload in the batch's buffer, int64; ``payload_bytes`` how long it is,
    ``captured_bytes`` how much of it was captured. Ports are uint16.
    """

    payload: I64
    payload_bytes: I64
    captured_bytes: I64
    source_port: U16
    destination_port: U16

    def holding(self, size_bytes: int) -> Self:
        """Return those of which so many bytes were captured: these can be gathered, whatever lies behind them."""
        return self.take(self.captured_bytes >= size_bytes)


@dataclass(frozen=True, slots=True)
class DatagramBatch(TransportBatch):
    """UDP datagrams of a packet batch, in its order; also those that hold telegrams only (``dissectors.netvar``).

    ``payload_bytes`` is the length that the UDP header tells; ``broadcast`` is bool.
    """

    broadcast: Bool


@dataclass(frozen=True, slots=True)
class QuotedBatch(DatagramBatch):
    """UDP datagrams that ICMP messages quote as undeliverable; ``row`` is that of the message.

    ``by_hi`` and ``by_lo`` are the halves of the address that sent the message, ``code`` says why (RFC 792 and 4443),
    uint8.
    """

    by_hi: U64
    by_lo: U64
    code: U8


@dataclass(frozen=True, slots=True)
class SegmentBatch(TransportBatch):
    """TCP segments of a packet batch, in its order, those without data among them.

    ``header`` is the absolute offset of the TCP header, which lies in front of ``payload`` with its options, int64.
    ``payload_bytes`` is what the IP header leaves for data, or, where hardware was to fill in its length, the frame.
    ``sequence`` and ``acknowledgement`` are uint32 as sent, ``flags`` uint8 as in ``TCP["flags"]``. Where nothing of
    the data was captured, ``payload`` may lie behind all that was.
    """

    header: I64
    sequence: U32
    acknowledgement: U32
    flags: U8


def datagrams(data: U8, ip: IpPackets) -> DatagramBatch:
    """Read UDP headers; datagrams whose header was not captured whole, or contradicts itself, are left out."""
    ip = ip.with_room(UDP.size_bytes)
    head = UDP.gather(data, ip.place.at)
    length = head["length"].astype(np.int64)
    whole = length >= UDP.size_bytes
    if not whole.all():
        ip, head, length = ip.take(whole), take_rows(head, whole), length[whole]
    payload = ip.place.at + UDP.size_bytes
    payload_bytes = length - UDP.size_bytes
    captured_bytes = np.minimum(ip.place.end - payload, payload_bytes)
    return DatagramBatch(
        ip.place.row, ip.source_hi, ip.source_lo, ip.destination_hi, ip.destination_lo,
        payload, payload_bytes, captured_bytes,
        head["source_port"].astype(np.uint16), head["destination_port"].astype(np.uint16), _broadcast(ip),
    )  # fmt: skip


def segments(data: U8, ip: IpPackets, frame_stop: I64) -> SegmentBatch:
    """Read TCP headers; segments whose header was not captured whole, or contradicts itself, are left out.

    ``frame_stop`` is where each row of the packet batch ends, captured or not, as an offset in ``data``.
    """
    ip = ip.with_room(TCP.size_bytes)
    head = TCP.gather(data, ip.place.at)
    header_bytes = (head["offset"] >> _OFFSET_SHIFT).astype(np.int64) * _TCP_WORD_BYTES
    payload = ip.place.at + header_bytes
    stop = np.where(ip.stop == UNTOLD, frame_stop[ip.place.row], ip.stop)
    whole = (header_bytes >= TCP.size_bytes) & (payload <= stop)
    if not whole.all():
        ip, head, payload, stop = ip.take(whole), take_rows(head, whole), payload[whole], stop[whole]
    return SegmentBatch(
        ip.place.row, ip.source_hi, ip.source_lo, ip.destination_hi, ip.destination_lo,
        payload, stop - payload, np.maximum(ip.place.end - payload, 0),
        head["source_port"].astype(np.uint16), head["destination_port"].astype(np.uint16), ip.place.at,
        head["sequence"].astype(np.uint32), head["acknowledgement"].astype(np.uint32), head["flags"].astype(np.uint8),
    )  # fmt: skip


def _broadcast(ip: IpPackets) -> Bool:
    """Tell which datagrams went to everybody (by the link layer's word or by the address)."""
    if ip.is_ipv4:
        return broadcast_ipv4(ip.place.group, ip.destination_lo)
    told: Bool = ip.place.group == 1
    told |= (ip.destination_hi >> np.uint64(56)) == 0xFF
    return told


def broadcast_ipv4(group: U8, destination: U64) -> Bool:
    """Tell which IPv4 datagrams went to everybody.

    ``group`` is 1 where the link layer says so, and ``GROUP_UNKNOWN`` where there is none to ask; ``destination`` holds
    addresses in its lower 32 bits.
    """
    told: Bool = group == 1
    if not told.all():
        address = destination.astype(np.uint32)
        told |= (group == GROUP_UNKNOWN) & ((address & np.uint32(0xFF)) == 0xFF)
        told |= (address == 0xFFFFFFFF) | ((address >> np.uint32(28)) == 0xE)
    return told


def _columns(**types: type) -> dict[str, np.ndarray]:
    places = dict.fromkeys(("row", "payload", "payload_bytes", "captured_bytes"), np.int64)
    halves = dict.fromkeys(("source_hi", "source_lo", "destination_hi", "destination_lo"), np.uint64)
    ports = dict.fromkeys(("source_port", "destination_port"), np.uint16)
    return {name: np.empty(0, dtype) for name, dtype in (places | halves | ports | types).items()}


NO_DATAGRAMS = DatagramBatch(**_columns(broadcast=np.bool_))
NO_QUOTED = QuotedBatch(**_columns(broadcast=np.bool_, by_hi=np.uint64, by_lo=np.uint64, code=np.uint8))
NO_SEGMENTS = SegmentBatch(**_columns(header=np.int64, sequence=np.uint32, acknowledgement=np.uint32, flags=np.uint8))
