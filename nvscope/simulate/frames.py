"""Frames: the bytes from the link layer to the end of a datagram, with correct lengths and checksums.

A ``Frame`` is one frame as bytes and knows where its layers begin; ``render`` makes many frames from one that differ
only in what changes from telegram to telegram (Counter, Flags, Checksum, values, IP identification, source port).
Formats: RFC 791, 8200 (IP), 768 (UDP), 792, 4443 (ICMP), 826 (ARP), 9293 (TCP), 1035 (DNS), IEEE 802.1Q, and
https://www.tcpdump.org/linktypes.html for the link layers.
"""

from __future__ import annotations

import ipaddress
import struct
from enum import StrEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I64, U8, LinkType
from dissectors.netvar import HEADER
from nvscope.simulate.noise import noise

IPAddress = ipaddress.IPv4Address | ipaddress.IPv6Address
LINKS = {
    "ethernet": LinkType.ETHERNET,
    "sll": LinkType.LINUX_SLL,
    "sll2": LinkType.LINUX_SLL2,
    "raw": LinkType.RAW,
    "null": LinkType.NULL,
    "loop": LinkType.LOOP,
}
LIMITED_BROADCAST = ipaddress.IPv4Address("255.255.255.255")
_IPV4, _IPV6, _ARP, _VLAN = 0x0800, 0x86DD, 0x0806, 0x8100
_ICMP, _TCP, _UDP, _ICMPV6 = 1, 6, 17, 58
_ROUTER_ALERT = b"\x94\x04\x00\x00"
_FIRST_DYNAMIC_PORT, _DYNAMIC_PORTS = 49_152, 16_384
_COUNTER, _FLAGS, _DATA = HEADER.offset_of("counter"), HEADER.offset_of("flags"), HEADER.size_bytes
_RAMP_BYTES = 4


class Values(StrEnum):
    """How the data of telegrams changes: by counting in the first four bytes, not at all, or all of it at random."""

    RAMP = "ramp"
    CONSTANT = "constant"
    NOISE = "noise"


class Host(Struct, frozen=True):
    """An end of a conversation; ``mac`` has six bytes."""

    address: IPAddress
    mac: bytes


class Frame(Struct, frozen=True, dict=True):
    """One frame.

    ``ip``, ``payload``: where the IP header and the payload of UDP begin, -1 if there are none. A frame with ``values``
    is a pattern for ``render``, in which Counter, Flags, Checksum, the IP identification and changing data are 0;
    ``key`` is the noise key of its values.
    """

    data: bytes
    ip: int = -1
    payload: int = -1
    values: Values | None = None
    changing_port: bool = False
    key: int = 0

    @property
    def payload_bytes(self) -> int:
        """Bytes behind the UDP header."""
        return len(self.data) - self.payload

    @property
    def changing_bytes(self) -> int:
        """Bytes of the data that differ from telegram to telegram."""
        size = self.payload_bytes - _DATA
        if self.values is Values.NOISE:
            return size
        return min(size, _RAMP_BYTES) if self.values is Values.RAMP else 0

    @cached_property
    def pattern(self) -> U8:
        """The bytes as an array."""
        return np.frombuffer(self.data, np.uint8)

    @cached_property
    def udp_sum(self) -> int:
        """Sum of the pattern's pseudo header, UDP header and payload in little-endian words."""
        udp = self.data[self.payload - 8 :]
        version4 = self.data[self.ip] >> 4 == 4
        addresses = self.data[self.ip + 12 : self.ip + 20] if version4 else self.data[self.ip + 8 : self.ip + 40]
        return word_sum(addresses + struct.pack(">HH", _UDP, len(udp)) + udp)

    @cached_property
    def ip_sum(self) -> int:
        """Sum of the pattern's IPv4 header in little-endian words, 0 for IPv6."""
        first = self.data[self.ip]
        return word_sum(self.data[self.ip : self.ip + (first & 15) * 4]) if first >> 4 == 4 else 0


def word_sum(data: bytes) -> int:
    """Return the sum of the 16-bit little-endian words, an odd last byte padded with 0."""
    padded = data + b"\0" * (len(data) % 2)
    return sum(struct.unpack(f"<{len(padded) // 2}H", padded))


def checksum(data: bytes) -> bytes:
    """Return the Internet checksum (RFC 1071) of data as the two bytes that go into the header."""
    total = word_sum(data)
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return struct.pack("<H", total ^ 0xFFFF)


