"""The fields of frames in which no protocol is found that is looked for: ARP, ICMP. Names as Wireshark's.

In an ICMP error, they are of the message itself: what it quotes has no fields.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dissectors.arp import ArpBatch, ipv4_at
from dissectors.batch import I64, Bool
from dissectors.headers import IPV4_HIGH, IPV4_LOW
from dissectors.icmp import IcmpBatch
from nvscope.expression.typed_columns import AddressColumn, BytesColumn, FieldType
from nvscope.view.fields.field import TelegramField
from nvscope.view.rows.frames import ARP, ICMP, ICMPV6, FrameRows

_HARDWARE_BYTES = 6
_UNSIGNED = FieldType.UNSIGNED
_At = Callable[[ArpBatch], I64]


def _protocol(name: str, title: str) -> TelegramField:
    return TelegramField(
        name, FieldType.BOOL, title, "frames of this protocol", lambda rows: rows.have(name), constant=True,
        of_others=True,
    )  # fmt: skip


def _icmp(name: str, title: str, further: str) -> list[TelegramField]:
    return [
        TelegramField(
            f"{name}.type", _UNSIGNED, f"{title} type", f"what is told: {further}", _kind, of=name, constant=True,
            of_others=True,
        ),
        TelegramField(
            f"{name}.code", _UNSIGNED, f"{title} code", "what is told more closely", _code, _has_code, of=name,
            constant=True, of_others=True,
        ),
    ]  # fmt: skip


def _kind(messages: IcmpBatch) -> I64:
    return messages.type.astype(np.int64)


def _code(messages: IcmpBatch) -> I64:
    return messages.code.astype(np.int64)


def _has_code(messages: IcmpBatch) -> Bool:
    return messages.has_code


def _arp_number(name: str, column: str, label: str, text: str, hex_digits: int = 0) -> TelegramField:
    def read(messages: ArpBatch) -> I64:
        found: I64 = getattr(messages, column)
        return found

    return TelegramField(
        f"arp.{name}", _UNSIGNED, label, text, read, of=ARP, hex_digits=hex_digits, constant=True, of_others=True
    )


def _arp_hardware(name: str, label: str, text: str, at: _At) -> TelegramField:
    def read(rows: FrameRows) -> BytesColumn:
        start, stop = np.zeros(len(rows), np.int64), np.zeros(len(rows), np.int64)
        if found := rows.parts.get(ARP):
            begin = at(found.part)
            own = found.part.has_hardware(begin)
            where = found.positions(len(rows))[own]
            start[where], stop[where] = begin[own], begin[own] + _HARDWARE_BYTES
        return BytesColumn(rows.packets.data, start, stop)

    def known(rows: FrameRows) -> Bool:
        told = np.zeros(len(rows), np.bool_)
        if found := rows.parts.get(ARP):
            told[found.positions(len(rows))] = found.part.has_hardware(at(found.part))
        return told

    return TelegramField(
        f"arp.{name}.hw_mac", FieldType.BYTES, label, text, read, known, separator=":", constant=True, of_others=True
    )


def _arp_address(name: str, label: str, text: str, at: _At) -> TelegramField:
    def read(rows: FrameRows) -> AddressColumn:
        low = np.zeros(len(rows), np.uint64)
        if found := rows.parts.get(ARP):
            begin = at(found.part)
            own = found.part.has_ipv4(begin)
            low[found.positions(len(rows))[own]] = ipv4_at(rows.packets.data, begin[own])
        return AddressColumn(np.full(len(rows), IPV4_HIGH), low | IPV4_LOW)

    def known(rows: FrameRows) -> Bool:
        told = np.zeros(len(rows), np.bool_)
        if found := rows.parts.get(ARP):
            told[found.positions(len(rows))] = found.part.has_ipv4(at(found.part))
        return told

    return TelegramField(
        f"arp.{name}.proto_ipv4", FieldType.ADDRESS, label, text, read, known, constant=True, of_others=True
    )


OTHER_FIELDS = (
    _protocol(ARP, "ARP"),
    _arp_number("hw.type", "hardware_type", "ARP hardware type", "1 Ethernet"),
    _arp_number("proto.type", "protocol", "ARP protocol", "EtherType of the addresses: 0x0800 IPv4", hex_digits=4),
    _arp_number("hw.size", "hardware_bytes", "ARP hardware address length", "in bytes: 6 of Ethernet"),
    _arp_number("proto.size", "protocol_bytes", "ARP protocol address length", "in bytes: 4 of IPv4"),
    _arp_number("opcode", "operation", "ARP operation", "1 request, 2 reply"),
    _arp_hardware("src", "ARP sender hardware address", "of who says this", lambda arp: arp.sender_at),
    _arp_address("src", "ARP sender address", "IPv4 address of who says this", lambda arp: arp.sender_ip_at),
    _arp_hardware("dst", "ARP target hardware address", "of who is asked, or answered", lambda arp: arp.target_at),
    _arp_address(
        "dst", "ARP target address", "IPv4 address that is asked for, or answered", lambda arp: arp.target_ip_at
    ),
    _protocol(ICMP, "ICMP"),
    *_icmp(ICMP, "ICMP", "0 echo reply, 3 unreachable, 5 redirect, 8 echo request, 11 time exceeded"),
    _protocol(ICMPV6, "ICMPv6"),
    *_icmp(ICMPV6, "ICMPv6", "1 unreachable, 128 echo request, 129 echo reply, 135 and 136 neighbour discovery"),
)
"""Fields that frames have in which nothing else is found; who names one wants to look at all frames."""

_SELDOM = frozenset({ARP, ICMP, ICMPV6, "arp.hw.type", "arp.proto.type", "arp.hw.size", "arp.proto.size"})

DEFAULT_OTHER = tuple(field for field in OTHER_FIELDS if field.name not in _SELDOM)
"""What is written of them where nobody says which fields are wanted."""
