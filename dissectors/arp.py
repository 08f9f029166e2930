"""ARP: who has which IP address on this network (RFC 826; announcements and probes: RFC 5227), as columns."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, U32, Bool, Records
from dissectors.columns import Columns
from dissectors.headers import ARP, TYPE_IPV4
from dissectors.layout import gather_bytes
from dissectors.transport import Place

REQUEST, REPLY = 1, 2
OPERATIONS = {
    REQUEST: "request",
    REPLY: "reply",
    3: "reverse request",
    4: "reverse reply",
    8: "inverse request",
    9: "inverse reply",
}
"""Operations in words, those that are seen on Ethernet (IANA, arp-parameters)."""

FIXED_BYTES = ARP.offset_of("sender_hardware")
"""Bytes in front of the addresses, whose lengths they tell."""

_HARDWARE_BYTES, _IPV4_BYTES = 6, 4
_ETHERNET_TYPES = (1, 6)  # Ethernet and IEEE 802


class ArpBatch(Columns, Struct, frozen=True):
    """The ARP messages of a packet batch whose fixed part was captured, in its order.

    ``row`` is the row of the packet. The next five are the fixed part, as in ``ARP``, int64. Addresses lie at the
    absolute offsets ``sender_at``, ``sender_ip_at``, ``target_at`` and ``target_ip_at``, behind each other, int64;
    ``end`` is where what was captured ends.
    """

    row: I64
    hardware_type: I64
    protocol: I64
    hardware_bytes: I64
    protocol_bytes: I64
    operation: I64
    sender_at: I64
    sender_ip_at: I64
    target_at: I64
    target_ip_at: I64
    end: I64

    def has_hardware(self, at: I64) -> Bool:
        """Tell where a hardware address of Ethernet lies at some offsets, and was captured."""
        told: Bool = np.isin(self.hardware_type, _ETHERNET_TYPES) & (self.hardware_bytes == _HARDWARE_BYTES)
        return told & (at + _HARDWARE_BYTES <= self.end)

    def has_ipv4(self, at: I64) -> Bool:
        """Tell where an IPv4 address lies at some offsets, and was captured."""
        told: Bool = (self.protocol == TYPE_IPV4) & (self.protocol_bytes == _IPV4_BYTES)
        return told & (at + _IPV4_BYTES <= self.end)


def read_arp(data: U8, place: Place) -> ArpBatch:
    """Read ARP messages; of which not the whole fixed part was captured is left out."""
    place = place.take(place.at + FIXED_BYTES <= place.end)
    head: Records = gather_bytes(data, place.at, FIXED_BYTES).view(_fixed())
    hardware, protocol = (head[name].astype(np.int64) for name in ("hardware_bytes", "protocol_bytes"))
    sender = place.at + FIXED_BYTES
    return ArpBatch(
        place.row, head["hardware_type"].astype(np.int64), head["protocol"].astype(np.int64), hardware, protocol,
        head["operation"].astype(np.int64), sender, sender + hardware, sender + hardware + protocol,
        sender + 2 * hardware + protocol, place.end,
    )  # fmt: skip


def ipv4_at(data: U8, at: I64) -> U32:
    """Return the IPv4 addresses at some offsets."""
    return gather_bytes(data, at, _IPV4_BYTES).view(">u4").reshape(-1).astype(np.uint32)


def _fixed() -> np.dtype[np.void]:
    return np.dtype([(entry.name, entry.dtype) for entry in ARP if ARP.offset_of(entry.name) < FIXED_BYTES])


NO_ARP = ArpBatch(*[np.empty(0, np.int64)] * len(ArpBatch.__match_args__))