def address_order(address: IPAddress) -> tuple[int, int]:
    """Return by what addresses of both versions are sorted."""
    return address.version, int(address)


def hardware_address(address: IPAddress, known: dict[IPAddress, bytes]) -> bytes:
    """Return where frames for an address go: a host of ``known``, a multicast group, else broadcast.

    An IPv4 address that ends in 255 is taken for a subnet's broadcast address; other unknown ones are behind a router.
    """
    if address in known:
        return known[address]
    if address.is_multicast:
        if address.version == 6:
            return b"\x33\x33" + address.packed[-4:]
        return b"\x01\x00\x5e" + bytes([address.packed[1] & 0x7F]) + address.packed[2:]
    if address.version == 4 and address.packed[-1] == 255:
        return b"\xff" * 6
    return b"\x02\x00\x00\x00\xff\xfe"


def link_header(link: LinkType, source: bytes, destination: bytes, ether_type: int, vlan: tuple[int, ...]) -> bytes:
    """Return the link layer's header, VLAN tags included where it has room for them."""
    tags, inner = b"", ether_type
    for tag in reversed(vlan if link in {LinkType.ETHERNET, LinkType.LINUX_SLL, LinkType.LINUX_SLL2} else ()):
        tags, inner = struct.pack(">HH", tag, inner) + tags, _VLAN
    if link == LinkType.ETHERNET:
        return destination + source + struct.pack(">H", inner) + tags
    kind = 1 if destination == b"\xff" * 6 else 2 if destination[0] & 1 else 3
    if link == LinkType.LINUX_SLL:
        return struct.pack(">HHH8sH", kind, 1, 6, source, inner) + tags
    if link == LinkType.LINUX_SLL2:
        return struct.pack(">HHIHBB8s", inner, 0, 2, 1, kind, 6, source) + tags
    family = 2 if ether_type == _IPV4 else 24
    if link == LinkType.NULL:
        return struct.pack("<I", family)
    return struct.pack(">I", family) if link == LinkType.LOOP else b""


