"""One telegram as a tree: every field of every layer with its place, its bytes, its value, and what that means.

Names, places and explanations come from the tables of the layers (``dissectors.layout.Layout``) and of the fields
(``nvscope.view.fields.frame``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from ipaddress import IPv4Address
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors import address
from dissectors.headers import PROTOCOL_UDP, TYPE_IPV4, TYPE_IPV6, VLAN_TYPES
from dissectors.layout import Field, Layout
from dissectors.netvar import HEADER, IDENTITY, IDENTITY_ASCII, RESERVED_FLAGS, Fault, Service
from nvscope import units
from nvscope.expression.columns import FieldType
from nvscope.findings.definition import DEFINITION_MISMATCH
from nvscope.view.escape import visible
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines import cells, moments, words
from nvscope.view.lines.can_tree import CanTree
from nvscope.view.lines.fit import cut
from nvscope.view.lines.hexdump import dump
from nvscope.view.lines.layers import Layer, layers, link_layers, values
from nvscope.view.lines.table import Cell, Line, Tone
from nvscope.view.lines.tree_lines import (
    INDENT,
    Entry,
    bit_entries,
    label_cell,
    number_text,
    place_cell,
    variable_entries,
)
from nvscope.view.rows.frames import TelegramRows

if TYPE_CHECKING:
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.pdos import Pdos

_FRAME_LABEL_WIDTH = 38

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
    ("ip", "version_ihl"): lambda number: f"version {number >> 4}, {(number & 15) * 4} bytes",
    ("ip", "fragment"): lambda number: "do not fragment" if number & _DONT_FRAGMENT else "may be fragmented",
    ("ip", "protocol"): lambda number: "UDP" if number == PROTOCOL_UDP else "",
    ("ipv6", "version"): lambda number: f"version {number >> 4}",
    ("ipv6", "next"): lambda number: "UDP" if number == PROTOCOL_UDP else "",
    ("udp", "checksum"): lambda number: "not verified" if number else "none",
}
"""What numbers of a layer mean; where nothing stands here, the table's explanation does."""

_ENDS = {"ip": ("ip.src", "ip.dst"), "ipv6": ("ip.src", "ip.dst"), "udp": ("udp.srcport", "udp.dstport")}
"""From where to where: the fields that tell, by the layer that does."""

_FRAME_FIELDS = tuple(name for name in FIELDS if name.startswith("frame."))

_ADDRESSES = {("ip", "source"), ("ip", "destination")}


