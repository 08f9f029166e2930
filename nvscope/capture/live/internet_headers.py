"""The IP and UDP headers of a datagram of which a socket gave the payload only."""

from __future__ import annotations

import socket
import struct
from functools import lru_cache

_UDP = 17
_UDP_BYTES = 8
_FOUR = struct.Struct(">BBHHHBBH4s4sHHHH")
_SIX = struct.Struct(">IHBB16s16sHHHH")
_MOST_BYTES = 0xFFFF


def packet_of(source: str, target: str, source_port: int, port: int, hops: int, payload: bytes) -> bytes:
    """Return a datagram as an IP packet of the version that its addresses have; its UDP checksum says "none"."""
    length = min(len(payload) + _UDP_BYTES, _MOST_BYTES)
    sender, receiver = _packed(source), _packed(target)
    if len(sender) == 4:
        total = min(length + 20, _MOST_BYTES)
        checksum = _checksum(sender + receiver, total, hops)
        header = _FOUR.pack(
            0x45, 0, total, 0, 0, hops, _UDP, checksum, sender, receiver, source_port, port, length, 0
        )  # fmt: skip
    else:
        header = _SIX.pack(6 << 28, length, _UDP, hops, sender, receiver, source_port, port, length, 0)
    return header + payload


@lru_cache(4096)
def _packed(address: str) -> bytes:
    if ":" in address:
        return socket.inet_pton(socket.AF_INET6, address.partition("%")[0])
    return socket.inet_aton(address)


@lru_cache(4096)
def _checksum(addresses: bytes, total: int, hops: int) -> int:
    """Return the checksum of an IPv4 header (RFC 791) with no options, identification or fragments."""
    folded = 0x4500 + total + (hops << 8 | _UDP)
    for place in range(0, len(addresses), 2):
        folded += int.from_bytes(addresses[place : place + 2], "big")
    while folded >> 16:
        folded = (folded & 0xFFFF) + (folded >> 16)
    return folded ^ 0xFFFF
