"""Who sends frames of any kind, as columns: hardware address, VLAN, IP address, time to live, and what ARP tells.

For looking at all frames, also at those in which ``dissectors.link`` finds nothing to go on with.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, U64, Bool, LinkType, PacketBatch
from dissectors.columns import Columns
from dissectors.headers import (
    ARP,
    ETHERNET,
    IPV4,
    IPV4_HIGH,
    IPV4_LOW,
    IPV6,
    SLL,
    SLL2,
    TYPE_ARP,
    TYPE_IPV4,
    TYPE_IPV6,
)
from dissectors.layout import Layout, gather_bytes, take_rows
from dissectors.link import network_layers, step_over_tags
from dissectors.transport import Place

UNKNOWN = -1
"""In place of a VLAN or a time to live that a frame does not have."""

_HARDWARE_BYTES = 6
_HARDWARE_MASK = np.uint64((1 << 8 * _HARDWARE_BYTES) - 1)
_REQUEST = 1
_ARP_OVER_ETHERNET = 1, TYPE_IPV4, _HARDWARE_BYTES, 4

# By link type: the header, and where in it the sender's hardware address lies.
_WITH_HARDWARE: dict[int, tuple[Layout, int]] = {
    LinkType.ETHERNET: (ETHERNET, 6),
    LinkType.LINUX_SLL: (SLL, 6),
    LinkType.LINUX_SLL2: (SLL2, 12),
}


class FrameAddresses(Columns, Struct, frozen=True):
    """Who sent the frames of a packet batch of which that is known, in its order.

    ``row`` is the row of the packet, int64. ``hardware`` are the 48 bits of the sender's hardware address, 0 where
    there is none; ``vlan`` is the number in the outermost tag, ``UNKNOWN`` without one. ``high`` and ``low`` are the
    halves of the sender's IP address, both 0 where there is none; ``ttl`` is its time to live, ``UNKNOWN`` where the
    address is told by ARP. ``announces`` is set where ARP tells an address that nobody asked for; ``sought`` is the
    lower half of the IPv4 address that ARP asks for, 0 where it asks for none; ``answers`` is set where ARP tells the
    address to who asked.
    """

    row: I64
    hardware: U64
    vlan: I64
    high: U64
    low: U64
    ttl: I64
    announces: Bool
    sought: U64
    answers: Bool

    @property
    def has_ip(self) -> Bool:
        """Where an IP address is told."""
        told: Bool = (self.high != 0) | (self.low != 0)
        return told


def addresses_of(packets: PacketBatch, rows: I64 | None = None) -> FrameAddresses:
    """Return who sent the frames of a batch, or of some of its rows (rising).

    Total: no bytes raise, and what was not captured whole is not read.
    """
    packets = packets.with_margin()
    chosen = np.arange(len(packets)) if rows is None else rows
    count = len(chosen)
    found = FrameAddresses(
        chosen, np.zeros(count, np.uint64), np.full(count, UNKNOWN), np.zeros(count, np.uint64),
        np.zeros(count, np.uint64), np.full(count, UNKNOWN), np.zeros(count, np.bool_), np.zeros(count, np.uint64),
        np.zeros(count, np.bool_),
    )  # fmt: skip
    kinds = packets.link[chosen]
    for link in np.flatnonzero(np.bincount(kinds)).tolist():
        own = np.flatnonzero(kinds == link)
        if link in _WITH_HARDWARE:
            _read_with_hardware(packets, own, *_WITH_HARDWARE[link], found)
        else:
            for is_ipv4, network in network_layers(packets, link, chosen[own]):
                place = replace(network, row=np.searchsorted(chosen, network.row))
                (_read_ipv4 if is_ipv4 else _read_ipv6)(packets, place, found)
    return found.take((found.hardware != 0) | found.has_ip)


def _read_with_hardware(packets: PacketBatch, rows: I64, layout: Layout, at: int, found: FrameAddresses) -> None:
    """Read what some rows of ``found`` are about."""
    captured = packets.captured[found.row[rows]]
    rows, captured = rows[captured >= layout.size_bytes], captured[captured >= layout.size_bytes]
    data, begin = packets.data, packets.offset[found.row[rows]]
    # Eight bytes that end with the address; the two in front of it belong to the same header.
    words = gather_bytes(data, begin + at - 2, 8).view(">u8").astype(np.uint64)
    found.hardware[rows] = words & _HARDWARE_MASK
    kind = layout.gather(data, begin)["type"].astype(np.uint16)
    network = Place(rows, begin + layout.size_bytes, begin + captured, np.zeros(len(rows), np.uint8))
    found.vlan[rows] = step_over_tags(data, network, kind)
    for ethertype, read in ((TYPE_IPV4, _read_ipv4), (TYPE_IPV6, _read_ipv6), (TYPE_ARP, _read_arp)):
        read(packets, network.take(kind == ethertype), found)


def _read_ipv4(packets: PacketBatch, network: Place, found: FrameAddresses) -> None:
    network = network.take(network.at + IPV4.size_bytes <= network.end)
    head = IPV4.gather(packets.data, network.at)
    good = (head["version_ihl"] >= 0x45) & (head["version_ihl"] <= 0x4F)
    head, row = take_rows(head, good), network.row[good]
    found.high[row], found.low[row] = IPV4_HIGH, head["source"].astype(np.uint64) | IPV4_LOW
    found.ttl[row] = head["ttl"]


def _read_ipv6(packets: PacketBatch, network: Place, found: FrameAddresses) -> None:
    network = network.take(network.at + IPV6.size_bytes <= network.end)
    head = IPV6.gather(packets.data, network.at)
    # Who asks whether an address is free has none: then nobody's time to live is told.
    good = (head["version"] >> 4 == 6) & ((head["source_hi"] != 0) | (head["source_lo"] != 0))
    head, row = take_rows(head, good), network.row[good]
    found.high[row], found.low[row] = head["source_hi"], head["source_lo"]
    found.ttl[row] = head["hop_limit"]


def _read_arp(packets: PacketBatch, network: Place, found: FrameAddresses) -> None:
    network = network.take(network.at + ARP.size_bytes <= network.end)
    head = ARP.gather(packets.data, network.at)
    good = head["sender"] != 0  # who only asks whether an address is free has none
    names = "hardware_type", "protocol", "hardware_bytes", "protocol_bytes"
    for name, expected in zip(names, _ARP_OVER_ETHERNET, strict=True):
        good &= head[name] == expected
    head, row = take_rows(head, good), network.row[good]
    found.high[row], found.low[row] = IPV4_HIGH, head["sender"].astype(np.uint64) | IPV4_LOW
    found.announces[row] = head["sender"] == head["target"]
    asks = (head["operation"] == _REQUEST) & (head["sender"] != head["target"])
    found.sought[row[asks]] = head["target"][asks].astype(np.uint64) | IPV4_LOW
    found.answers[row] = (head["operation"] != _REQUEST) & (head["sender"] != head["target"])
