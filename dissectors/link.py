"""Link, network and transport layers, peeled column-wise down to the UDP payloads.

Each layer is a table (``Layout``); a step gathers that table at the offsets that the step before has found and keeps
the rows that go on. Rows that do not are not lost: what is no UDP datagram here is one of the capture's other frames.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from dissectors.batch import I64, U8, U16, U32, U64, Bool, LinkType, PacketBatch
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
    PROTOCOL_UDP,
    ROUTING,
    SLL,
    SLL2,
    TYPE_IPV4,
    TYPE_IPV6,
    UDP,
    UNREACHABLE_ICMP,
    UNREACHABLE_ICMPV6,
    VLAN,
    VLAN_TYPES,
)
from dissectors.layout import take_rows

MAX_VLAN_TAGS = 8
MAX_EXTENSIONS = 16
GROUP_UNKNOWN = 2
"""Value of the group column where no link layer tells whether a frame was a broadcast."""


@dataclass(frozen=True, slots=True)
class DatagramBatch:
    """UDP datagrams of a packet batch, in its order; also those that hold telegrams only (``dissectors.netvar``).

    ``row`` is the row of the packet; ``payload`` the absolute offset of the UDP payload in the batch's buffer, int64.
    ``payload_bytes`` is the length that the UDP header tells, ``captured_bytes`` how much of it was captured.
    Addresses are two uint64 halves each, IPv4 ones as in ``IPV4_HIGH``; ports uint16; ``broadcast`` bool.
    All columns have shape (n,).
    """

    row: I64
    payload: I64
    payload_bytes: I64
    captured_bytes: I64
    source_hi: U64
    source_lo: U64
    destination_hi: U64
    destination_lo: U64
    source_port: U16
    destination_port: U16
    broadcast: Bool

    def __len__(self) -> int:
        return len(self.row)

    def take(self, rows: I64 | Bool) -> DatagramBatch:
        """Return the datagrams at the given positions or where the mask is set."""
        return DatagramBatch(*(getattr(self, column.name)[rows] for column in fields(self)))

    @classmethod
    def joined(cls, parts: list[DatagramBatch]) -> DatagramBatch:
        """Return several batches of one buffer as one, in the order of the packets."""
        if len(parts) == 1:
            return parts[0]
        whole = cls(*(np.concatenate([getattr(part, c.name) for part in parts]) for c in fields(cls)))
        return whole.take(np.argsort(whole.row, kind="stable"))


@dataclass(frozen=True, slots=True)
class Peeled:
    """What lies under the link layers of a packet batch.

    ``udp`` are the whole (not fragmented) UDP datagrams, ``quoted`` those that an ICMP destination-unreachable quotes
    (``row`` is the row of the ICMP message). ``fragments`` counts IP fragments; ``unsupported`` is a mask over the
    batch, set where the link type is one that nothing here reads, or None where there is no such frame.
    """

    udp: DatagramBatch
    quoted: DatagramBatch
    fragments: int
    unsupported: Bool | None


@dataclass(frozen=True, slots=True)
class _Network:
    """Rows at the start of an IP header: absolute offsets of the header and of the end of what was captured."""

    row: I64
    at: I64
    end: I64
    group: U8

    def take(self, rows: I64 | Bool) -> _Network:
        return _Network(self.row[rows], self.at[rows], self.end[rows], self.group[rows])


@dataclass(frozen=True, slots=True)
class _Transport:
    """Rows at the start of a transport header, with what the IP header said."""

    network: _Network
    protocol: U8
    source_hi: U64
    source_lo: U64
    destination_hi: U64
    destination_lo: U64
    is_ipv4: bool

    def take(self, rows: I64 | Bool) -> _Transport:
        return _Transport(
            self.network.take(rows), self.protocol[rows], self.source_hi[rows], self.source_lo[rows],
            self.destination_hi[rows], self.destination_lo[rows], self.is_ipv4,
        )  # fmt: skip


def peel(batch: PacketBatch, rows: I64 | None = None) -> Peeled:
    """Find the UDP datagrams of a packet batch, or of some of its rows (rising), and those that ICMP messages quote.

    Total: no bytes raise. A datagram whose header was not captured whole, or contradicts itself, is left out.
    """
    everything = np.arange(len(batch)) if rows is None else rows
    kinds = batch.link[everything]
    links = np.unique(kinds).tolist() if batch.single_link is None else [batch.single_link] * (len(everything) > 0)
    udp: list[DatagramBatch] = []
    quoted: list[DatagramBatch] = []
    fragments = 0
    unsupported: Bool | None = None
    for link in links:
        mine = everything if len(links) == 1 else everything[kinds == link]
        for is_ipv4, network in _network_layers(batch, link, mine):
            transport, fragment_count = (_ipv4 if is_ipv4 else _ipv6)(batch.data, network)
            fragments += fragment_count
            _peel_transport(batch.data, transport, udp, quoted)
        if link not in _LINK_READERS:
            unsupported = np.zeros(len(batch), np.bool_) if unsupported is None else unsupported
            unsupported[mine] = True
    return Peeled(
        DatagramBatch.joined(udp or [NO_DATAGRAMS]),
        DatagramBatch.joined(quoted or [NO_DATAGRAMS]),
        fragments,
        unsupported,
    )


def _network_layers(batch: PacketBatch, link: int, rows: I64) -> list[tuple[bool, _Network]]:
    """Return the IPv4 and the IPv6 headers of the rows of one link type, where there are any."""
    reader = _LINK_READERS.get(link)
    if reader is None or not len(rows):
        return []
    at, captured = batch.offset, batch.captured
    if len(rows) != len(batch):
        at, captured = at[rows], captured[rows]
    return reader(batch.data, _Network(rows, at, at + captured, np.empty(0, np.uint8)))


def _ethernet(data: U8, frame: _Network) -> list[tuple[bool, _Network]]:
    head = ETHERNET.gather(data, frame.at)
    return _by_ethertype(data, frame, head["type"].astype(np.uint16), head["group"] & np.uint8(1), ETHERNET.size_bytes)


def _sll(data: U8, frame: _Network) -> list[tuple[bool, _Network]]:
    head = SLL.gather(data, frame.at)
    group = ((head["packet_type"] == 1) | (head["packet_type"] == 2)).astype(np.uint8)
    return _by_ethertype(data, frame, head["type"].astype(np.uint16), group, SLL.size_bytes)


def _sll2(data: U8, frame: _Network) -> list[tuple[bool, _Network]]:
    head = SLL2.gather(data, frame.at)
    group = ((head["packet_type"] == 1) | (head["packet_type"] == 2)).astype(np.uint8)
    return _by_ethertype(data, frame, head["type"].astype(np.uint16), group, SLL2.size_bytes)


def _can(data: U8, frame: _Network) -> list[tuple[bool, _Network]]:
    """No network layer: ``dissectors.can.frame`` reads these frames."""
    return []


def _null(data: U8, frame: _Network) -> list[tuple[bool, _Network]]:
    family = NULL.gather(data, frame.at)["family"].astype(np.uint32)
    return _by_family(frame, np.where(family > 0xFFFF, family.byteswap(), family))


def _loop(data: U8, frame: _Network) -> list[tuple[bool, _Network]]:
    return _by_family(frame, NULL.gather(data, frame.at)["family"].astype(np.uint32).byteswap())


def _by_family(frame: _Network, family: U32) -> list[tuple[bool, _Network]]:
    inside = _without_link(frame, NULL.size_bytes)
    return [(True, inside.take(family == 2)), (False, inside.take(np.isin(family, FAMILIES_IPV6)))]


def _raw(data: U8, frame: _Network) -> list[tuple[bool, _Network]]:
    version = data[frame.at] >> 4
    inside = _without_link(frame, 0)
    return [(True, inside.take(version == 4)), (False, inside.take(version == 6))]


def _raw_ipv4(data: U8, frame: _Network) -> list[tuple[bool, _Network]]:
    return [(True, _without_link(frame, 0))]


def _raw_ipv6(data: U8, frame: _Network) -> list[tuple[bool, _Network]]:
    return [(False, _without_link(frame, 0))]


def _without_link(frame: _Network, head_bytes: int) -> _Network:
    group = np.full(len(frame.row), GROUP_UNKNOWN, np.uint8)
    return _Network(frame.row, frame.at + head_bytes, frame.end, group)


_LINK_READERS: dict[int, Callable[[U8, _Network], list[tuple[bool, _Network]]]] = {
    LinkType.ETHERNET: _ethernet,
    LinkType.LINUX_SLL: _sll,
    LinkType.LINUX_SLL2: _sll2,
    LinkType.CAN_SOCKETCAN: _can,
    LinkType.NULL: _null,
    LinkType.LOOP: _loop,
    LinkType.RAW: _raw,
    LinkType.IPV4: _raw_ipv4,
    LinkType.IPV6: _raw_ipv6,
}


def _by_ethertype(data: U8, frame: _Network, kind: U16, group: U8, head_bytes: int) -> list[tuple[bool, _Network]]:
    """Step over VLAN tags and part the rows into IPv4 and IPv6."""
    inside = _Network(frame.row, frame.at + head_bytes, frame.end, group)
    is_ipv4 = kind == TYPE_IPV4
    if is_ipv4.all():
        return [(True, inside)]
    for _ in range(MAX_VLAN_TAGS):
        tagged = np.flatnonzero(np.isin(kind, VLAN_TYPES) & (inside.at + VLAN.size_bytes <= inside.end))
        if not len(tagged):
            break
        kind[tagged] = VLAN.gather(data, inside.at[tagged])["type"]
        inside.at[tagged] += VLAN.size_bytes
    return [(True, inside.take(kind == TYPE_IPV4)), (False, inside.take(kind == TYPE_IPV6))]


def _with_room(network: _Network, size_bytes: int) -> _Network:
    """Keep the rows with room for a header, without copying where all have it."""
    room = network.at + size_bytes <= network.end
    return network if room.all() else network.take(room)


def _ipv4(data: U8, network: _Network) -> tuple[_Transport, int]:
    network = _with_room(network, IPV4.size_bytes)
    head = IPV4.gather(data, network.at)
    version_ihl = head["version_ihl"]
    fragment = (head["fragment"] & 0x3FFF) != 0
    header_bytes = (version_ihl & 15).astype(np.int64) * 4
    total = head["total_length"].astype(np.int64)
    good = (version_ihl >= 0x45) & (version_ihl <= 0x4F)
    fragments = int(np.count_nonzero(fragment & good))
    good &= ~fragment
    good &= (total >= header_bytes) | (total == 0)
    if not good.all():
        head = take_rows(head, good)
        network, header_bytes, total = network.take(good), header_bytes[good], total[good]
    end = np.minimum(network.end, np.where(total == 0, network.end, network.at + total))
    inside = _Network(network.row, network.at + header_bytes, end, network.group)
    high = np.broadcast_to(IPV4_HIGH, (len(head),))
    source = head["source"].astype(np.uint64) | IPV4_LOW
    destination = head["destination"].astype(np.uint64) | IPV4_LOW
    return _Transport(inside, head["protocol"], high, source, high, destination, True), fragments


def _ipv6(data: U8, network: _Network) -> tuple[_Transport, int]:
    network = _with_room(network, IPV6.size_bytes)
    head = IPV6.gather(data, network.at)
    version_good = (head["version"] >> 4) == 6
    if not version_good.all():
        network, head = network.take(version_good), take_rows(head, version_good)
    length = head["payload_length"].astype(np.int64)
    at = network.at + IPV6.size_bytes
    end = np.minimum(network.end, np.where(length == 0, network.end, at + length))
    protocol = head["next"].copy()
    alive = np.ones(len(protocol), np.bool_)
    fragments = 0
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
        fragments += int(np.count_nonzero(fragment))
        alive[rows[fragment]] = False
        units = extension["length"].astype(np.int64)
        size = np.where(kind == FRAGMENT, 8, np.where(kind == AUTHENTICATION, (units + 2) * 4, (units + 1) * 8))
        at[rows] += size
        protocol[rows] = extension["next"]
    inside = _Network(network.row, at, end, network.group)
    source_hi, source_lo = head["source_hi"].astype(np.uint64), head["source_lo"].astype(np.uint64)
    to_hi, to_lo = head["destination_hi"].astype(np.uint64), head["destination_lo"].astype(np.uint64)
    return _Transport(inside, protocol, source_hi, source_lo, to_hi, to_lo, False).take(alive), fragments


def _peel_transport(data: U8, ip: _Transport, udp: list[DatagramBatch], quoted: list[DatagramBatch]) -> None:
    """Sort the rows of one IP version into UDP datagrams and quoted ones."""
    is_udp = ip.protocol == PROTOCOL_UDP
    if is_udp.all():
        udp.append(_udp(data, ip))
        return
    udp.append(_udp(data, ip.take(is_udp)))
    icmp, unreachable = (PROTOCOL_ICMP, UNREACHABLE_ICMP) if ip.is_ipv4 else (PROTOCOL_ICMPV6, UNREACHABLE_ICMPV6)
    message = ip.network.take(ip.protocol == icmp)
    message = message.take(message.at + ICMP_HEADER_BYTES <= message.end)
    message = message.take(data[message.at] == unreachable)
    if not len(message.row):
        return
    quote = _Network(message.row, message.at + ICMP_HEADER_BYTES, message.end, message.group)
    inner, _ = (_ipv4 if ip.is_ipv4 else _ipv6)(data, quote)
    quoted.append(_udp(data, inner.take(inner.protocol == PROTOCOL_UDP)))


def _udp(data: U8, ip: _Transport) -> DatagramBatch:
    fits = ip.network.at + UDP.size_bytes <= ip.network.end
    if not fits.all():
        ip = ip.take(fits)
    head = UDP.gather(data, ip.network.at)
    length = head["length"].astype(np.int64)
    whole = length >= UDP.size_bytes
    if not whole.all():
        ip, head, length = ip.take(whole), take_rows(head, whole), length[whole]
    payload = ip.network.at + UDP.size_bytes
    payload_bytes = length - UDP.size_bytes
    captured_bytes = np.minimum(ip.network.end - payload, payload_bytes)
    return DatagramBatch(
        ip.network.row, payload, payload_bytes, captured_bytes,
        ip.source_hi, ip.source_lo, ip.destination_hi, ip.destination_lo,
        head["source_port"].astype(np.uint16), head["destination_port"].astype(np.uint16), _broadcast(ip),
    )  # fmt: skip


def _broadcast(ip: _Transport) -> Bool:
    """Tell which datagrams went to everybody (by the link layer's word or by the address)."""
    if ip.is_ipv4:
        return broadcast_ipv4(ip.network.group, ip.destination_lo)
    told: Bool = ip.network.group == 1
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


def _none() -> DatagramBatch:
    empty = {"row": np.int64, "payload": np.int64, "payload_bytes": np.int64, "captured_bytes": np.int64}
    ports = {"source_port": np.uint16, "destination_port": np.uint16, "broadcast": np.bool_}
    types = empty | ports
    return DatagramBatch(**{c.name: np.empty(0, types.get(c.name, np.uint64)) for c in fields(DatagramBatch)})


NO_DATAGRAMS = _none()
