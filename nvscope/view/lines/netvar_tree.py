"""What a tree tells of a telegram: header with what is wrong in it, and its data, as variables where they are."""

from __future__ import annotations

from collections.abc import Iterator

from dissectors.layout import Field
from dissectors.netvar import HEADER, IDENTITY, IDENTITY_ASCII, RESERVED_FLAGS, Fault, Service, TelegramBatch
from nvscope import units
from nvscope.findings.definition import DEFINITION_MISMATCH
from nvscope.list_key import ListKey
from nvscope.view.escape import visible
from nvscope.view.lines import words
from nvscope.view.lines.parameter_names import parameter_of
from nvscope.view.lines.shown import Wording
from nvscope.view.lines.table import Cell, Tone
from nvscope.view.lines.transport_tree import TransportTree
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
    trailer_entries,
    variable_entries,
)
from nvscope.view.rows.frames import NETVAR, FrameRows

_OF_PARAMETERS = {"index": "of the parameter", "subindex": "of the parameter", "items": "elements of its value"}
"""What numbers of the header are where no list is meant."""
_WITH_VALUE = (Service.ODWriteRequest, Service.ODReadRequestReply)


class TelegramTree(TransportTree):
    """The part of a tree that is about a telegram on UDP, as a ``Tree``; ``wording`` has the defined lists."""

    def __init__(self, rows: FrameRows, wording: Wording, *, dumps: bool = True) -> None:
        super().__init__(rows, NETVAR, HEADER.size_bytes)
        self._telegrams: TelegramBatch = rows.parts[NETVAR].part
        self._layouts = wording.layouts
        self._parameters = wording.parameters
        self._dumps = dumps
        self._codes = words.word_codes(self._telegrams).tolist()
        self._remarks = words.remarks(self._telegrams)

    def entries(self, place: int, packet: bytes) -> Iterator[Entry]:
        start, _, stop, _ = self.spans(place)
        payload_bytes, data_at = int(self._over.payload_bytes[place]), start + HEADER.size_bytes
        yield from self._header(place, packet[start:stop], start, payload_bytes)
        if stop > data_at:
            facts = [Cell(f"  {units.count_of(stop - data_at, 'byte')}")]
            if payload_bytes > stop - start:
                missing = units.count(payload_bytes - (stop - start))
                facts.append(Cell(f", {missing} more not captured", Tone.WARNING))
            data = packet[data_at:stop]
            known = self._value(place, data, data_at) or self._variables(place, data, data_at)
            yield from known or bytes_entries("Data", facts, data, data_at, dumps=self._dumps)
        yield from trailer_entries(packet, stop, dumps=self._dumps)

    def _header(self, row: int, payload: bytes, payload_at: int, payload_bytes: int) -> Iterator[Entry]:
        found, code = self._telegrams.header[row], self._codes[row]
        index, subindex = int(found["index"]), int(found["subindex"])
        if code in words.PARAMETER_CODES:
            known = parameter_of(self._parameters, self._telegrams, row)
            name = f"{visible(known.name)}, " if known and known.name else ""
            belongs = f"Parameter Manager, {name}Index 0x{index:04x}, SubIndex {subindex}"
        else:
            belongs = f"list {index}, SubIndex {subindex}"
        title = f"  {words.WORD_OF_CODE[code].word}, {belongs}"
        yield title_entry(
            HEADER.title, [Cell(title)], Place(payload_at, payload_at + min(len(payload), HEADER.size_bytes))
        )
        if remark := self._remarks.get(row):
            sign = "✗" if remark[1] is Tone.ERROR else "!"
            yield Entry([Cell(f"{'':{INDENT}}{sign} {remark[0]}", remark[1])])
        for entry in HEADER:
            begin = HEADER.offset_of(entry.name)
            end = begin + entry.size_bytes
            at, content = payload_at + begin, payload[begin:end]
            if end > len(payload):
                missing = Cell("missing" if end > payload_bytes else "not captured", Tone.WARNING)
                yield field_entry(at, content, entry.label, [missing])
                continue
            number = int(found[entry.name])
            verdict = _verdict(entry, number, payload_bytes)
            checked = any(cell.tone is not Tone.GOOD for cell in verdict)
            told = [Cell(number_text(entry, number)), *verdict]
            help_text = _OF_PARAMETERS.get(entry.name, entry.help) if code in words.PARAMETER_CODES else entry.help
            yield field_entry(at, content, entry.label, told, "" if checked else help_text)
            if entry.bits:
                yield from bit_entries(entry, number, at, RESERVED_FLAGS)

    def _value(self, row: int, data: bytes, data_at: int) -> list[Entry]:
        """Return the value that is written, or was read; none where its type is not known."""
        header = self._telegrams.header[row]
        if self._telegrams.fault[row] != Fault.NONE or header["id"] not in _WITH_VALUE:
            return []
        known = parameter_of(self._parameters, self._telegrams, row)
        if known is None or known.type is None:
            return []
        from nvscope.definition.parameter_layout import parameter_layout  # noqa: PLC0415
        from nvscope.definition.variables import type_text  # noqa: PLC0415

        size_bytes = int(header["length"]) - HEADER.size_bytes
        name = known.name or units.parameter(known.index, known.subindex)
        layout = parameter_layout(known, name, int(header["items"]), size_bytes)
        place = Place(data_at, data_at + len(data))
        if layout is None or len(data) < size_bytes:
            why = (
                "cut short by the capture"
                if layout
                else f"not of the type that it should have, {visible(type_text(known.type))}"
            )
            return [
                title_entry("Value", [Cell(f"  {visible(name)}: {why}", Tone.WARNING)], place),
                *bytes_entries(
                    "Data", [Cell(f"  {units.count_of(len(data), 'byte')}")], data, data_at, dumps=self._dumps
                ),
            ]
        return [title_entry("Value", [Cell("")], place), *variable_entries(layout, data, data_at)]

    def _variables(self, row: int, data: bytes, data_at: int) -> list[Entry]:
        """Return the variables of a data telegram of a defined list; none where there is no definition that fits."""
        telegrams = self._telegrams
        header, port = telegrams.header[row], int(telegrams.datagram.destination_port[row])
        if self._layouts is None or telegrams.fault[row] != Fault.NONE or header["id"] != Service.ODStateFree:
            return []
        key = ListKey.udp(port, int(header["index"]))
        known = self._layouts.list_of(key)
        if known is None:
            return []
        shape = int(header["items"]), int(header["length"]) - HEADER.size_bytes
        layout = self._layouts.telegram_of(key, int(header["subindex"]), shape)
        known = layout.list if layout else known
        if layout and shape != layout.shape:
            layout = None
        title, place = VARIABLES, Place(data_at, data_at + len(data))
        if layout is None or len(data) < layout.layout.size_bytes:
            why = "cut short by the capture"
            if not layout:
                partly = bool(self._layouts.partly_of(key))
                why = (
                    "not even of the shape that the known part of its definition has"
                    if partly
                    else f"not of the shape that its definition has ({DEFINITION_MISMATCH.code})"
                )
            return [
                title_entry(title, [Cell(f"  {visible(known.name)}: {why}", Tone.WARNING)], place),
                *bytes_entries(
                    "Data", [Cell(f"  {units.count_of(len(data), 'byte')}")], data, data_at, dumps=self._dumps
                ),
            ]
        head = title_entry(title, [Cell(f"  {visible(known.name)}")], place)
        return [head, *variable_entries(layout, data, data_at)]


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
