"""ICMP and ICMPv6: what hosts and routers tell each other about the network, as columns and in words.

Numbers: RFC 792, 950, 1122, 1256 and 1812 for IPv4; RFC 4443, 4861, 3810 and 2710 for IPv6; IANA's icmp-parameters and
icmpv6-parameters for both.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors import address
from dissectors.batch import I64, U8, Bool
from dissectors.columns import Columns
from dissectors.headers import (
    ICMP_HEADER_BYTES,
    IPV4,
    IPV4_HIGH,
    IPV4_LOW,
    IPV6,
    PROTOCOL_ICMP,
    PROTOCOL_ICMPV6,
    PROTOCOL_TCP,
    PROTOCOL_UDP,
    UNREACHABLE_ICMP,
    UNREACHABLE_ICMPV6,
)
from dissectors.layout import Field, Layout, gather_bytes
from dissectors.transport import Place

IP_PROTOCOLS = {
    PROTOCOL_ICMP: "ICMP",
    2: "IGMP",
    PROTOCOL_TCP: "TCP",
    PROTOCOL_UDP: "UDP",
    41: "IPv6",
    47: "GRE",
    50: "ESP",
    51: "AH",
    PROTOCOL_ICMPV6: "ICMPv6",
    89: "OSPF",
    103: "PIM",
    112: "VRRP",
    132: "SCTP",
}
"""Protocols over IP that have a name here."""

TYPES: Mapping[int, str] = {
    0: "echo reply",
    UNREACHABLE_ICMP: "destination unreachable",
    4: "source quench",
    5: "redirect",
    8: "echo request",
    9: "router advertisement",
    10: "router solicitation",
    11: "time exceeded",
    12: "parameter problem",
    13: "timestamp request",
    14: "timestamp reply",
    15: "information request",
    16: "information reply",
    17: "address mask request",
    18: "address mask reply",
}
CODES: Mapping[int, Mapping[int, str]] = {
    UNREACHABLE_ICMP: {
        0: "network unreachable",
        1: "host unreachable",
        2: "protocol unreachable",
        3: "port unreachable",
        4: "fragmentation needed",
        5: "source route failed",
        6: "network unknown",
        7: "host unknown",
        8: "source isolated",
        9: "network administratively prohibited",
        10: "host administratively prohibited",
        11: "network unreachable for this service",
        12: "host unreachable for this service",
        13: "administratively filtered",
        14: "host precedence violation",
        15: "precedence cutoff",
    },
    5: {
        0: "for the network",
        1: "for the host",
        2: "for the network and service",
        3: "for the host and service",
    },
    11: {0: "time to live exceeded in transit", 1: "fragment reassembly time exceeded"},
    12: {0: "pointer tells the error", 1: "a required option is missing", 2: "bad length"},
}
TYPES_V6: Mapping[int, str] = {
    UNREACHABLE_ICMPV6: "destination unreachable",
    2: "packet too big",
    3: "time exceeded",
    4: "parameter problem",
    128: "echo request",
    129: "echo reply",
    130: "multicast listener query",
    131: "multicast listener report",
    132: "multicast listener done",
    133: "router solicitation",
    134: "router advertisement",
    135: "neighbour solicitation",
    136: "neighbour advertisement",
    137: "redirect",
    143: "multicast listener report v2",
}
CODES_V6: Mapping[int, Mapping[int, str]] = {
    UNREACHABLE_ICMPV6: {
        0: "no route",
        1: "administratively prohibited",
        2: "beyond the scope of the source",
        3: "address unreachable",
        4: "port unreachable",
        5: "source address failed policy",
        6: "route rejected",
    },
    3: {0: "hop limit exceeded in transit", 1: "fragment reassembly time exceeded"},
    4: {0: "bad header field", 1: "unknown next header", 2: "unknown option"},
}
"""Types, and codes by type, of ICMP and (V6) of ICMPv6."""


def _layout(name: str, title: str, types: Mapping[int, str]) -> Layout:
    return Layout(
        name,
        (
            Field("type", "u1", "Type", "what is told", values=types),
            Field("code", "u1", "Code", "what is told more closely"),
            Field("checksum", ">u2", "Checksum", "of the message", base="hex"),
            Field("rest", "V4", "Rest of the header", "by the type: number of an echo, next router, largest packet"),
        ),
        title,
    )


ICMP, ICMPV6 = _layout("icmp", "ICMP", TYPES), _layout("icmpv6", "ICMPv6", TYPES_V6)
"""The header of all messages, without what each type has behind it."""

_QUOTING = frozenset({UNREACHABLE_ICMP, 4, 5, 11, 12})
_QUOTING_V6 = frozenset({UNREACHABLE_ICMPV6, 2, 3, 4})
"""Types that quote the packet that they are about behind their header."""

_SOLICITATION, _ADVERTISEMENT = 135, 136
_ECHOES, _ECHOES_V6 = (0, 8), (128, 129)
_ADDRESS_BYTES = 16
_TARGET_LINK, _LINK_BYTES = 2, 6
_OPTION_UNIT = 8


class IcmpBatch(Columns, Struct, frozen=True):
    """The ICMP messages of a packet batch of one IP version, in its order, of which at least the type was captured.

    ``row`` is the row of the packet, ``type`` and ``code`` uint8 (``code`` holds anything where it was not captured:
    ``has_code``). A message lies from ``at`` up to ``end``, as far as it was captured: absolute offsets, int64.
    """

    row: I64
    type: U8
    code: U8
    has_code: Bool
    at: I64
    end: I64


def read_icmp(data: U8, place: Place) -> IcmpBatch:
    """Read ICMP messages of either version; what was cut off in front of the type is left out."""
    place = place.take(place.at < place.end)
    head = gather_bytes(data, place.at, 2).view(np.uint8).reshape(-1, 2)
    return IcmpBatch(place.row, head[:, 0], head[:, 1], place.at + 2 <= place.end, place.at, place.end)


class Quoted(NamedTuple):
    """The packet that an ICMP error is about: addresses as halves, protocol, and its ports where they are known."""

    source: tuple[int, int]
    destination: tuple[int, int]
    protocol: int
    ports: tuple[int, int] | None


def quoted_in(message: bytes, *, is_ipv4: bool) -> Quoted | None:
    """Return the packet that a message is about; None where it quotes none, or none of which the ends are told."""
    if not message or message[0] not in (_QUOTING if is_ipv4 else _QUOTING_V6):
        return None
    packet = message[ICMP_HEADER_BYTES:]
    size_bytes = (IPV4 if is_ipv4 else IPV6).size_bytes
    if len(packet) < size_bytes or packet[0] >> 4 != (4 if is_ipv4 else 6):
        return None
    first = True
    if is_ipv4:
        high, low = int(IPV4_HIGH), int(IPV4_LOW)
        source, destination = ((high, low | int.from_bytes(packet[at : at + 4], "big")) for at in (12, 16))
        protocol, begin = packet[9], (packet[0] & 15) * 4
        # Of a fragment that is not the first one, what follows are no ports.
        first = begin >= size_bytes and int.from_bytes(packet[6:8], "big") & 0x1FFF == 0
    else:
        source, destination = (
            (int.from_bytes(packet[at : at + 8], "big"), int.from_bytes(packet[at + 8 : at + 16], "big"))
            for at in (8, 24)
        )
        protocol, begin = packet[6], size_bytes
    ports = packet[begin : begin + 4]
    known = first and protocol in (PROTOCOL_TCP, PROTOCOL_UDP) and len(ports) == 4
    both = (int.from_bytes(ports[:2], "big"), int.from_bytes(ports[2:], "big"))
    return Quoted(source, destination, protocol, both if known else None)


def describe(message: bytes, *, is_ipv4: bool) -> str:
    """Return a message in words, such as "destination unreachable: port unreachable"; "" where its type is missing.

    ``message`` may have any length, and hold anything.
    """
    if not message:
        return ""
    kind = message[0]
    text = (TYPES if is_ipv4 else TYPES_V6).get(kind, f"type {kind}")
    if len(message) < 2:
        return text
    code = message[1]
    named = (CODES if is_ipv4 else CODES_V6).get(kind, {}).get(code, "")
    if not named and code:
        named = f"code {code}"
    details = _details(message, is_ipv4=is_ipv4)
    return ": ".join([text, ", ".join(part for part in (named, details) if part)]) if named or details else text


def _details(message: bytes, *, is_ipv4: bool) -> str:
    kind = message[0]
    if kind in (_ECHOES if is_ipv4 else _ECHOES_V6) and len(message) >= ICMP_HEADER_BYTES:
        return f"id {int.from_bytes(message[4:6], 'big')}, number {int.from_bytes(message[6:8], 'big')}"
    if not is_ipv4 and kind in (_SOLICITATION, _ADVERTISEMENT):
        target = message[ICMP_HEADER_BYTES : ICMP_HEADER_BYTES + _ADDRESS_BYTES]
        if len(target) < _ADDRESS_BYTES:
            return ""
        told = address.text(int.from_bytes(target[:8], "big"), int.from_bytes(target[8:], "big"))
        if kind == _SOLICITATION:
            return f"who has {told}?"
        hardware = _target_link(message[ICMP_HEADER_BYTES + _ADDRESS_BYTES :])
        return f"{told} is at {hardware.hex(':')}" if hardware else f"{told} is there"
    if is_ipv4 and kind == UNREACHABLE_ICMP and message[1] == 4 and len(message) >= ICMP_HEADER_BYTES:
        return f"at most {int.from_bytes(message[6:8], 'big')} bytes"
    if not is_ipv4 and kind == 2 and len(message) >= ICMP_HEADER_BYTES:
        return f"at most {int.from_bytes(message[4:8], 'big')} bytes"
    return ""


def _target_link(options: bytes) -> bytes:
    """Return the hardware address of the target among the options of neighbour discovery, b"" without one."""
    at = 0
    while at + 2 <= len(options) and options[at + 1]:
        if options[at] == _TARGET_LINK and options[at + 1] == 1:
            found = options[at + 2 : at + 2 + _LINK_BYTES]
            return found if len(found) == _LINK_BYTES else b""
        at += options[at + 1] * _OPTION_UNIT
    return b""


NO_ICMP = IcmpBatch(
    np.empty(0, np.int64), np.empty(0, np.uint8), np.empty(0, np.uint8), np.empty(0, np.bool_), np.empty(0, np.int64),
    np.empty(0, np.int64),
)  # fmt: skip
