"""Frames, and the UDP datagrams inside them, one at a time.

Link types: NULL, Ethernet (with any number of VLAN tags), RAW, LOOP, SLL, IPV4, IPV6, SLL2, as numbered in
capture files (https://www.tcpdump.org/linktypes.html). Anything that cannot be read is None.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from ipaddress import IPv4Address, IPv6Address
from typing import NamedTuple

Address = IPv4Address | IPv6Address

NULL, ETHERNET, RAW, LOOP, SLL, IPV4, IPV6, SLL2 = 0, 1, 101, 108, 113, 228, 229, 276

ETHERTYPE_IPV4, ETHERTYPE_IPV6 = 0x0800, 0x86DD
VLAN_TAGS = (0x8100, 0x88A8, 0x9100)
FAMILY_IPV4 = 2
FAMILIES_IPV6 = (24, 28, 30)

PROTOCOL_ICMP, PROTOCOL_UDP, PROTOCOL_ICMPV6 = 1, 17, 58
HOP_BY_HOP, ROUTING, FRAGMENT, AUTHENTICATION, DESTINATION_OPTIONS = 0, 43, 44, 51, 60

LIMITED_BROADCAST = IPv4Address("255.255.255.255")


class Frame(NamedTuple):
    """One captured frame: ``data`` is what was captured of its ``original`` bytes."""

    ts_ns: int
    link: int
    data: bytes
    original: int


@dataclass(frozen=True)
class Datagram:
    """A UDP datagram: ``length`` is that of its payload on the wire, ``payload`` what was captured of it."""

    source: Address
    destination: Address
    port: int
    length: int
    payload: bytes
    broadcast: bool
    source_port: int = field(default=0, compare=False)
    identification: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Unreachable:
    """An ICMP or ICMPv6 destination-unreachable, the datagram that it quotes, who sent it, and its code."""

    quoted: Datagram
    sender: Address
    code: int


class LinkHeader(NamedTuple):
    """What the link layer says: where IP starts, its version (None: told by the packet), and who it is for.

    ``broadcast`` is None where there is no link layer that could tell.
    """

    start: int
    version: int | None
    broadcast: bool | None


class InternetHeader(NamedTuple):
    """What the IP layer says: where its transport starts and ends among the captured bytes.

    ``identification`` is that of a header of IPv4 without options; 0 where it says nothing.
    """

    version: int
    source: Address
    destination: Address
    protocol: int
    start: int
    end: int
    identification: int = 0


@lru_cache
def ipv4_address(packed: bytes) -> IPv4Address:
    """Return an address, of the few that a capture has the same one each time."""
    return IPv4Address(packed)


@lru_cache
def ipv6_address(packed: bytes) -> IPv6Address:
    """Return an address, of the few that a capture has the same one each time."""
    return IPv6Address(packed)


def number(data: bytes, offset: int, size: int) -> int:
    """Read a big-endian number."""
    return int.from_bytes(data[offset : offset + size], "big")


def link_header(frame: Frame) -> LinkHeader | None:
    data = frame.data
    if frame.link in (RAW, IPV4, IPV6):
        return LinkHeader(0, {RAW: None, IPV4: 4, IPV6: 6}[frame.link], None)
    if frame.link in (NULL, LOOP):
        if len(data) < 4:
            return None
        families = {number(data, 0, 4)}
        if frame.link == NULL:
            families.add(int.from_bytes(data[:4], "little"))
        if FAMILY_IPV4 in families:
            return LinkHeader(4, 4, None)
        if families & set(FAMILIES_IPV6):
            return LinkHeader(4, 6, None)
        return None
    if frame.link == ETHERNET:
        start, protocol_at = 14, 12
    elif frame.link == SLL:
        start, protocol_at = 16, 14
    elif frame.link == SLL2:
        start, protocol_at = 20, 0
    else:
        return None
    if len(data) < start:
        return None
    if frame.link == ETHERNET:
        broadcast = bool(data[0] & 1)
    elif frame.link == SLL:
        broadcast = number(data, 0, 2) in (1, 2)
    else:
        broadcast = data[10] in (1, 2)
    protocol = number(data, protocol_at, 2)
    while protocol in VLAN_TAGS:
        if len(data) < start + 4:
            return None
        protocol = number(data, start + 2, 2)
        start += 4
    if protocol == ETHERTYPE_IPV4:
        return LinkHeader(start, 4, broadcast)
    if protocol == ETHERTYPE_IPV6:
        return LinkHeader(start, 6, broadcast)
    return None


def internet_header(data: bytes, start: int, end: int, version: int | None) -> InternetHeader | None:
    """Read the IP header at ``start``; a fragment is None, and so is another version than the one expected."""
    if start >= end:
        return None
    found = data[start] >> 4
    if version is not None and found != version:
        return None
    if found == 4:
        return ipv4_header(data, start, end)
    if found == 6:
        return ipv6_header(data, start, end)
    return None


def ipv4_header(data: bytes, start: int, end: int) -> InternetHeader | None:
    if end - start < 20:
        return None
    header_bytes = (data[start] & 0x0F) * 4
    if header_bytes < 20 or end - start < header_bytes:
        return None
    total_bytes = number(data, start + 2, 2)
    if total_bytes:
        end = min(end, start + total_bytes)
    more_fragments, fragment_offset = number(data, start + 6, 2) & 0x2000, number(data, start + 6, 2) & 0x1FFF
    if more_fragments or fragment_offset:
        return None
    source = ipv4_address(data[start + 12 : start + 16])
    destination = ipv4_address(data[start + 16 : start + 20])
    identification = number(data, start + 4, 2) if header_bytes == 20 else 0
    return InternetHeader(4, source, destination, data[start + 9], start + header_bytes, end, identification)


def ipv6_header(data: bytes, start: int, end: int) -> InternetHeader | None:
    if end - start < 40:
        return None
    payload_bytes = number(data, start + 4, 2)
    if payload_bytes:
        end = min(end, start + 40 + payload_bytes)
    source = ipv6_address(data[start + 8 : start + 24])
    destination = ipv6_address(data[start + 24 : start + 40])
    following, at = data[start + 6], start + 40
    while following in (HOP_BY_HOP, ROUTING, FRAGMENT, AUTHENTICATION, DESTINATION_OPTIONS):
        if end - at < 8:
            return None
        if following == FRAGMENT:
            if number(data, at + 2, 2) & 0xFFF9:
                return None
            size = 8
        elif following == AUTHENTICATION:
            size = (data[at + 1] + 2) * 4
        else:
            size = (data[at + 1] + 1) * 8
        following, at = data[at], at + size
    return InternetHeader(6, source, destination, following, at, end)


def datagram(data: bytes, header: InternetHeader, link_broadcast: bool | None) -> Datagram | None:
    at = header.start
    if header.protocol != PROTOCOL_UDP or header.end - at < 8:
        return None
    udp_length = number(data, at + 4, 2)
    if udp_length < 8:
        return None
    payload = data[at + 8 : min(header.end, at + udp_length)]
    broadcast = is_broadcast(header.destination, link_broadcast)
    port, source_port = number(data, at + 2, 2), number(data, at, 2)
    return Datagram(
        header.source, header.destination, port, udp_length - 8, payload, broadcast, source_port, header.identification
    )  # fmt: skip


def is_broadcast(destination: Address, link_broadcast: bool | None) -> bool:
    if destination.is_multicast or destination == LIMITED_BROADCAST:
        return True
    if link_broadcast is None:
        return destination.version == 4 and destination.packed[3] == 255
    return link_broadcast


def peel(frame: Frame) -> Datagram | Unreachable | None:
    """Return the UDP datagram of a frame, or the one that its destination-unreachable quotes, or None."""
    link = link_header(frame)
    if link is None:
        return None
    outer = internet_header(frame.data, link.start, len(frame.data), link.version)
    if outer is None:
        return None
    unreachable = (PROTOCOL_ICMP, 3) if outer.version == 4 else (PROTOCOL_ICMPV6, 1)
    if outer.end - outer.start >= 8 and (outer.protocol, frame.data[outer.start]) == unreachable:
        inner = internet_header(frame.data, outer.start + 8, outer.end, outer.version)
        quoted = inner and datagram(frame.data, inner, None)
        return Unreachable(quoted, outer.source, frame.data[outer.start + 1]) if quoted else None
    return datagram(frame.data, outer, link.broadcast)
