"""The builders of single telegrams, packets and frames."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from ipaddress import ip_address

from tests.oracle.frame import (
    AUTHENTICATION,
    ETHERNET,
    FRAGMENT,
    IPV4,
    IPV6,
    LOOP,
    NULL,
    PROTOCOL_ICMP,
    PROTOCOL_ICMPV6,
    PROTOCOL_UDP,
    RAW,
    ROUTING,
    SLL,
    SLL2,
    Address,
    Frame,
)

SECOND = 1_000_000_000
MILLISECOND = 1_000_000
START = 1_700_000_000 * SECOND
LINKS = (NULL, ETHERNET, RAW, LOOP, SLL, IPV4, IPV6, SLL2)

IDENTITY = b"\x00-S3"
DATA, ACKNOWLEDGEMENT, BOOT_UP_REQUEST = 0, 5, 6


def telegram(
    service: int = DATA,
    list_id: int = 1,
    subindex: int = 0,
    *,
    items: int = 1,
    counter: int = 1,
    flags: int = 0,
    checksum: int = 0,
    data: bytes = b"\0\0",
    length: int | None = None,
    identity: bytes = IDENTITY,
) -> bytes:
    """Return the bytes of a telegram; Length fits unless one is given."""
    length = 20 + len(data) if length is None else length
    return (
        identity
        + struct.pack("<IHHHHHBB", service, list_id, subindex, items, length & 0xFFFF, counter, flags, checksum)
        + data
    )


def internet_packet(
    source: Address,
    destination: Address,
    protocol: int,
    content: bytes,
    *,
    options: bytes = b"",
    extensions: Sequence[int] = (),
    fragment: tuple[int, bool] | None = None,
    total_length: int | None = None,
    identification: int = 0,
) -> bytes:
    """Wrap a transport segment in IPv4 or IPv6.

    ``options`` (multiples of 4 bytes) are IPv4's, ``extensions`` the numbers of IPv6 extension headers. ``fragment``
    is (offset in 8 bytes, more); in IPv6 it adds a fragment header, (0, False) an atomic one. ``total_length``
    replaces the length field. ``identification`` is IPv4's; without one, as many send it, a packet is told by nothing.
    """
    offset, more = fragment or (0, False)
    if source.version == 4:
        length = 20 + len(options) + len(content) if total_length is None else total_length
        header = bytearray(
            struct.pack(
                ">BBHHHBBH",
                0x45 + len(options) // 4,
                0,
                length & 0xFFFF,
                7 if fragment else identification,
                more << 13 | offset,
                64,
                protocol,
                0,
            )
            + source.packed
            + destination.packed
            + options
        )
        header[10:12] = struct.pack(">H", internet_checksum(bytes(header)))
        return bytes(header) + content
    chain = [*extensions, FRAGMENT] if fragment is not None else list(extensions)
    after = [*chain[1:], protocol]
    headers = b""
    for kind, following in zip(chain, after, strict=False):
        if kind == FRAGMENT:
            headers += struct.pack(">BBHI", following, 0, offset << 3 | more, 7)
        elif kind == AUTHENTICATION:
            headers += struct.pack(">BBHII", following, 4, 0, 1, 1) + bytes(12)
        elif kind == ROUTING:
            headers += struct.pack(">BBBBI", following, 2, 0, 0, 0) + bytes(16)
        else:
            headers += struct.pack(">BBBB", following, 0, 1, 4) + bytes(4)
    length = len(headers) + len(content) if total_length is None else total_length
    first = chain[0] if chain else protocol
    return (
        struct.pack(">IHBB", 6 << 28, length & 0xFFFF, first, 64)
        + source.packed
        + destination.packed
        + headers
        + content
    )


def internet_checksum(data: bytes) -> int:
    total: int = sum(struct.unpack(f">{len(data) // 2}H", data[: len(data) // 2 * 2]))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return total ^ 0xFFFF


def udp(payload: bytes, *, source_port: int = 1202, port: int = 1202, udp_length: int | None = None) -> bytes:
    length = 8 + len(payload) if udp_length is None else udp_length
    return struct.pack(">HHHH", source_port, port, length & 0xFFFF, 0) + payload


def unreachable(router: Address, quoted_packet: bytes, code: int = 3) -> bytes:
    """Return the IP packet in which a router tells the source of another one that it went nowhere."""
    if router.version == 4:
        source, protocol, kind = ip_address(quoted_packet[12:16]), PROTOCOL_ICMP, 3
    else:
        source, protocol, kind = ip_address(quoted_packet[8:24]), PROTOCOL_ICMPV6, 1
    body = struct.pack(">BBHI", kind, code, 0, 0) + quoted_packet
    if protocol == PROTOCOL_ICMP:
        even = body + b"\0" * (len(body) % 2)
        body = body[:2] + struct.pack(">H", internet_checksum(even)) + body[4:]
    return internet_packet(router, source, protocol, body)


def link_frame(
    packet: bytes,
    link: int = ETHERNET,
    *,
    broadcast: bool = False,
    tags: Sequence[int] = (),
    packet_type: int | None = None,
    little_endian: bool = True,
    family: int | None = None,
    ethertype: int | None = None,
) -> bytes:
    """Put a link header before an IP packet.

    ``broadcast`` sets the group bit or the packet type; ``tags`` are the types of VLAN tags; ``packet_type`` that of
    the cooked headers; ``little_endian`` and ``family`` concern the null header; ``ethertype`` is for other protocols.
    """
    version = packet[0] >> 4 if packet else 4
    protocol = ethertype or (0x86DD if version == 6 else 0x0800)
    tagged = b""
    for tag in reversed(tags):
        tagged = struct.pack(">HH", 0x2000 | 42, protocol) + tagged
        protocol = tag
    kind = packet_type if packet_type is not None else int(broadcast)
    if link == ETHERNET:
        destination = b"\xff" * 6 if broadcast else b"\x02\x00\x00\x00\x00\x01"
        header = destination + b"\x02\x00\x00\x00\x00\x02" + struct.pack(">H", protocol)
    elif link == SLL:
        header = struct.pack(">HHH", kind, 1, 6) + bytes(8) + struct.pack(">H", protocol)
    elif link == SLL2:
        header = struct.pack(">HHIHBB", protocol, 0, 3, 1, kind, 6) + bytes(8)
    elif link in (NULL, LOOP):
        number = family or (2 if version == 4 else 30)
        header = number.to_bytes(4, "little" if link == NULL and little_endian else "big")
    else:
        header = b""
    return header + tagged + packet


def data_frame(
    ts_ns: int, source: str, destination: str, payload: bytes, *, port: int = 1202, link: int = ETHERNET,
    source_port: int = 1202, identification: int = 0,
) -> Frame:  # fmt: skip
    """Return a plain frame with a telegram, its link layer as the destination suggests."""
    to = ip_address(destination)
    packet = internet_packet(
        ip_address(source), to, PROTOCOL_UDP, udp(payload, source_port=source_port, port=port),
        identification=identification,
    )  # fmt: skip
    group = to.is_multicast or to.packed[-1] == 255
    return whole(ts_ns, link, link_frame(packet, link, broadcast=group))


def other_frame(ts_ns: int) -> Frame:
    """Return a frame that has nothing to do with network variables (ARP)."""
    return whole(ts_ns, ETHERNET, link_frame(b"\0\1\x08\0\6\4\0\1" + bytes(20), broadcast=True, ethertype=0x0806))


def whole(ts_ns: int, link: int, data: bytes) -> Frame:
    return Frame(ts_ns, link, data, len(data))
