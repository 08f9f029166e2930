"""One frame as a tree: every field of every layer with its place, its bytes, its value, and what that means.

Names, places and explanations come from the tables of the layers (``dissectors.layout.Layout``) and of the fields
(``nvscope.view.fields.frame``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from ipaddress import IPv4Address
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from dissectors import address
from dissectors.batch import I64
from dissectors.headers import TCP, TYPE_ARP, TYPE_IPV4, TYPE_IPV6, VLAN_TYPES
from dissectors.icmp import IP_PROTOCOLS
from dissectors.layout import Field, Layout
from nvscope import units
from nvscope.expression.typed_columns import FieldType
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines import cells, moments
from nvscope.view.lines.fit import cut
from nvscope.view.lines.layers import Layer, values
from nvscope.view.lines.shown import MakeTree, Spans, Wording
from nvscope.view.lines.table import Cell, Line, Tone
from nvscope.view.lines.tree_lines import (
    INDENT,
    LABEL_WIDTH,
    Entry,
    Place,
    bytes_entries,
    field_entry,
    number_text,
    title_entry,
)
from nvscope.view.rows.frames import FrameRows

_FRAME_LABEL_WIDTH = 38
_MARGIN, _MARGIN_OF_BITS = Cell(" " * INDENT), Cell(" " * 2 * INDENT)

_JOINED = {
    ("eth", "group"): ("destination_rest", "Destination"),
    ("ipv6", "source_hi"): ("source_lo", "Source"),
    ("ipv6", "destination_hi"): ("destination_lo", "Destination"),
}
"""Fields that are one to people: the field that follows, and what both together are called."""

_ETHERTYPES = {TYPE_IPV4: "IPv4", TYPE_ARP: "ARP", TYPE_IPV6: "IPv6", **dict.fromkeys(VLAN_TYPES, "VLAN tag")}
_DIRECTIONS = {0: "to this host", 1: "broadcast", 2: "multicast", 3: "to another host", 4: "sent by this host"}
_DONT_FRAGMENT = 0x4000

_MEANINGS: Mapping[tuple[str, str], Callable[[int], str]] = {
    **{(layer, "type"): lambda number: _ETHERTYPES.get(number, "") for layer in ("eth", "vlan", "sll", "sll2")},
    **{(layer, "packet_type"): lambda number: _DIRECTIONS.get(number, "") for layer in ("sll", "sll2")},
    ("vlan", "tci"): lambda number: f"VLAN {number & 0xFFF}, priority {number >> 13}",
    ("ip", "version_ihl"): lambda number: f"version {number >> 4}, {(number & 15) * 4} bytes",
    ("ip", "fragment"): lambda number: "do not fragment" if number & _DONT_FRAGMENT else "may be fragmented",
    ("ip", "protocol"): lambda number: IP_PROTOCOLS.get(number, ""),
    ("ipv6", "version"): lambda number: f"version {number >> 4}",
    ("ipv6", "next"): lambda number: IP_PROTOCOLS.get(number, ""),
    ("udp", "checksum"): lambda number: "not verified" if number else "none",
    ("tcp", "offset"): lambda number: f"{(number >> 4) * 4} bytes",
    ("tcp", "flags"): lambda number: ", ".join(bit.name for bit in TCP["flags"].bits if number >> bit.position & 1),
}
"""What numbers of a layer mean; where nothing stands here, the table's explanation does."""

_ENDS = {"ip": ("ip.src", "ip.dst"), "ipv6": ("ip.src", "ip.dst"), "udp": ("udp.srcport", "udp.dstport")}
"""From where to where: the fields that tell, by the layer that does."""

_FRAME_FIELDS = tuple(name for name in FIELDS if name.startswith("frame."))

_ADDRESSES = {("ip", "source"), ("ip", "destination")}


class PlacedLine(NamedTuple):
    """A line of a tree, and what its ``Entry`` knows; ``is_carrier``: it is about what carries the message."""

    line: Line
    place: Place | None
    title: str
    tells_place: bool
    is_carrier: bool


