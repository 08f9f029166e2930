"""Ethernet frames of a plant as bytes: telegrams, ARP, ICMP, other traffic; and captures of them as files."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from functools import lru_cache
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

from tests.oracle.builders import internet_checksum

EVERYBODY = b"\xff" * 6
UDP, TCP, ICMP, ICMP6 = 17, 6, 1, 58


class Frame(NamedTuple):
    """A captured frame; ``lost`` frames were sent, and are not in the capture."""

    ts_ns: int
    data: bytes


class Port(NamedTuple):
    """Where a frame comes from: addresses, VLAN (0 for none) and TTL."""

    mac: bytes
    ip: str
    vlan: int = 0
    ttl: int = 64


@lru_cache(maxsize=100_000)
def _headers(port: Port, mac: bytes, ip: str, protocol: int, length: int) -> bytes:
    source, to = ip_address(port.ip), ip_address(ip)
    if source.version == 4:
        packet = bytearray(
            struct.pack(">BBHHHBBH", 0x45, 0, 20 + length, 7, 0, port.ttl, protocol, 0) + source.packed + to.packed
        )
        packet[10:12] = struct.pack(">H", internet_checksum(bytes(packet)))
        return ethernet(port, mac, 0x0800) + bytes(packet)
    packet6 = struct.pack(">IHBB", 6 << 28, length, protocol, port.ttl) + source.packed + to.packed
    return ethernet(port, mac, 0x86DD) + packet6


def ethernet(port: Port, mac: bytes, protocol: int) -> bytes:
    tag = struct.pack(">HH", 0x8100, port.vlan) if port.vlan else b""
    return mac + port.mac + tag + struct.pack(">H", protocol)


def group_mac(ip: str) -> bytes | None:
    """Return the hardware address of a broadcast or multicast address, None for that of one node."""
    address = ip_address(ip)
    if address.version == 6:
        return b"\x33\x33" + address.packed[-4:] if address.is_multicast else None
    if address.is_multicast:
        return b"\x01\x00\x5e" + bytes([address.packed[1] & 0x7F]) + address.packed[2:]
    return EVERYBODY if address.packed[-1] == 255 else None


def datagram(port: Port, mac: bytes, ip: str, payload: bytes, *, source_port: int = 1202, to_port: int = 1202) -> bytes:
    head = _headers(port, mac, ip, UDP, 8 + len(payload))
    return head + struct.pack(">HHHH", source_port, to_port, 8 + len(payload), 0) + payload


def arp(port: Port, asked: str, *, gratuitous: bool = False) -> bytes:
    """Return a request for a hardware address; in IPv6 a neighbour solicitation (or announcement)."""
    source = ip_address(port.ip)
    target = source if gratuitous else ip_address(asked)
    if source.version == 6:
        kind = 136 if gratuitous else 135
        body = struct.pack(">BBHI", kind, 0, 0, 0x20000000 if gratuitous else 0) + target.packed
        body += struct.pack(">BB", 2 if gratuitous else 1, 1) + port.mac
        return _headers(port, b"\x33\x33\0\0\0\1", "ff02::1", ICMP6, len(body)) + body
    body = struct.pack(">HHBBH", 1, 0x0800, 6, 4, 1) + port.mac + source.packed + bytes(6) + target.packed
    return ethernet(port, EVERYBODY, 0x0806) + body + bytes(18)


def segment(port: Port, mac: bytes, ip: str, number: int) -> bytes:
    """Return a TCP segment between a controller and an engineering station."""
    body = struct.pack(">HHIIBBHHH", 11740, 50_000, number & 0xFFFFFFFF, 1, 0x50, 0x10, 8192, 0, 0) + bytes(12)
    return _headers(port, mac, ip, TCP, len(body)) + body


def unreachable(port: Port, mac: bytes, ip: str, quoted_frame: bytes, vlan: int = 0) -> bytes:
    """Return what a node tells the sender of a datagram that nobody there waits for."""
    packet = quoted_frame[18 if vlan else 14 :]
    version = ip_address(port.ip).version
    quote = packet[: 20 + 8 + 20] if version == 4 else packet[: 40 + 8 + 20]
    kind, code, protocol = (3, 3, ICMP) if version == 4 else (1, 4, ICMP6)
    body = struct.pack(">BBHI", kind, code, 0, 0) + quote
    body = body[:2] + struct.pack(">H", internet_checksum(body)) + body[4:]
    return _headers(port, mac, ip, protocol, len(body)) + body


def write_pcap(frames: Iterable[Frame], path: Path, snap: int = 262_144) -> None:
    with open(path, "wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, snap, 1))
        for ts_ns, data in frames:
            seconds, rest = divmod(ts_ns, 1_000_000_000)
            kept = data[:snap]
            file.write(struct.pack("<IIII", seconds, rest, len(kept), len(data)) + kept)


def write_pcapng(frames: list[Frame], path: Path, drops: int) -> None:
    """Write a capture that tells how many packets were dropped."""

    def block(kind: int, body: bytes) -> bytes:
        body += bytes(-len(body) % 4)
        return struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12)

    nanoseconds = struct.pack("<HHB3xHH", 9, 1, 9, 0, 0)
    with open(path, "wb") as file:
        file.write(block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)))
        file.write(block(1, struct.pack("<HHI", 1, 0, 0) + nanoseconds))
        for ts_ns, data in frames:
            head = struct.pack("<IIIII", 0, ts_ns >> 32, ts_ns & 0xFFFFFFFF, len(data), len(data))
            file.write(block(6, head + data))
        end_ns = frames[-1].ts_ns if frames else 0
        counts = struct.pack("<HHQHHQHH", 4, 8, len(frames) + drops, 5, 8, drops, 0, 0)
        file.write(block(5, struct.pack("<III", 0, end_ns >> 32, end_ns & 0xFFFFFFFF) + counts))