def ip_packet(
    source: IPAddress, destination: IPAddress, protocol: int, content: bytes, *, options: bool = False,
    identification: int = 0, fragment: int | None = None, more: bool = False,
) -> bytes:  # fmt: skip
    """Return an IP header and its content; ``fragment`` is the offset in bytes of a piece of a larger datagram."""
    if source.version == 6:
        extension = b""
        if fragment is not None:
            extension = struct.pack(">BBHI", protocol, 0, fragment | more, identification)
            protocol = 44
        content = extension + content
        head = struct.pack(">IHBB", 6 << 28, len(content), protocol, 64)
        return head + source.packed + destination.packed + content
    option = _ROUTER_ALERT if options else b""
    size = 20 + len(option)
    place = 0x4000 if fragment is None else fragment // 8 | more << 13
    head = struct.pack(">BBHHHBBH", 0x40 | size // 4, 0, size + len(content), identification, place, 64, protocol, 0)
    head += source.packed + destination.packed + option
    return head[:10] + checksum(head) + head[12:] + content


def udp_datagram(source: IPAddress, destination: IPAddress, ports: tuple[int, int], payload: bytes) -> bytes:
    """Return UDP header and payload."""
    size = 8 + len(payload)
    pseudo = source.packed + destination.packed + struct.pack(">HH", _UDP, size)
    head = struct.pack(">HHHH", *ports, size, 0)
    return head[:6] + (checksum(pseudo + head + payload).replace(b"\0\0", b"\xff\xff")) + payload


class Wire(Struct, frozen=True):
    """The link layer of a capture and the hosts on it; it puts packets into frames."""

    link: LinkType
    known: dict[IPAddress, bytes]

    def frame(
        self, source: Host, destination: IPAddress, packet: bytes, vlan: tuple[int, ...] = (), ether_type: int = 0
    ) -> tuple[bytes, int]:
        """Return link header and packet, and where the packet begins."""
        kind = ether_type or (_IPV4 if source.address.version == 4 else _IPV6)
        head = link_header(self.link, source.mac, hardware_address(destination, self.known), kind, vlan)
        return head + packet, len(head)

    def udp(
        self, source: Host, destination: IPAddress, ports: tuple[int, int], payload: bytes, *,
        vlan: tuple[int, ...] = (), options: bool = False, identification: int = 0,
    ) -> Frame:  # fmt: skip
        """Return a frame with a UDP datagram."""
        datagram = udp_datagram(source.address, destination, ports, payload)
        packet = ip_packet(source.address, destination, _UDP, datagram, options=options, identification=identification)
        data, start = self.frame(source, destination, packet, vlan)
        return Frame(data, start, len(data) - len(payload))

    def pattern(
        self, source: Host, destination: IPAddress, ports: tuple[int, int], payload: bytes, values: Values, key: int,
        *, vlan: tuple[int, ...] = (), options: bool = False, changing_port: bool = False,
    ) -> Frame:  # fmt: skip
        """Return a frame for ``render``: what changes and both checksums are 0."""
        first = 0 if changing_port else ports[0]
        frame = self.udp(source, destination, (first, ports[1]), payload, vlan=vlan, options=options)
        data = bytearray(frame.data)
        data[frame.payload - 2 : frame.payload] = b"\0\0"
        if source.address.version == 4:
            data[frame.ip + 10 : frame.ip + 12] = b"\0\0"
        pattern = Frame(bytes(data), frame.ip, frame.payload, values, changing_port, key)
        start = frame.payload + _DATA
        data[frame.payload + _COUNTER : start] = b"\0" * (_DATA - _COUNTER)
        data[start : start + pattern.changing_bytes] = b"\0" * pattern.changing_bytes
        return Frame(bytes(data), frame.ip, frame.payload, values, changing_port, key)

    def unreachable(self, source: Host, destination: IPAddress, quoted: bytes, vlan: tuple[int, ...] = ()) -> Frame:
        """Return a frame with an ICMP destination-unreachable (port) that quotes the beginning of an IP packet."""
        if source.address.version == 4:
            message = b"\x03\x03\0\0\0\0\0\0" + quoted
            message = message[:2] + checksum(message) + message[4:]
            packet = ip_packet(source.address, destination, _ICMP, message)
        else:
            message = b"\x01\x04\0\0\0\0\0\0" + quoted
            pseudo = source.address.packed + destination.packed + struct.pack(">II", len(message), _ICMPV6)
            message = message[:2] + checksum(pseudo + message) + message[4:]
            packet = ip_packet(source.address, destination, _ICMPV6, message)
        data, start = self.frame(source, destination, packet, vlan)
        return Frame(data, start)

    def fragments(
        self, source: Host, destination: IPAddress, ip: bytes, vlan: tuple[int, ...], identification: int
    ) -> list[Frame]:
        """Return the two frames that carry an unfragmented IP packet in pieces."""
        if source.address.version == 4:
            protocol, content = ip[9], ip[(ip[0] & 15) * 4 :]
        else:
            protocol, content = ip[6], ip[40:]
        cut = (len(content) // 2 + 7) // 8 * 8
        frames = []
        for start, piece in ((0, content[:cut]), (cut, content[cut:])):
            packet = ip_packet(
                source.address, destination, protocol, piece, identification=identification, fragment=start,
                more=start == 0,
            )  # fmt: skip
            data, ip_start = self.frame(source, destination, packet, vlan)
            frames.append(Frame(data, ip_start))
        return frames

    def arp(self, source: Host, wanted: IPAddress) -> Frame:
        """Return an ARP request."""
        body = struct.pack(">HHBBH", 1, _IPV4, 6, 4, 1) + source.mac + source.address.packed + b"\0" * 6 + wanted.packed
        data, _ = self.frame(source, LIMITED_BROADCAST, body, (), _ARP)
        return Frame(data)

    def ping(self, source: Host, destination: IPAddress) -> Frame:
        """Return an ICMP echo request."""
        message = (b"\x08" if source.address.version == 4 else b"\x80") + b"\0\0\0\0\x01\0\x01abcdefgh"
        pseudo = b""
        if source.address.version == 6:
            pseudo = source.address.packed + destination.packed + struct.pack(">II", len(message), _ICMPV6)
        message = message[:2] + checksum(pseudo + message) + message[4:]
        protocol = _ICMP if source.address.version == 4 else _ICMPV6
        data, start = self.frame(source, destination, ip_packet(source.address, destination, protocol, message))
        return Frame(data, start)

    def tcp(self, source: Host, destination: IPAddress) -> Frame:
        """Return a TCP segment with a Modbus request (read ten registers)."""
        body = bytes.fromhex("0001000000060103000a000a")
        return self.segment(source, destination, (49_200, 502), (1, 1), 0x18, body)

    def segment(
        self, source: Host, destination: IPAddress, ports: tuple[int, int], numbers: tuple[int, int], flags: int,
        data: bytes, *, vlan: tuple[int, ...] = (), options: bool = False,
    ) -> Frame:  # fmt: skip
        """Return a TCP segment; ``numbers`` are those of sequence and acknowledgement."""
        segment = struct.pack(">HHIIBBHHH", *ports, *numbers, 0x50, flags, 8192, 0, 0) + data
        size = (
            struct.pack(">HH", _TCP, len(segment))
            if source.address.version == 4
            else struct.pack(">II", len(segment), _TCP)
        )
        total = checksum(source.address.packed + destination.packed + size + segment)
        segment = segment[:16] + total + segment[18:]
        packet = ip_packet(source.address, destination, _TCP, segment, options=options)
        data, start = self.frame(source, destination, packet, vlan)
        return Frame(data, start)

    def dns(self, source: Host, destination: IPAddress) -> Frame:
        """Return a DNS query for the address of a name."""
        query = bytes.fromhex("123401000001000000000000") + b"\x03plc\x07example\0" + bytes.fromhex("00010001")
        return self.udp(source, destination, (53_124, 53), query)


def render(frame: Frame, ordinal: I64, counter: npt.NDArray[np.uint16], flags: U8, signature: U8, out: U8) -> None:
    """Write one frame per row of ``out``, shape (n, len(frame.data)).

    A frame without ``values`` is repeated as it is. In a pattern, the columns of shape (n,) fill Counter, Flags and
    Checksum; ``ordinal`` the changing values, the IP identification and a changing source port. Equal columns make
    equal bytes.
    """
    out[:] = frame.pattern
    if frame.values is None:
        return
    payload, udp = frame.payload, frame.payload - 8
    total = np.full(len(out), frame.udp_sum, np.int64)
    total += counter
    total += flags.astype(np.int64) + (signature.astype(np.int64) << 8)
    out[:, payload + _COUNTER : payload + _FLAGS] = _pairs(counter, "<u2")
    out[:, payload + _FLAGS] = flags
    out[:, payload + _FLAGS + 1] = signature
    size = frame.changing_bytes
    if size:
        values = _changing_values(frame, ordinal, size)
        out[:, payload + _DATA : payload + _DATA + size] = values[:, :size]
        values[:, size:] = 0
        total += values.view("<u2").sum(axis=1, dtype=np.int64)
    if frame.changing_port:
        port = _pairs(_FIRST_DYNAMIC_PORT + ordinal % _DYNAMIC_PORTS, ">u2")
        out[:, udp : udp + 2] = port
        total += port.view("<u2").ravel()
    out[:, udp + 6 : udp + 8] = _folded(total, zero_is_none=True)
    if frame.data[frame.ip] >> 4 == 4:
        identification = _pairs(ordinal & 0xFFFF, ">u2")
        out[:, frame.ip + 4 : frame.ip + 6] = identification
        head_sum = frame.ip_sum + identification.view("<u2").ravel().astype(np.int64)
        out[:, frame.ip + 10 : frame.ip + 12] = _folded(head_sum, zero_is_none=False)


def _changing_values(frame: Frame, ordinal: I64, size: int) -> U8:
    """Return the changing data of each telegram, shape (n, size rounded up to whole words)."""
    if frame.values is Values.RAMP:
        return (ordinal & 0xFFFFFFFF).astype("<u4").view(np.uint8).reshape(len(ordinal), _RAMP_BYTES)
    words = (size + 7) // 8
    places = ordinal[:, np.newaxis] * words + np.arange(words)
    values = noise(frame.key, places.ravel()).astype("<u8").view(np.uint8).reshape(len(ordinal), words * 8)
    values[:, 0] = ordinal & 0xFF  # so that no telegram equals the one before it
    return values


def _pairs(column: npt.NDArray[np.integer], dtype: str) -> U8:
    """Return 16-bit numbers as their bytes, shape (n, 2)."""
    return np.ascontiguousarray(column.astype(dtype)).view(np.uint8).reshape(len(column), 2)


def _folded(total: I64, *, zero_is_none: bool) -> U8:
    """Return Internet checksums from sums of little-endian words, as bytes of shape (n, 2)."""
    for _ in range(3):
        total = (total & 0xFFFF) + (total >> 16)
    inverted = total ^ 0xFFFF
    if zero_is_none:
        inverted[inverted == 0] = 0xFFFF
    return _pairs(inverted, "<u2")