class Trees:
    """The trees of a piece of frames, in lines not wider than ``width`` (None: as wide as it takes).

    Places are offsets from the start of the frame, in hexadecimal digits, as in a dump of it. Without ``dumps``, what
    has no fields is told in its length only. ``make`` has what makes the tree of each protocol.
    """

    def __init__(
        self,
        rows: FrameRows,
        make: Mapping[str, MakeTree],
        wording: Wording,
        width: int | None = None,
        *,
        dumps: bool = True,
    ) -> None:
        self._rows = rows
        self._trees = {name: make[name](rows, wording, dumps=dumps) for name in rows.protocols if name in rows.parts}
        self._places = {name: _places(rows, name) for name in self._trees}
        self._width = width
        self._dumps = dumps
        self._texts = {name: cells.texts(FIELDS[name], rows) for name in (*_FRAME_FIELDS, *chain(*_ENDS.values()))}
        self._local = moments.clock(rows.ts_ns, 6, utc=False, date=True)

    def spans(self, row: int) -> Spans:
        """Return where in its packet what was found in a frame lies."""
        name = self._rows.name_of(row)
        return self._trees[name].spans(int(self._places[name][row]))

    def lines(self, row: int) -> Iterator[Line]:
        """Yield the tree of one frame."""
        return (placed.line for placed in self.placed_lines(row))

    def placed_lines(self, row: int, *, beside_bytes: bool = False) -> Iterator[PlacedLine]:
        """Yield the tree of one frame with the bytes that its lines are about.

        ``beside_bytes``: these are seen beside it, so that places and bytes are left out of the lines.
        """
        width = self._width
        for entry, is_carrier in self._entries(row, LABEL_WIDTH if beside_bytes else _FRAME_LABEL_WIDTH):
            line, explanation = entry.cells, f"  {entry.help}"
            tells = entry.tells_place and not beside_bytes
            if beside_bytes and (entry.tells_place or len(line[0].text) - len(line[0].text.lstrip()) > INDENT):
                line = [_MARGIN if entry.tells_place else _MARGIN_OF_BITS, *line[1:]]
            # Half of an explanation explains nothing.
            if entry.help and (width is None or sum(len(cell.text) for cell in line) + len(explanation) <= width):
                line = [*line, Cell(explanation, Tone.FAINT)]
            yield PlacedLine(line if width is None else cut(line, width), entry.place, entry.title, tells, is_carrier)

    def _entries(self, row: int, label_width: int) -> Iterator[tuple[Entry, bool]]:
        """Yield the entries of a frame, each with whether it is about what carries the message."""
        packets, at, name = self._rows.packets, int(self._rows.row[row]), self._rows.name_of(row)
        packet, tree, place = packets.packet(at), self._trees[name], int(self._places[name][row])
        yield from ((entry, True) for entry in self._frame(row, len(packet), label_width))
        for layer in tree.layers(place, packet, int(packets.link[at])):
            yield from ((entry, True) for entry in self._layer(row, packet, layer))
        yield from ((entry, False) for entry in tree.entries(place, packet))

    def _frame(self, row: int, size_bytes: int, label_width: int) -> Iterator[Entry]:
        yield title_entry("Frame", (), Place(0, size_bytes), f"Frame {self._texts['frame.number'][row]}")
        for name in _FRAME_FIELDS[1:]:
            field = FIELDS[name]
            unit = " s" if field.type is FieldType.DURATION else ""
            line = [Cell(f"{'':{INDENT}}{field.label:<{label_width}}  {self._texts[name][row]}{unit}")]
            yield Entry(line, f"{self._local[row]} local time" if field.calendar else "")

    def _layer(self, row: int, packet: bytes, layer: Layer) -> Iterator[Entry]:
        layout = layer.layout
        if layout is None:
            content = packet[layer.start : layer.stop]
            facts = [Cell(f"  {units.count_of(len(content), 'byte')}")]
            yield from bytes_entries("Options", facts, content, layer.start, dumps=self._dumps)
            return
        ends = _ENDS.get(layout.name)
        title = f"  {' → '.join(self._texts[name][row] for name in ends)}" if ends else ""
        yield title_entry(layout.title, [Cell(title)], Place(layer.start, layer.stop))
        found = values(packet, layer)
        entries = iter(layout)
        for entry in entries:
            at = layer.start + layout.offset_of(entry.name)
            joined = _JOINED.get((layout.name, entry.name))
            if joined:
                content = packet[at : at + entry.size_bytes + next(entries).size_bytes]
                yield field_entry(at, content, joined[1], [Cell(_joined_text(content))])
            else:
                content = packet[at : at + entry.size_bytes]
                value, meaning = _value(layout, entry, found[entry.name])
                told = [Cell(f"{value}  {meaning}" if meaning else value)]
                yield field_entry(at, content, entry.label, told, "" if meaning else entry.help)


def _places(rows: FrameRows, name: str) -> I64:
    """Return the position of each row in the part of a protocol, -1 where it is of another one."""
    at = rows.parts[name].positions(len(rows))
    places = np.full(len(rows), -1)
    places[at] = np.arange(len(at))
    return places


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
