"""The tree of a message that is a table of fields at the start of the payload of UDP or TCP."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

from dissectors.layout import Layout
from nvscope import units
from nvscope.view.lines.table import Cell, Tone
from nvscope.view.lines.transport_tree import TransportTree
from nvscope.view.lines.tree_lines import (
    Entry,
    Place,
    bit_entries,
    bytes_entries,
    field_entry,
    number_text,
    title_entry,
    trailer_entries,
)
from nvscope.view.rows.frames import FrameRows


class MessageTree(TransportTree):
    """A ``Tree`` of messages of the protocol ``name``, whose part has their ``datagram`` or ``segment``.

    The title of ``layout`` stands above its fields; what is behind them is data.
    """

    def __init__(self, rows: FrameRows, name: str, layout: Layout, *, dumps: bool = True) -> None:
        super().__init__(rows, name, layout.size_bytes)
        self._layout = layout
        self._dumps = dumps

    def entries(self, place: int, packet: bytes) -> Iterator[Entry]:
        start, data, stop, _ = self.spans(place)
        yield title_entry(self._layout.title, (), Place(start, data))
        yield from table_entries(self._layout, packet, start, stop)
        if data < stop:
            facts = [Cell(f"  {units.count_of(stop - data, 'byte')}")]
            yield from bytes_entries("Data", facts, packet[data:stop], data, dumps=self._dumps)
        yield from trailer_entries(packet, stop, dumps=self._dumps)


def table_entries(
    layout: Layout, packet: bytes, start: int, stop: int,
    tell: Mapping[str, Callable[[int], str]] = MappingProxyType({}),
) -> Iterator[Entry]:  # fmt: skip
    """Yield a line for each field of a table that begins at ``start`` of a packet, and was captured up to ``stop``.

    ``tell`` writes the numbers of some fields, by name.
    """
    for entry in layout:
        begin = start + layout.offset_of(entry.name)
        content = packet[begin : max(begin, min(begin + entry.size_bytes, stop))]
        if len(content) < entry.size_bytes:
            yield field_entry(begin, content, entry.label, [Cell("missing, or not captured", Tone.WARNING)])
            continue
        if entry.dtype.startswith("V"):
            yield field_entry(begin, content, entry.label, [Cell(content.hex(":"))], entry.help)
            continue
        number = int.from_bytes(content, "big" if entry.dtype.startswith(">") else "little")
        named = f"  {entry.values[number]}" if number in entry.values else ""
        text = tell[entry.name](number) if entry.name in tell else number_text(entry, number)
        yield field_entry(begin, content, entry.label, [Cell(f"{text}{named}")], "" if named else entry.help)
        if entry.bits:
            yield from bit_entries(entry, number, begin)