class Trees:
    """The trees of a piece of telegrams, in lines not wider than ``width`` (None: as wide as it takes).

    Places are offsets from the start of the frame, in hexadecimal digits, as in a dump of it. Without ``dumps``, what
    has no fields is told in its length only. With ``layouts`` the data of defined lists are variables; ``pdos`` are
    those on CAN.
    """

    def __init__(
        self,
        rows: TelegramRows,
        width: int | None = None,
        *,
        dumps: bool = True,
        layouts: Layouts | None = None,
        pdos: Pdos | None = None,
    ) -> None:
        self._rows = rows
        self._can = None if rows.can is None else CanTree(rows.can, pdos, dumps=dumps)
        self._layouts = layouts
        self._width = width
        self._dumps = dumps
        self._texts = {name: cells.texts(FIELDS[name], rows) for name in (*_FRAME_FIELDS, *chain(*_ENDS.values()))}
        self._local = moments.clock(rows.telegrams.ts_ns, 6, utc=False, date=True)
        self._codes = words.word_codes(rows.telegrams).tolist()
        self._remarks = words.remarks(rows.telegrams)

    def lines(self, row: int) -> Iterator[Line]:
        """Yield the tree of one telegram."""
        width = self._width
        for entry in self._entries(row):
            line, explanation = entry.cells, f"  {entry.help}"
            # Half of an explanation explains nothing.
            if entry.help and (width is None or sum(len(cell.text) for cell in line) + len(explanation) <= width):
                line = [*line, Cell(explanation, Tone.FAINT)]
            yield line if width is None else cut(line, width)

    def _entries(self, row: int) -> Iterator[Entry]:
        packets, datagram = self._rows.packets, self._rows.telegrams.datagram
        at = int(datagram.row[row])
        packet = packets.packet(at)
        if self._can is not None and self._rows.can is not None and self._rows.can.on_can[row]:
            frame_at = self._can.frame_at(row, int(packets.offset[at]))
            yield from self._frame(row)
            for layer in link_layers(packet, int(packets.link[at]), frame_at):
                yield from self._layer(row, packet, layer)
            yield from self._can.entries(row, packet, frame_at)
            return
        payload_at = int(datagram.payload[row] - packets.offset[at])
        payload_bytes, captured_bytes = int(datagram.payload_bytes[row]), int(datagram.captured_bytes[row])
        payload_end, data_at = payload_at + captured_bytes, payload_at + HEADER.size_bytes
        yield from self._frame(row)
        for layer in layers(packet, int(packets.link[at]), payload_at):
            yield from self._layer(row, packet, layer)
        yield from self._header(row, packet[payload_at:payload_end], payload_at, payload_bytes)
        if payload_end > data_at:
            facts = [Cell(f"  {units.count_of(payload_end - data_at, 'byte')}")]
            if payload_bytes > captured_bytes:
                facts.append(Cell(f", {units.count(payload_bytes - captured_bytes)} more not captured", Tone.WARNING))
            yield from self._variables(row, packet[data_at:payload_end], data_at) or self._bytes(
                "Data", facts, packet[data_at:payload_end], data_at
            )
        if payload_end < len(packet):
            facts = [Cell(f"  {units.count_of(len(packet) - payload_end, 'byte')} behind the datagram")]
            yield from self._bytes("Trailer", facts, packet[payload_end:], payload_end)

    def _frame(self, row: int) -> Iterator[Entry]:
        yield Entry([Cell(f"Frame {self._texts['frame.number'][row]}", Tone.STRONG)])
        for name in _FRAME_FIELDS[1:]:
            field = FIELDS[name]
            unit = " s" if field.type is FieldType.DURATION else ""
            line = [Cell(f"{'':{INDENT}}{field.label:<{_FRAME_LABEL_WIDTH}}  {self._texts[name][row]}{unit}")]
            yield Entry(line, f"{self._local[row]} local time" if field.calendar else "")

    def _layer(self, row: int, packet: bytes, layer: Layer) -> Iterator[Entry]:
        layout = layer.layout
        if layout is None:
            content = packet[layer.start : layer.stop]
            yield from self._bytes("Options", [Cell(f"  {units.count_of(len(content), 'byte')}")], content, layer.start)
            return
        ends = _ENDS.get(layout.name)
        title = f"  {' → '.join(self._texts[name][row] for name in ends)}" if ends else ""
        yield Entry([Cell(_TITLES[layout.name], Tone.STRONG), Cell(title)])
        found = values(packet, layer)
        entries = iter(layout)
        for entry in entries:
            at = layer.start + layout.offset_of(entry.name)
            joined = _JOINED.get((layout.name, entry.name))
            if joined:
                content = packet[at : at + entry.size_bytes + next(entries).size_bytes]
                yield Entry([place_cell(at, content), label_cell(joined[1]), Cell(_joined_text(content))])
            else:
                content = packet[at : at + entry.size_bytes]
                value, meaning = _value(layout, entry, found[entry.name])
                line = [
                    place_cell(at, content),
                    label_cell(entry.label),
                    Cell(f"{value}  {meaning}" if meaning else value),
                ]
                yield Entry(line, "" if meaning else entry.help)

    def _header(self, row: int, payload: bytes, payload_at: int, payload_bytes: int) -> Iterator[Entry]:
        found, code = self._rows.telegrams.header[row], self._codes[row]
        belongs = "Parameter Manager, Index" if code in words.PARAMETER_CODES else "list"
        title = f"  {words.WORD_OF_CODE[code].word}, {belongs} {found['index']}, SubIndex {found['subindex']}"
        yield Entry([Cell("Network variables (3S-0)", Tone.STRONG), Cell(title)])
        if remark := self._remarks.get(row):
            sign = "✗" if remark[1] is Tone.ERROR else "!"
            yield Entry([Cell(f"{'':{INDENT}}{sign} {remark[0]}", remark[1])])
        for entry in HEADER:
            begin = HEADER.offset_of(entry.name)
            end = begin + entry.size_bytes
            head = [place_cell(payload_at + begin, payload[begin:end]), label_cell(entry.label)]
            if end > len(payload):
                yield Entry([*head, Cell("missing" if end > payload_bytes else "not captured", Tone.WARNING)])
                continue
            number = int(found[entry.name])
            verdict = _verdict(entry, number, payload_bytes)
            checked = any(cell.tone is not Tone.GOOD for cell in verdict)
            yield Entry([*head, Cell(number_text(entry, number)), *verdict], "" if checked else entry.help)
            if entry.bits:
                yield from bit_entries(entry, number, RESERVED_FLAGS)

    def _variables(self, row: int, data: bytes, data_at: int) -> list[Entry]:
        """Return the variables of a data telegram of a defined list; none where there is no definition that fits."""
        telegrams = self._rows.telegrams
        header, port = telegrams.header[row], int(telegrams.datagram.destination_port[row])
        if self._layouts is None or telegrams.fault[row] != Fault.NONE or header["id"] != Service.ODStateFree:
            return []
        known = self._layouts.list_of(port, int(header["index"]))
        if known is None:
            return []
        shape = int(header["items"]), int(header["length"])
        layout = self._layouts.telegram_of(port, int(header["index"]), int(header["subindex"]), shape)
        known = layout.list if layout else known
        if layout and shape != (layout.items, layout.length):
            layout = None
        title = Cell("Variables", Tone.STRONG)
        if layout is None or len(data) < layout.layout.size_bytes:
            why = "cut short by the capture"
            if not layout:
                why = f"not of the shape that its definition has ({DEFINITION_MISMATCH.code})"
            return [
                Entry([title, Cell(f"  {visible(known.name)}: {why}", Tone.WARNING)]),
                *self._bytes("Data", [Cell(f"  {units.count_of(len(data), 'byte')}")], data, data_at),
            ]
        return [Entry([title, Cell(f"  {visible(known.name)}")]), *variable_entries(layout, data, data_at)]

    def _bytes(self, title: str, facts: Sequence[Cell], content: bytes, first: int) -> Iterator[Entry]:
        yield Entry([Cell(title, Tone.STRONG), *facts])
        if self._dumps:
            for line in dump(content, indent=INDENT, first=first):
                yield Entry(list(line))


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
    return number_text(entry, int(number)), meaning(int(number)) if meaning else ""


def _verdict(entry: Field, number: int, payload_bytes: int) -> list[Cell]:
    """Return what a number of the header means, and whether it is as it has to be, where that can be told."""
    if entry.name == "identity":
        if number == IDENTITY:
            return [Cell("  ✓", Tone.GOOD)]
        if number == IDENTITY_ASCII:
            return [Cell("  ! begins with 30, the character 0, not with 00", Tone.WARNING)]
        return [Cell("  ! not the identity of a telegram", Tone.WARNING)]
    if entry.name == "length":
        if number == payload_bytes:
            return [Cell("  ✓", Tone.GOOD), Cell(" as the UDP payload")]
        swapped = int.from_bytes(number.to_bytes(entry.size_bytes, "little"), "big")
        hint = ", this with its bytes swapped" if swapped == payload_bytes else ""
        return [Cell(f"  ✗ the UDP payload has {units.count(payload_bytes)}{hint}", Tone.ERROR)]
    if entry.values:
        name = entry.values.get(number)
        return [Cell(f"  {name}")] if name else [Cell(f"  ✗ unknown {entry.help}", Tone.ERROR)]
    return []
