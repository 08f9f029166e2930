"""Plain readers of pcap and pcapng, record by record, to compare with: slow, obvious, and sharing no code."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import NamedTuple

MAX_PACKET = 262_144
MAX_SNAP = 16 << 20
MAX_BLOCK = MAX_SNAP + (1 << 20)
TIME_LIMIT = 2**62 - 1


class Packet(NamedTuple):
    ts_ns: int
    original: int
    link: int
    data: bytes


@dataclass
class Content:
    """What a file holds.

    ``cut`` is where reading ends early, or else the first packet of ``doubtful`` time; None where there is neither.
    """

    packets: list[Packet] = field(default_factory=list)
    cut: int | None = None
    damaged: bool = False
    doubtful: list[int] = field(default_factory=list)
    drops: int = 0
    comments: list[tuple[int | None, str]] = field(default_factory=list)
    readable: bool = True


def read_pcap(raw: bytes) -> Content:
    content = Content()
    magics = {
        struct.pack(order + "I", magic): (order, unit)
        for order in "<>"
        for magic, unit in ((0xA1B2C3D4, 1000), (0xA1B23C4D, 1))
    }
    if len(raw) < 24 or raw[:4] not in magics:
        content.readable = False
        return content
    order, unit = magics[raw[:4]]
    major, _, _, _, snap, link = struct.unpack(order + "HHiIII", raw[4:24])
    if major != 2:
        content.readable = False
        return content
    longest = max(MAX_PACKET, min(snap, MAX_SNAP))
    at = 24
    while at < len(raw):
        if at + 16 > len(raw):
            content.cut = at
            break
        seconds, fraction, captured, original = struct.unpack(order + "IIII", raw[at : at + 16])
        if captured > longest:
            content.cut, content.damaged = at, True
            break
        if at + 16 + captured > len(raw):
            content.cut = at
            break
        data = raw[at + 16 : at + 16 + captured]
        if fraction * unit >= 10**9:
            content.doubtful.append(at)
        content.packets.append(Packet(seconds * 10**9 + fraction * unit, original, link & 0xFFFF, data))
        at += 16 + captured
    if content.cut is None and content.doubtful:
        content.cut = content.doubtful[0]
    return content


def to_ns(units: int, resolution: int, offset_s: int) -> int | None:
    """None for a time that is out of range."""
    exponent = resolution & 0x7F
    base = 2 if resolution & 0x80 else 10
    ns: int = units * 10**9 // base**exponent + offset_s * 10**9
    return ns if abs(ns) <= TIME_LIMIT else None


def _options(order: str, body: bytes) -> list[tuple[int, bytes]]:
    found = []
    at = 0
    while at + 4 <= len(body):
        code, length = struct.unpack(order + "HH", body[at : at + 4])
        padded = (length + 3) // 4 * 4
        if code == 0 or at + 4 + padded > len(body):
            break
        found.append((code, body[at + 4 : at + 4 + length]))
        at += 4 + padded
    return found


class _DamageError(Exception):
    pass


def read_pcapng(raw: bytes) -> Content:
    content = Content()
    orders = {b"\x1a\x2b\x3c\x4d": ">", b"\x4d\x3c\x2b\x1a": "<"}
    if len(raw) < 28 or raw[:4] != b"\x0a\x0d\x0d\x0a" or raw[8:12] not in orders:
        content.readable = False
        return content
    if struct.unpack(orders[raw[8:12]] + "H", raw[12:14])[0] != 1:
        content.readable = False
        return content
    order = "?"
    interfaces: list[dict[str, int]] = []
    drops: list[dict[str, int]] = []
    last_ns = 0
    at = 0
    try:
        while at < len(raw):
            if at + 8 > len(raw):
                content.cut = at
                break
            if raw[at : at + 4] == b"\x0a\x0d\x0d\x0a":
                if at + 12 > len(raw):
                    content.cut = at
                    break
                if raw[at + 8 : at + 12] not in orders:
                    raise _DamageError
                order = orders[raw[at + 8 : at + 12]]
            kind, length = struct.unpack(order + "II", raw[at : at + 8])
            if not 12 <= length <= MAX_BLOCK or length % 4:
                raise _DamageError
            if at + length > len(raw):
                content.cut = at
                break
            if struct.unpack(order + "I", raw[at + length - 4 : at + length])[0] != length:
                raise _DamageError
            body = raw[at + 8 : at + length - 4]
            if kind == 0x0A0D0D0A:
                if length < 28 or struct.unpack(order + "H", body[4:6])[0] != 1:
                    raise _DamageError
                interfaces = []
                for code, value in _options(order, body[16:]):
                    if code == 1:
                        content.comments.append((None, value.decode("utf8", "replace")))
            elif kind == 1:
                if length < 20:
                    raise _DamageError
                link, _, snap = struct.unpack(order + "HHI", body[:8])
                interface = {"link": link, "snap": snap, "resolution": 6, "offset": 0, "number": len(drops)}
                for code, value in _options(order, body[8:]):
                    if code == 9 and len(value) == 1:
                        interface["resolution"] = value[0]
                    if code == 14 and len(value) == 8:
                        interface["offset"] = struct.unpack(order + "q", value)[0]
                    if code == 1:
                        content.comments.append((None, value.decode("utf8", "replace")))
                interfaces.append(interface)
                drops.append({"packets": 0})
            elif kind == 5:
                if length < 24:
                    raise _DamageError
                number = struct.unpack(order + "I", body[:4])[0]
                for code, value in _options(order, body[12:]):
                    if code == 1:
                        content.comments.append((None, value.decode("utf8", "replace")))
                if number < len(interfaces):
                    values = [
                        min(struct.unpack(order + "Q", value)[0], 1 << 40)
                        for code, value in _options(order, body[12:])
                        if code in (5, 7) and len(value) == 8
                    ]
                    if values:
                        drops[interfaces[number]["number"]]["statistics"] = sum(values)
            elif kind in (2, 3, 6):
                number, lost = 0, 0
                if kind == 3:
                    if length < 16 or not interfaces:
                        raise _DamageError
                    original = struct.unpack(order + "I", body[:4])[0]
                    captured = min(original, interfaces[0]["snap"] or MAX_SNAP)
                    start = 4
                else:
                    if length < 32:
                        raise _DamageError
                    if kind == 6:
                        number = struct.unpack(order + "I", body[:4])[0]
                    else:
                        number, lost = struct.unpack(order + "HH", body[:4])
                        lost = 0 if lost == 0xFFFF else lost
                    high, low, captured, original = struct.unpack(order + "IIII", body[4:20])
                    start = 20
                if number >= len(interfaces):
                    raise _DamageError
                interface = interfaces[number]
                if start + captured > len(body) or captured > max(MAX_PACKET, min(interface["snap"], MAX_SNAP)):
                    raise _DamageError
                if kind != 3:
                    told_ns = to_ns((high << 32) | low, interface["resolution"], interface["offset"])
                    if told_ns is None:
                        content.doubtful.append(at)
                    last_ns = last_ns if told_ns is None else told_ns
                    for code, value in _options(order, body[start + (captured + 3) // 4 * 4 :]):
                        if code == 1:
                            content.comments.append((len(content.packets) + 1, value.decode("utf8", "replace")))
                        if code == 4 and len(value) == 8 and kind == 6:
                            lost += min(struct.unpack(order + "Q", value)[0], 1 << 40)
                drops[interface["number"]]["packets"] += lost
                content.packets.append(Packet(last_ns, original, interface["link"], body[start : start + captured]))
            at += length
    except _DamageError:
        content.cut, content.damaged = at, True
    if content.cut is None and content.doubtful:
        content.cut = content.doubtful[0]
    content.drops = sum(each.get("statistics", each["packets"]) for each in drops)
    return content
