"""Frames in which no protocol was found that is looked for: what they are, and from whom to whom they went.

They are peeled with the same tables and steps as ``dissectors.link``; nothing is left out here: a frame that stops
being readable at some layer is a frame of the layer above it, with a fault.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.arp import NO_ARP, ArpBatch, read_arp
from dissectors.batch import I64, U8, Bool, PacketBatch
from dissectors.columns import Columns
from dissectors.headers import (
    IPV4,
    IPV4_HIGH,
    IPV4_LOW,
    IPV6,
    PROTOCOL_ICMP,
    PROTOCOL_ICMPV6,
    PROTOCOL_TCP,
    PROTOCOL_UDP,
    TYPE_ARP,
    TYPE_IPV4,
    TYPE_IPV6,
    VLAN_TYPES,
)
from dissectors.icmp import NO_ICMP, IcmpBatch, read_icmp
from dissectors.layout import take_rows
from dissectors.link import LAYOUTS_WITH_TYPE, ip_packets, network_layers, step_over_tags
from dissectors.transport import (
    NO_DATAGRAMS,
    NO_SEGMENTS,
    DatagramBatch,
    IpEnds,
    IpPackets,
    Place,
    SegmentBatch,
    datagrams,
    segments,
)

UNKNOWN = -1
"""In place of an EtherType or an IP protocol that a frame does not have."""

LEAST_TYPE = 0x600
"""From here on, the number behind the addresses of Ethernet is a type; below it is a length (IEEE 802.3)."""


class FrameKind(IntEnum):
    """The innermost layer that was recognised."""

    LINK = 0
    TYPE = 1
    ARP = 2
    IP = 3
    FRAGMENT = 4
    UDP = 5
    TCP = 6
    ICMP = 7
    ICMPV6 = 8


class OtherBatch(Columns, Struct, frozen=True):
    """One row a frame, in the order of the packet batch.

    ``row`` is its row there, ``kind`` a ``FrameKind`` (uint8). ``ethertype`` is the type behind VLAN tags, or what a
    link layer has in its place, ``version`` 4, 6 or 0 (uint8), ``protocol`` what is inside IP, both ``UNKNOWN`` where
    nothing tells. The innermost layer lies from ``at`` up to ``end``, as far as it was captured: absolute offsets.
    ``fault`` is set where its header was cut off or contradicts itself. int64 unless said otherwise.
    """

    row: I64
    kind: U8
    ethertype: I64
    version: U8
    protocol: I64
    at: I64
    end: I64
    fault: Bool


class OtherFrames(Struct, frozen=True):
    """Some frames of a packet batch, and what was found in them; each part is in the order of the batch."""

    frames: OtherBatch
    ends: IpEnds
    arp: ArpBatch
    icmp: IcmpBatch
    icmpv6: IcmpBatch
    udp: DatagramBatch
    tcp: SegmentBatch


def read_other_frames(packets: PacketBatch, rows: I64) -> OtherFrames:
    """Read some frames of a batch, rising, which has a margin (``PacketBatch.with_margin``). Total: no bytes raise."""
    reader = _Reader(packets, rows)
    links = packets.link[rows]
    for link in np.unique(links).tolist():
        reader.read(link, np.flatnonzero(links == link))
    return reader.found()


class _Reader:
    """Reads frames link type by link type; within it, the row of a frame is its position among ``rows``."""

    def __init__(self, packets: PacketBatch, rows: I64) -> None:
        count = len(rows)
        self._packets, self._rows = packets, rows
        begin = packets.offset[rows]
        self._frames = OtherBatch(
            rows, np.zeros(count, np.uint8), np.full(count, UNKNOWN), np.zeros(count, np.uint8),
            np.full(count, UNKNOWN), begin.copy(), begin + packets.captured[rows], np.zeros(count, np.bool_),
        )  # fmt: skip
        self._parts: dict[str, list[Any]] = {}

    def read(self, link: int, position: I64) -> None:
        """Read the frames at some positions, which are of one link type."""
        layout = LAYOUTS_WITH_TYPE.get(link)
        if layout is None:
            for is_ipv4, network in network_layers(self._packets, link, self._rows[position]):
                row = np.searchsorted(self._rows, network.row)
                self._read_ip(replace(network, row=row), is_ipv4=is_ipv4)
            return
        frames, data = self._frames, self._packets.data
        whole = frames.at[position] + layout.size_bytes <= frames.end[position]
        frames.fault[position[~whole]] = True
        position = position[whole]
        begin = frames.at[position]
        kind = layout.gather(data, begin)["type"].astype(np.uint16)
        group = np.zeros(len(position), np.uint8)
        inside = Place(position, begin + layout.size_bytes, frames.end[position], group)
        step_over_tags(data, inside, kind)
        self._reach(FrameKind.TYPE, inside, fault=np.isin(kind, VLAN_TYPES))
        frames.ethertype[position] = kind
        self._read_ip(inside.take(kind == TYPE_IPV4), is_ipv4=True)
        self._read_ip(inside.take(kind == TYPE_IPV6), is_ipv4=False)
        asked = inside.take(kind == TYPE_ARP)
        self._reach(FrameKind.ARP, asked, fault=True)
        arp = read_arp(data, asked)
        frames.fault[arp.row] = arp.target_ip_at + arp.protocol_bytes > arp.end
        self._add("arp", arp)

    def found(self) -> OtherFrames:
        """Return all that was read."""
        return OtherFrames(
            self._frames, self._part("ends", IpEnds, _NO_ENDS), self._part("arp", ArpBatch, NO_ARP),
            self._part("icmp", IcmpBatch, NO_ICMP), self._part("icmpv6", IcmpBatch, NO_ICMP),
            self._part("udp", DatagramBatch, NO_DATAGRAMS), self._part("tcp", SegmentBatch, NO_SEGMENTS),
        )  # fmt: skip

    def _add(self, name: str, part: Any) -> None:
        if len(part):
            self._parts.setdefault(name, []).append(part)

    def _part(self, name: str, made: type[Columns], nothing: Any) -> Any:
        """Return the parts of a name as one, in the order of the batch, whose rows are those of the packets."""
        if name not in self._parts:
            return nothing
        whole: Any = made.stacked(self._parts[name])
        whole = whole.take(np.argsort(whole.row, kind="stable"))
        kept = [getattr(whole, name) for name in made.__match_args__[1:]]
        returned: Callable[..., Any] = made
        return returned(self._rows[whole.row], *kept)

    def _reach(self, kind: FrameKind, place: Place, *, fault: bool | Bool) -> None:
        """Enter that some frames reach as far as a layer of this kind."""
        frames, row = self._frames, place.row
        frames.kind[row], frames.at[row], frames.end[row] = kind, np.minimum(place.at, place.end), place.end
        frames.fault[row] = fault

    def _read_ip(self, network: Place, *, is_ipv4: bool) -> None:
        if not len(network.row):
            return
        frames, data = self._frames, self._packets.data
        self._reach(FrameKind.IP, network, fault=True)
        frames.version[network.row] = 4 if is_ipv4 else 6
        self._add("ends", self._ends(network, is_ipv4=is_ipv4))
        ip, fragments = ip_packets(data, network, is_ipv4=is_ipv4)
        frames.kind[fragments], frames.fault[fragments] = FrameKind.FRAGMENT, False
        frames.at[fragments] += (IPV4 if is_ipv4 else IPV6).size_bytes
        row, protocol = ip.place.row, ip.protocol
        frames.protocol[row] = protocol
        self._reach(FrameKind.IP, ip.place, fault=ip.place.at > ip.place.end)
        for number, kind, name, read in (
            (PROTOCOL_UDP, FrameKind.UDP, "udp", datagrams),
            (PROTOCOL_TCP, FrameKind.TCP, "tcp", self._segments),
            (PROTOCOL_ICMP, FrameKind.ICMP, "icmp", _icmp) if is_ipv4 else (
                PROTOCOL_ICMPV6, FrameKind.ICMPV6, "icmpv6", _icmp
            ),
        ):  # fmt: skip
            own = ip.take(protocol == number)
            self._read_transport(own, kind, name, read)

    def _read_transport(self, ip: IpPackets, kind: FrameKind, name: str, read: Callable[[U8, IpPackets], Any]) -> None:
        if not len(ip.protocol):
            return
        self._reach(kind, ip.place, fault=True)
        part = read(self._packets.data, ip)
        self._frames.fault[part.row] = False
        self._add(name, part)

    def _segments(self, data: U8, ip: IpPackets) -> SegmentBatch:
        return segments(data, ip, self._packets.offset + self._packets.original)

    def _ends(self, network: Place, *, is_ipv4: bool) -> IpEnds:
        """Return from where to where packets went, fragments too; and enter what fragments are of."""
        data, layout = self._packets.data, IPV4 if is_ipv4 else IPV6
        network = network.take(network.at + layout.size_bytes <= network.end)
        head = layout.gather(data, network.at)
        if is_ipv4:
            good = (head["version_ihl"] >= 0x45) & (head["version_ihl"] <= 0x4F)
            head, row = take_rows(head, good), network.row[good]
            self._frames.protocol[row] = head["protocol"]
            high = np.full(len(row), IPV4_HIGH)
            source, destination = (head[name].astype(np.uint64) | IPV4_LOW for name in ("source", "destination"))
            return IpEnds(row, high, source, high, destination)
        good = head["version"] >> 4 == 6
        head, row = take_rows(head, good), network.row[good]
        halves = ("source_hi", "source_lo", "destination_hi", "destination_lo")
        return IpEnds(row, *(head[name].astype(np.uint64) for name in halves))


def _icmp(data: U8, ip: IpPackets) -> IcmpBatch:
    return read_icmp(data, ip.place)


_NO_ENDS = IpEnds(np.empty(0, np.int64), *[np.empty(0, np.uint64)] * 4)
