"""One telegram as a tree: every field of every layer with its place, its bytes, its value, and what that means.

Names, places and explanations come from the tables of the layers (``dissectors.layout.Layout``) and of the fields
(``nvscope.view.fields``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from ipaddress import IPv4Address
from typing import Any

import numpy as np

from dissectors.layout import Field, Layout
from dissectors.link import PROTOCOL_UDP, TYPE_IPV4, TYPE_IPV6, VLAN_TYPES
from dissectors.netvar import HEADER, IDENTITY, IDENTITY_ASCII, RESERVED_FLAGS, Fault
from nvscope import units
from nvscope.report.packets import cells, moments, words
from nvscope.report.packets.fit import cut
from nvscope.report.packets.hexdump import dump
from nvscope.tracker import address
from nvscope.view.fields import FIELDS, FieldType
from nvscope.view.layers import Layer, layers, values
from nvscope.view.table import Cell, Line, Tone
from nvscope.view.telegrams import TelegramRows

_INDENT = 2
_HEX_BYTES = 6
_HEX_WIDTH = 3 * _HEX_BYTES - 1
_LABEL_WIDTH = 22
_PLACE_WIDTH = 4 + 2 + _HEX_WIDTH + 2

_TITLES = {
    "eth": "Ethernet",
    "vlan": "VLAN tag",
    "sll": "Linux cooked capture",
    "sll2": "Linux cooked capture v2",
    "null": "Loopback",
    "ip": "IPv4",
    "ipv6": "IPv6",
    "udp": "UDP",
}
_JOINED = {
    ("eth", "group"): ("destination_rest", "Destination"),
    ("ipv6", "source_hi"): ("source_lo", "Source"),
    ("ipv6", "destination_hi"): ("destination_lo", "Destination"),
}
"""Fields that are one to people: the field that follows, and what both together are called."""

_ETHERTYPES = {TYPE_IPV4: "IPv4", TYPE_IPV6: "IPv6", **dict.fromkeys(VLAN_TYPES, "VLAN tag")}
_DIRECTIONS = {0: "to this host", 1: "broadcast", 2: "multicast", 3: "to another host", 4: "sent by this host"}
_DONT_FRAGMENT = 0x4000

_MEANINGS: Mapping[tuple[str, str], Callable[[int], str]] = {
    **{(layer, "type"): lambda number: _ETHERTYPES.get(number, "") for layer in ("eth", "vlan", "sll", "sll2")},
    **{(layer, "packet_type"): lambda number: _DIRECTIONS.get(number, "") for layer in ("sll", "sll2")},
    ("vlan", "tci"): lambda number: f"VLAN {number & 0xFFF}, priority {number >> 13}",
    ("ip", "version_ihl"): lambda number: f"version {number >> 4}, header of {(number & 15) * 4} bytes",
    ("ip", "fragment"): lambda number: "do not fragment" if number & _DONT_FRAGMENT else "may be fragmented",
    ("ip", "protocol"): lambda number: "UDP" if number == PROTOCOL_UDP else "",
    ("ipv6", "version"): lambda number: f"version {number >> 4}",
    ("ipv6", "next"): lambda number: "UDP" if number == PROTOCOL_UDP else "",
    ("udp", "checksum"): lambda number: "not verified" if number else "none",
}
"""What numbers of a layer mean; where nothing stands here, the table's explanation does."""

_ADDRESSES = {("ip", "source"), ("ip", "destination")}


def tree(rows: TelegramRows, width: int | None = None, *, dumps: bool = True) -> Iterator[Line]:
    """Yield the tree of one telegram, ``rows``, in lines not wider than ``width`` (None: as wide as it takes).

    Places are offsets from the start of the frame, in hexadecimal digits, as in a dump of it. Without ``dumps``, what
    has no fields is told in its length only.
    """
    for line in _lines(rows, dumps):
        yield line if width is None else cut(_without_help(line, width), width)


def _without_help(line: list[Cell], width: int) -> list[Cell]:
    """Leave out an explanation that there is no room for: half of one explains nothing."""
    if line and line[-1].tone is Tone.FAINT and sum(len(cell.text) for cell in line) > width:
        return line[:-1]
    return line


