"""What a tree tells of a CAN frame: identifier and flags, what it means, and its data, as variables where they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from dissectors.batch import DIRECTION_NAMES
from dissectors.can.bits import Stuffing, wire_bits
from dissectors.can.frame import EXTENDED_MASK, FRAME, STANDARD_MASK, CanBatch, Fault
from dissectors.can.pdo import is_pdo
from dissectors.layout import Field
from nvscope import units
from nvscope.findings.can import DLC_MISMATCH
from nvscope.list_key import ListKey
from nvscope.view.escape import visible
from nvscope.view.lines.can_words import Meanings, flags_of, identifier_texts
from nvscope.view.lines.layers import Layer, link_layers
from nvscope.view.lines.shown import Spans, Wording
from nvscope.view.lines.table import Cell, Tone
from nvscope.view.lines.tree_lines import (
    INDENT,
    VARIABLES,
    Entry,
    Place,
    bit_entries,
    bytes_entries,
    field_entry,
    number_text,
    title_entry,
    variable_entries,
)
from nvscope.view.rows.frames import CAN, FrameRows


class CanTree:
    """The part of a tree that is about a CAN frame, as a ``Tree``; ``wording`` has the defined lists, and CANopen."""

    def __init__(self, rows: FrameRows, wording: Wording, *, dumps: bool = True) -> None:
        found = rows.parts[CAN]
        self._packet_at = rows.packets.offset[rows.row[found.positions(len(rows))]]
        self._packet_bytes = rows.packets.captured[rows.row[found.positions(len(rows))]]
        self._frames: CanBatch = found.part
        self._is_pdo = is_pdo(self._frames)
        self._channel = rows.channel
        self._pdos = wording.pdos
        self._dumps = dumps
        self._meanings = Meanings(wording)
        self._number = rows.frame_number[found.positions(len(rows))]

    def spans(self, place: int) -> Spans:
        at = int(self._frames.at[place] - self._packet_at[place])
        data = min(at, int(self._packet_bytes[place]))
        return Spans(max(data - FRAME.size_bytes, 0), data, at + int(self._frames.captured[place]))

    def layers(self, place: int, packet: bytes, link: int) -> Sequence[Layer]:
        return link_layers(packet, link, self._frame_at(place))

    def _frame_at(self, place: int) -> int:
        return max(int(self._frames.at[place] - self._packet_at[place]) - FRAME.size_bytes, 0)

    def entries(self, place: int, packet: bytes) -> Iterator[Entry]:
        at = self._frame_at(place)
        frame = self._frames.take(slice(place, place + 1))
        (identifier,) = identifier_texts(frame)
        name = self._channel(int(frame.channel[0]))
        channel = visible(name)
        kind = f", {flags}" if (flags := flags_of(frame, 0)) else ""
        bits = sum(int(column[0]) for column in wire_bits(frame, Stuffing.EXACT))
        way = DIRECTION_NAMES[int(frame.direction[0])]
        kind += f", {way}" if way else ""
        told = f"  {identifier} on {channel}{kind}" + (f", {bits} bits on the wire" if bits else "")
        yield title_entry("CAN", [Cell(told)], Place(at, at + FRAME.size_bytes))
        meaning = self._meanings.of(name, frame, 0, int(self._number[place]))
        if meaning.text:
            sign = {Tone.ERROR: "✗ ", Tone.WARNING: "! "}.get(meaning.tone, "")
            yield Entry([Cell(f"{'':{INDENT}}{sign}{meaning.text}", meaning.tone)])
        for entry in FRAME:
            begin = at + FRAME.offset_of(entry.name)
            content = packet[begin : begin + entry.size_bytes]
            if len(content) < entry.size_bytes:
                missing = Cell("not captured", Tone.WARNING)
                yield field_entry(begin, content, entry.label, [missing])
                continue
            number = _word(frame, content) if entry.name == "identifier" else int.from_bytes(content, "big")
            value = Cell(number_text(entry, number))
            yield field_entry(begin, content, entry.label, [value], entry.help)
            if _has_bits(entry, frame):
                yield from bit_entries(entry, number, begin)
        yield from self._data(frame, place, at + FRAME.size_bytes)

    def _data(self, frame: CanBatch, place: int, at: int) -> Iterator[Entry]:
        data, length = frame.payload(0), int(frame.length[0])
        if not data and (frame.remote[0] or not length):
            return
        size = f"  {units.count_of(len(data), 'byte')}"
        pdo, key = None, ListKey.can(self._channel(int(frame.channel[0])), int(frame.identifier[0]))
        if self._pdos and self._is_pdo[place] and not frame.extended[0]:
            pdo = self._pdos.pdo_of(key)
        if self._pdos and pdo is not None and pdo.layout is not None:
            fitting = self._pdos.fitting(key, length)
            if fitting is not None and fitting.layout is not None and len(data) == length:
                title = (
                    f"  {visible(fitting.list.name)} {pdo.subindex}, packed as assumed: "
                    "nothing documents the rule on CAN"
                )
                yield title_entry(VARIABLES, [Cell(title)], Place(at, at + len(data)))
                yield from variable_entries(fitting.layout, data, at)
                return
            told = units.count_of(pdo.layout.layout.size_bytes, "byte")
            why = "not captured whole"
            if fitting is None and pdo.unknown:
                why = "not even of the shape that the known part of its definition has"
            elif fitting is None:
                why = f"not of the {told} that its definition has ({DLC_MISMATCH.code})"
            told_why = Cell(f"  {visible(pdo.list.name)}: {why}", Tone.WARNING)
            yield title_entry(VARIABLES, [told_why], Place(at, at + len(data)))
        missing = length - len(data) if frame.fault[0] in (Fault.NONE, Fault.TRUNCATED, Fault.TOO_LONG) else 0
        facts = [Cell(size)]
        if missing > 0:
            facts.append(Cell(f", {units.count(missing)} more not captured", Tone.WARNING))
        yield from bytes_entries("Data", facts, data, at, dumps=self._dumps)


def _word(frame: CanBatch, content: bytes) -> int:
    """Return the identifier with its flags, as the number it is in whatever byte order it was captured."""
    word = int(frame.identifier[0])
    told = EXTENDED_MASK if frame.extended[0] or frame.error[0] else STANDARD_MASK
    for number in (int.from_bytes(content, "big"), int.from_bytes(content, "little")):
        if number & told == word:
            return number
    return word


def _has_bits(entry: Field, frame: CanBatch) -> bool:
    """Tell whether the bits of a field are worth a line each: those of CAN FD only in its frames."""
    return bool(entry.bits) and (entry.name != "fd_flags" or bool(frame.fd[0]))
