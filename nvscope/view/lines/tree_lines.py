"""The lines that trees are made of: a field with its place and bytes, a bit, a title."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from dissectors.layout import Field
from nvscope.units import count_of
from nvscope.view.escape import visible
from nvscope.view.lines.hexdump import PER_LINE, dump
from nvscope.view.lines.table import Cell, Tone

if TYPE_CHECKING:
    from nvscope.definition.packing import TelegramLayout

INDENT = 2
SHOWN_BYTES = 6
"""So many bytes a line tells; of more of them, one less."""

BYTES_AT = INDENT + 4 + 2
"""The column in which they begin."""

VARIABLES = "Variables"
"""The title above those of a list."""

_DIGITS_WIDTH = 3 * SHOWN_BYTES - 1
LABEL_WIDTH = 22


class Place(NamedTuple):
    """Which bytes of its packet a line is about: from one to before another."""

    start: int
    stop: int


class Entry(NamedTuple):
    """A line of a tree, and an explanation for where there is room for one.

    ``place`` are the bytes that it is about, None of what stands in no byte. ``title`` is what the lines that follow it
    are part of, "" where it is one of these. ``tells_place``: its first cell is the place, which may be left out where
    the bytes are seen anyway.
    """

    cells: list[Cell]
    help: str = ""
    place: Place | None = None
    title: str = ""
    tells_place: bool = False


def title_entry(title: str, facts: Sequence[Cell], place: Place | None = None, told: str = "") -> Entry:
    """Return a line with what the lines that follow it are part of; ``told`` is what it is called in it, else so."""
    return Entry([Cell(told or title, Tone.STRONG), *facts], "", place, title)


def field_entry(at: int, content: bytes, label: str, told: Sequence[Cell], help_text: str = "") -> Entry:
    """Return the line of a field that begins at ``at`` of its packet."""
    place = Place(at, at + len(content)) if content else None
    return Entry([place_cell(at, content), label_cell(label), *told], help_text, place, tells_place=True)


def place_cell(at: int, content: bytes) -> Cell:
    """Return where a field is and its bytes, the first of them where it is long."""
    digits = content.hex(" ")
    if len(content) > SHOWN_BYTES:
        digits = f"{content[: SHOWN_BYTES - 1].hex(' ')} …"
    return Cell(f"{'':{INDENT}}{at:04x}  {digits:<{_DIGITS_WIDTH}}  ", Tone.FAINT)


def label_cell(label: str) -> Cell:
    return Cell(f"{label:<{LABEL_WIDTH}}  ")


def number_text(entry: Field, number: int) -> str:
    return f"0x{number:0{2 * entry.size_bytes}x}" if entry.base == "hex" else str(number)


def bit_entries(entry: Field, number: int, at: int, reserved: int = 0) -> Iterator[Entry]:
    """Yield a line for each named bit, and one for those without a name where any of them is set.

    The field begins at ``at`` of its packet.
    """
    place = Place(at, at + entry.size_bytes)
    width = 8 * entry.size_bytes
    margin = Cell(" " * (INDENT + 4 + 2))
    for bit in entry.bits:
        tone = Tone.PLAIN if number & bit.mask else Tone.FAINT
        state = "set" if number & bit.mask else "not set"
        yield Entry([margin, Cell(f"{_picture(number, bit.mask, width)} = {bit.label} ({state})", tone)], "", place)
    if number & reserved:
        yield Entry([margin, Cell(f"{_picture(number, reserved, width)} = {entry.help}", Tone.WARNING)], "", place)


def bytes_entries(title: str, facts: Sequence[Cell], content: bytes, first: int, *, dumps: bool) -> Iterator[Entry]:
    """Yield bytes without fields: title and facts, and, with ``dumps``, the bytes, from ``first`` of the packet on."""
    stop = first + len(content)
    yield title_entry(title, facts, Place(first, stop))
    if dumps:
        for at, line in enumerate(dump(content, indent=INDENT, first=first)):
            begin = first + at * PER_LINE
            yield Entry(list(line), "", Place(begin, min(begin + PER_LINE, stop)))


def trailer_entries(packet: bytes, stop: int, *, dumps: bool) -> Iterator[Entry]:
    """Yield the bytes of a packet behind its datagram, which ends at ``stop``; nothing where there are none."""
    if stop < len(packet):
        facts = [Cell(f"  {count_of(len(packet) - stop, 'byte')} behind the datagram")]
        yield from bytes_entries("Trailer", facts, packet[stop:], stop, dumps=dumps)


def variable_entries(layout: TelegramLayout, data: bytes, data_at: int) -> Iterator[Entry]:
    """Yield the variables of a telegram, whose data begin at ``data_at`` of the packet and have the layout's size."""
    # Not without definitions.
    from nvscope.definition.variables import type_text  # noqa: PLC0415
    from nvscope.view.value_texts import value_text  # noqa: PLC0415

    for offset, element in layout.spans():
        raw = data[offset : offset + element.type.size_bytes]
        value = Cell(visible(value_text(element.type, raw)))
        yield field_entry(data_at + offset, raw, visible(element.name), [value], visible(type_text(element.type)))


def _picture(number: int, mask: int, width: int) -> str:
    """Return ``.... ..1.``: the bits of a mask, with points for the others."""
    places = [str(number >> place & 1) if mask >> place & 1 else "." for place in reversed(range(width))]
    return " ".join("".join(places[at : at + 4]) for at in range(0, width, 4))