def _lines(rows: TelegramRows, dumps: bool) -> Iterator[list[Cell]]:
    datagram = rows.telegrams.datagram
    row = int(datagram.row[0])
    packet = rows.packets.packet(row)
    payload_at = int(datagram.payload[0] - rows.packets.offset[row])
    payload_end = payload_at + int(datagram.captured_bytes[0])
    yield from _frame(rows)
    for layer in layers(packet, int(rows.packets.link[row]), payload_at):
        yield from _layer(rows, packet, layer, dumps)
    yield from _header(rows, packet[payload_at:payload_end], payload_at)
    data_at = payload_at + HEADER.size_bytes
    if payload_end > data_at:
        missing = int(datagram.payload_bytes[0] - datagram.captured_bytes[0])
        title = [Cell("Data", Tone.STRONG), Cell(f"  {units.count_of(payload_end - data_at, 'byte')}")]
        if missing:
            title.append(Cell(f", {units.count(missing)} more not captured", Tone.WARNING))
        yield title
        if dumps:
            yield from _dump(packet[data_at:payload_end], data_at)
    if payload_end < len(packet):
        size = units.count_of(len(packet) - payload_end, "byte")
        yield [Cell("Trailer", Tone.STRONG), Cell(f"  {size} behind the datagram")]
        if dumps:
            yield from _dump(packet[payload_end:], payload_end)


def _dump(data: bytes, first: int) -> Iterator[list[Cell]]:
    for line in dump(data, indent=_INDENT, first=first):
        yield list(line)


def _frame(rows: TelegramRows) -> Iterator[list[Cell]]:
    yield [Cell(f"Frame {cells.texts(FIELDS['frame.number'], rows)[0]}", Tone.STRONG)]
    for field in FIELDS.values():
        if not field.name.startswith("frame.") or field.name == "frame.number":
            continue
        unit = " s" if field.type is FieldType.DURATION else ""
        line = [_label(field.label, at_place=True), Cell(f"{cells.texts(field, rows)[0]}{unit}")]
        if field.calendar:
            local = moments.clock(rows.telegrams.ts_ns, 6, utc=False, date=True)[0]
            line.append(Cell(f"  {local} local time", Tone.FAINT))
        yield line


def _layer(rows: TelegramRows, packet: bytes, layer: Layer, dumps: bool) -> Iterator[list[Cell]]:
    if layer.layout is None:
        yield [Cell("Options", Tone.STRONG), Cell(f"  {units.count_of(layer.stop - layer.start, 'byte')}")]
        if dumps:
            yield from _dump(packet[layer.start : layer.stop], layer.start)
        return
    layout, found = layer.layout, values(packet, layer)
    yield [Cell(_TITLES[layout.name], Tone.STRONG), Cell(_summary(rows, layout))]
    entries = iter(layout)
    for entry in entries:
        at = layer.start + layout.offset_of(entry.name)
        joined = _JOINED.get((layout.name, entry.name))
        if joined:
            following = next(entries)
            content = packet[at : at + entry.size_bytes + following.size_bytes]
            yield [_place(at, content), _label(joined[1]), Cell(_joined_text(content))]
        else:
            content = packet[at : at + entry.size_bytes]
            value, meaning = _value(layout, entry, found[entry.name])
            yield [_place(at, content), _label(entry.label), Cell(value), *_explanation(meaning, entry.help)]


def _summary(rows: TelegramRows, layout: Layout) -> str:
    """Return from where to where, for the layers that say so."""
    fields = {"ip": ("ip.src", "ip.dst"), "ipv6": ("ip.src", "ip.dst"), "udp": ("udp.srcport", "udp.dstport")}
    if layout.name not in fields:
        return ""
    source, destination = (cells.texts(FIELDS[name], rows)[0] for name in fields[layout.name])
    return f"  {source} → {destination}"


def _joined_text(content: bytes) -> str:
    if len(content) == 16:
        return address.text(int.from_bytes(content[:8], "big"), int.from_bytes(content[8:], "big"))
    return content.hex(":")


def _value(layout: Layout, entry: Field, number: Any) -> tuple[str, str]:
    """Return the value of a field and what is known of its meaning."""
    if isinstance(number, np.void):
        return number.tobytes().hex(":"), ""
    if (layout.name, entry.name) in _ADDRESSES:
        return str(IPv4Address(int(number))), ""
    meaning = _MEANINGS.get((layout.name, entry.name))
    return _number(entry, int(number)), meaning(int(number)) if meaning else ""


def _number(entry: Field, number: int) -> str:
    return f"0x{number:0{2 * entry.size_bytes}x}" if entry.base == "hex" else str(number)


def _explanation(meaning: str, otherwise: str) -> list[Cell]:
    return [Cell(f"  {meaning}")] if meaning else [Cell(f"  {otherwise}", Tone.FAINT)]


