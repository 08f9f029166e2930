"""Link and network layers, peeled column-wise down to UDP datagrams and, where somebody asks for them, TCP segments.

Each layer is a table (``Layout``); a step gathers that table at the offsets that the step before has found and keeps
the rows that go on. Rows that do not are not lost: what is nothing here is one of the capture's other frames.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, U8, U16, U32, Bool, LinkType, PacketBatch
from dissectors.claims import NO_CLAIMS, Claims
from dissectors.headers import (
    AUTHENTICATION,
    DESTINATION_OPTIONS,
    ETHERNET,
    EXTENSION,
    FAMILIES_IPV6,
    FRAGMENT,
    HOP_BY_HOP,
    ICMP_HEADER_BYTES,
    IPV4,
    IPV4_HIGH,
    IPV4_LOW,
    IPV6,
    NULL,
    PROTOCOL_ICMP,
    PROTOCOL_ICMPV6,
    PROTOCOL_TCP,
    PROTOCOL_UDP,
    ROUTING,
    SLL,
    SLL2,
    TYPE_IPV4,
    TYPE_IPV6,
    UNREACHABLE_ICMP,
    UNREACHABLE_ICMPV6,
    VLAN,
    VLAN_TYPES,
)
from dissectors.layout import Layout, take_rows
from dissectors.transport import (
    GROUP_UNKNOWN,
    NO_DATAGRAMS,
    NO_QUOTED,
    NO_SEGMENTS,
    UNTOLD,
    DatagramBatch,
    IpPackets,
    Place,
    QuotedBatch,
    SegmentBatch,
    datagrams,
    segments,
)

LAYOUTS_WITH_TYPE: Mapping[int, Layout] = MappingProxyType(
    {LinkType.ETHERNET: ETHERNET, LinkType.LINUX_SLL: SLL, LinkType.LINUX_SLL2: SLL2}
)
"""Headers of link layers that tell by ``type`` what is inside: an EtherType, or what they have in its place."""

MAX_VLAN_TAGS = 8
MAX_EXTENSIONS = 16
_VLAN_MASK = 0xFFF


class Peeled(Struct, frozen=True):
    """What lies under the link layers of a packet batch.

    ``udp`` are the whole (not fragmented) UDP datagrams, ``quoted`` those that an ICMP destination-unreachable quotes
    (``row`` is the row of the ICMP message), ``tcp`` the whole TCP segments of claimed ports. ``fragments`` counts IP
    fragments; ``unsupported`` is a mask over the batch, set where the link type is one that nothing here reads, or None
    where there is no such frame.
    """

    udp: DatagramBatch
    quoted: QuotedBatch
    tcp: SegmentBatch
    fragments: int
    unsupported: Bool | None


NOTHING_PEELED = Peeled(NO_DATAGRAMS, NO_QUOTED, NO_SEGMENTS, 0, None)


class _Found(Struct):
    """What was found so far, by IP version and link type."""

    udp: list[DatagramBatch] = field(default_factory=list)
    quoted: list[QuotedBatch] = field(default_factory=list)
    tcp: list[SegmentBatch] = field(default_factory=list)


def peel(batch: PacketBatch, rows: I64 | None = None, claims: Claims = NO_CLAIMS) -> Peeled:
    """Find the UDP datagrams of a packet batch, or of some of its rows (rising), and those that ICMP messages quote.

    TCP segments are looked for where ``claims`` ask for some. Total: no bytes raise. What has a header that was not
    captured whole, or contradicts itself, is left out.
    """
    everything = np.arange(len(batch)) if rows is None else rows
    kinds = batch.link[everything]
    links = np.unique(kinds).tolist() if batch.single_link is None else [batch.single_link] * (len(everything) > 0)
    found = _Found()
    fragments = 0
    unsupported: Bool | None = None
    for link in links:
        mine = everything if len(links) == 1 else everything[kinds == link]
        for is_ipv4, network in network_layers(batch, link, mine):
            transport, in_fragments = ip_packets(batch.data, network, is_ipv4=is_ipv4)
            fragments += len(in_fragments)
            _peel_transport(batch, transport, claims, found)
        if link not in _LINK_READERS or (link == LinkType.DATABASE_ROW and batch.logged is None):
            unsupported = np.zeros(len(batch), np.bool_) if unsupported is None else unsupported
            unsupported[mine] = True
    return Peeled(
        DatagramBatch.joined(found.udp or [NO_DATAGRAMS]),
        QuotedBatch.joined(found.quoted or [NO_QUOTED]),
        SegmentBatch.joined(found.tcp or [NO_SEGMENTS]),
        fragments,
        unsupported,
    )


def network_layers(batch: PacketBatch, link: int, rows: I64) -> list[tuple[bool, Place]]:
    """Return the IPv4 and the IPv6 headers of the rows of one link type, where there are any."""
    reader = _LINK_READERS.get(link)
    if reader is None or not len(rows):
        return []
    at, captured = batch.offset, batch.captured
    if len(rows) != len(batch):
        at, captured = at[rows], captured[rows]
    return reader(batch.data, Place(rows, at, at + captured, np.empty(0, np.uint8)))


def _ethernet(data: U8, frame: Place) -> list[tuple[bool, Place]]:
    head = ETHERNET.gather(data, frame.at)
    return _by_ethertype(data, frame, head["type"].astype(np.uint16), head["group"] & np.uint8(1), ETHERNET.size_bytes)


def _sll(data: U8, frame: Place) -> list[tuple[bool, Place]]:
    head = SLL.gather(data, frame.at)
    group = ((head["packet_type"] == 1) | (head["packet_type"] == 2)).astype(np.uint8)
    return _by_ethertype(data, frame, head["type"].astype(np.uint16), group, SLL.size_bytes)


def _sll2(data: U8, frame: Place) -> list[tuple[bool, Place]]:
    head = SLL2.gather(data, frame.at)
    group = ((head["packet_type"] == 1) | (head["packet_type"] == 2)).astype(np.uint8)
    return _by_ethertype(data, frame, head["type"].astype(np.uint16), group, SLL2.size_bytes)


def _no_network(data: U8, frame: Place) -> list[tuple[bool, Place]]:
    """No network layer: ``dissectors.can.frame`` reads these frames, ``dissectors.datalogger.rows`` these rows."""
    return []


def _null(data: U8, frame: Place) -> list[tuple[bool, Place]]:
    family = NULL.gather(data, frame.at)["family"].astype(np.uint32)
    return _by_family(frame, np.where(family > 0xFFFF, family.byteswap(), family))


def _loop(data: U8, frame: Place) -> list[tuple[bool, Place]]:
    return _by_family(frame, NULL.gather(data, frame.at)["family"].astype(np.uint32).byteswap())


def _by_family(frame: Place, family: U32) -> list[tuple[bool, Place]]:
    inside = _without_link(frame, NULL.size_bytes)
    return [(True, inside.take(family == 2)), (False, inside.take(np.isin(family, FAMILIES_IPV6)))]


def _raw(data: U8, frame: Place) -> list[tuple[bool, Place]]:
    version = data[frame.at] >> 4
    inside = _without_link(frame, 0)
    return [(True, inside.take(version == 4)), (False, inside.take(version == 6))]


def _raw_ipv4(data: U8, frame: Place) -> list[tuple[bool, Place]]:
    return [(True, _without_link(frame, 0))]


def _raw_ipv6(data: U8, frame: Place) -> list[tuple[bool, Place]]:
    return [(False, _without_link(frame, 0))]


def _without_link(frame: Place, head_bytes: int) -> Place:
    group = np.full(len(frame.row), GROUP_UNKNOWN, np.uint8)
    return Place(frame.row, frame.at + head_bytes, frame.end, group)


_LINK_READERS: dict[int, Callable[[U8, Place], list[tuple[bool, Place]]]] = {
    LinkType.ETHERNET: _ethernet,
    LinkType.LINUX_SLL: _sll,
    LinkType.LINUX_SLL2: _sll2,
    LinkType.CAN_SOCKETCAN: _no_network,
    LinkType.DATABASE_ROW: _no_network,
    LinkType.NULL: _null,
    LinkType.LOOP: _loop,
    LinkType.RAW: _raw,
    LinkType.IPV4: _raw_ipv4,
    LinkType.IPV6: _raw_ipv6,
}


def _by_ethertype(data: U8, frame: Place, kind: U16, group: U8, head_bytes: int) -> list[tuple[bool, Place]]:
    """Step over VLAN tags and part the rows into IPv4 and IPv6."""
    inside = Place(frame.row, frame.at + head_bytes, frame.end, group)
    is_ipv4 = kind == TYPE_IPV4
    if is_ipv4.all():
        return [(True, inside)]
    step_over_tags(data, inside, kind)
    return [(True, inside.take(kind == TYPE_IPV4)), (False, inside.take(kind == TYPE_IPV6))]


def step_over_tags(data: U8, inside: Place, kind: U16) -> I64:
    """Move ``inside.at`` and ``kind`` behind VLAN tags; return the number in the outermost one, -1 without any."""
    vlan = np.full(len(kind), -1)
    for _ in range(MAX_VLAN_TAGS):
        tagged = np.flatnonzero(np.isin(kind, VLAN_TYPES) & (inside.at + VLAN.size_bytes <= inside.end))
        if not len(tagged):
            break
        tag = VLAN.gather(data, inside.at[tagged])
        vlan[tagged] = np.where(vlan[tagged] < 0, tag["tci"] & _VLAN_MASK, vlan[tagged])
        kind[tagged] = tag["type"]
        inside.at[tagged] += VLAN.size_bytes
    return vlan


def _with_room(network: Place, size_bytes: int) -> Place:
    """Keep the rows with room for a header, without copying where all have it."""
    room = network.at + size_bytes <= network.end
    return network if room.all() else network.take(room)


def ip_packets(data: U8, network: Place, *, is_ipv4: bool) -> tuple[IpPackets, I64]:
    """Return the whole IP packets of rows at the start of an IP header, and the rows of those that are fragments.

    Rows whose header was not captured whole, or contradicts itself, are in neither.
    """
    return (_ipv4 if is_ipv4 else _ipv6)(data, network)


def _ipv4(data: U8, network: Place) -> tuple[IpPackets, I64]:
    network = _with_room(network, IPV4.size_bytes)
    head = IPV4.gather(data, network.at)
    version_ihl = head["version_ihl"]
    fragment = (head["fragment"] & 0x3FFF) != 0
    header_bytes = (version_ihl & 15).astype(np.int64) * 4
    total = head["total_length"].astype(np.int64)
    good = (version_ihl >= 0x45) & (version_ihl <= 0x4F)
    fragments = network.row[fragment & good]
    good &= ~fragment
    good &= (total >= header_bytes) | (total == 0)
    if not good.all():
        head = take_rows(head, good)
        network, header_bytes, total = network.take(good), header_bytes[good], total[good]
    stop = np.where(total == 0, UNTOLD, network.at + total)
    end = np.where(total == 0, network.end, np.minimum(network.end, stop))
    inside = Place(network.row, network.at + header_bytes, end, network.group)
    high = np.broadcast_to(IPV4_HIGH, (len(head),))
    source = head["source"].astype(np.uint64) | IPV4_LOW
    destination = head["destination"].astype(np.uint64) | IPV4_LOW
    return IpPackets(inside, stop, head["protocol"], high, source, high, destination, True), fragments


def _ipv6(data: U8, network: Place) -> tuple[IpPackets, I64]:
    network = _with_room(network, IPV6.size_bytes)
    head = IPV6.gather(data, network.at)
    version_good = (head["version"] >> 4) == 6
    if not version_good.all():
        network, head = network.take(version_good), take_rows(head, version_good)
    length = head["payload_length"].astype(np.int64)
    at = network.at + IPV6.size_bytes
    stop = np.where(length == 0, UNTOLD, at + length)
    end = np.where(length == 0, network.end, np.minimum(network.end, stop))
    protocol = head["next"].copy()
    alive = np.ones(len(protocol), np.bool_)
    in_fragment = np.zeros(len(protocol), np.bool_)
    for _ in range(MAX_EXTENSIONS):
        extended = np.isin(protocol, (HOP_BY_HOP, ROUTING, FRAGMENT, AUTHENTICATION, DESTINATION_OPTIONS)) & alive
        alive &= ~extended | (at + 8 <= end)
        rows = np.flatnonzero(extended & alive)
        if not len(rows):
            break
        extension = EXTENSION.gather(data, at[rows])
        kind = protocol[rows]
        # A fragment header whose offset and more-fragments bit are 0 holds the whole datagram (RFC 6946).
        fragment = (kind == FRAGMENT) & ((extension["fragment"] & 0xFFF9) != 0)
        in_fragment[rows[fragment]] = True
        alive[rows[fragment]] = False
        units = extension["length"].astype(np.int64)
        size = np.where(kind == FRAGMENT, 8, np.where(kind == AUTHENTICATION, (units + 2) * 4, (units + 1) * 8))
        at[rows] += size
        protocol[rows] = extension["next"]
    inside = Place(network.row, at, end, network.group)
    source_hi, source_lo = head["source_hi"].astype(np.uint64), head["source_lo"].astype(np.uint64)
    to_hi, to_lo = head["destination_hi"].astype(np.uint64), head["destination_lo"].astype(np.uint64)
    whole = IpPackets(inside, stop, protocol, source_hi, source_lo, to_hi, to_lo, False)
    return whole.take(alive), network.row[in_fragment]


def _peel_transport(batch: PacketBatch, ip: IpPackets, claims: Claims, found: _Found) -> None:
    """Sort the packets of one IP version into UDP datagrams, quoted ones, and TCP segments that are asked for."""
    data = batch.data
    is_udp = ip.protocol == PROTOCOL_UDP
    if is_udp.all():
        found.udp.append(datagrams(data, ip))
        return
    found.udp.append(datagrams(data, ip.take(is_udp)))
    if claims.tcp:
        segment = segments(data, ip.take(ip.protocol == PROTOCOL_TCP), batch.offset + batch.original)
        found.tcp.append(segment.take(claims.claim_tcp(segment.source_port, segment.destination_port)))
    icmp, unreachable = (PROTOCOL_ICMP, UNREACHABLE_ICMP) if ip.is_ipv4 else (PROTOCOL_ICMPV6, UNREACHABLE_ICMPV6)
    messages = ip.take(ip.protocol == icmp).with_room(ICMP_HEADER_BYTES)
    messages = messages.take(data[messages.place.at] == unreachable)
    if not len(messages.protocol):
        return
    message = messages.place
    quote = Place(message.row, message.at + ICMP_HEADER_BYTES, message.end, message.group)
    inner, _ = ip_packets(data, quote, is_ipv4=ip.is_ipv4)
    quoted = datagrams(data, inner.take(inner.protocol == PROTOCOL_UDP))
    own = np.searchsorted(message.row, quoted.row)
    found.quoted.append(
        QuotedBatch(
            **{name: getattr(quoted, name) for name in DatagramBatch.__match_args__},
            by_hi=messages.source_hi[own], by_lo=messages.source_lo[own], code=data[message.at[own] + 1],
        )
    )  # fmt: skip