def _place(at: int, content: bytes) -> Cell:
    """Return where a field is and its bytes, the first of them where it is long."""
    digits = content.hex(" ")
    if len(content) > _HEX_BYTES:
        digits = f"{content[: _HEX_BYTES - 1].hex(' ')} …"
    return Cell(f"{'':{_INDENT}}{at:04x}  {digits:<{_HEX_WIDTH}}  ", Tone.FAINT)


def _label(label: str, *, at_place: bool = False) -> Cell:
    if at_place:
        return Cell(f"{'':{_INDENT}}{label:<{_PLACE_WIDTH + _LABEL_WIDTH}}  ")
    return Cell(f"{label:<{_LABEL_WIDTH}}  ")


def _header(rows: TelegramRows, payload: bytes, payload_at: int) -> Iterator[list[Cell]]:
    telegrams = rows.telegrams
    found = telegrams.header[0]
    code = int(words.word_codes(telegrams)[0])
    belongs = "list" if code in words.LIST_CODES else "Parameter Manager, Index"
    service = words.WORD_OF_CODE[code].word
    title = f"  {service}, {belongs} {found['index']}, SubIndex {found['subindex']}"
    yield [Cell("Network variables (3S-0)", Tone.STRONG), Cell(title)]
    if remark := words.remarks(telegrams).get(0):
        sign = "✗" if remark[1] is Tone.ERROR else "!"
        yield [Cell(f"{'':{_INDENT}}{sign} {remark[0]}", remark[1])]
    payload_bytes = int(telegrams.datagram.payload_bytes[0])
    for entry in HEADER:
        begin = HEADER.offset_of(entry.name)
        end = begin + entry.size_bytes
        head = [_place(payload_at + begin, payload[begin:end]), _label(entry.label)]
        if end > len(payload):
            yield [*head, Cell("missing" if end > payload_bytes else "not captured", Tone.WARNING)]
            continue
        number = int(found[entry.name])
        yield [*head, Cell(_number(entry, number)), *_header_meaning(telegrams.fault[0], entry, number, payload_bytes)]
        if entry.bits:
            yield from _bits(entry, number)


def _header_meaning(fault: int, entry: Field, number: int, payload_bytes: int) -> list[Cell]:
    """Return what a field of the header means, and whether it is as it has to be."""
    if entry.name == "identity":
        if number == IDENTITY:
            return [Cell("  ✓", Tone.GOOD), Cell(f" {entry.help}", Tone.FAINT)]
        if number == IDENTITY_ASCII:
            return [Cell("  ! begins with the character 0, not with a binary zero", Tone.WARNING)]
        return [Cell("  ✗ not the identity of a telegram", Tone.WARNING)]
    if entry.name == "length":
        if number == payload_bytes:
            return [Cell("  ✓", Tone.GOOD), Cell(" as the UDP payload")]
        hint = ", as this with its bytes swapped" if fault == Fault.BYTE_SWAPPED else ""
        return [Cell(f"  ✗ the UDP payload has {units.count_of(payload_bytes, 'byte')}{hint}", Tone.ERROR)]
    if entry.values:
        name = entry.values.get(number)
        return [Cell(f"  {name}")] if name else [Cell(f"  ✗ unknown {entry.help}", Tone.ERROR)]
    return _explanation("", entry.help)


def _bits(entry: Field, number: int) -> Iterator[list[Cell]]:
    """Yield a line for each named bit, and one for those without a name where any of them is set."""
    width = 8 * entry.size_bytes
    margin = Cell(" " * (_INDENT + _PLACE_WIDTH + 2))
    for bit in entry.bits:
        tone = Tone.PLAIN if number & bit.mask else Tone.FAINT
        state = "set" if number & bit.mask else "not set"
        yield [margin, Cell(f"{_picture(number, bit.mask, width)} = {bit.label} ({state})", tone)]
    unnamed = RESERVED_FLAGS & number
    if unnamed:
        yield [margin, Cell(f"{_picture(number, RESERVED_FLAGS, width)} = {entry.help}", Tone.WARNING)]


def _picture(number: int, mask: int, width: int) -> str:
    """Return ``.... ..1.``: the bits of a mask, with points for the others."""
    places = [str(number >> place & 1) if mask >> place & 1 else "." for place in reversed(range(width))]
    return " ".join("".join(places[at : at + 4]) for at in range(0, width, 4))
