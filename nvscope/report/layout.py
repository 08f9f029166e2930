"""The byte maps of defined lists for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from nvscope import units
from nvscope.report.ansi import paint
from nvscope.report.list_words import list_and_port
from nvscope.view.escape import visible_document
from nvscope.view.lines.table import Cell, Column, Line, Tone, align, wrap

MIN_WIDTH = 40
_ASSUMED = "How lists are packed on CAN is described nowhere: this is the rule of UDP with 8 bytes a frame."

_COLUMNS = (
    Column("Offset", right=True),
    Column("Bytes", right=True),
    Column("Variable", shortest=12, identifier=True),
    Column("Type", shortest=8),
)


def render(document: Mapping[str, Any], *, colour: bool = False, width: int = 80, wide: bool = False) -> str:
    """Return byte maps (schema ``nvscope.layout/1``) as text of at most ``width`` columns, ending with a line break."""
    return paint(_lines(visible_document(document)["lists"], max(width, MIN_WIDTH), wide), colour=colour)


def _lines(lists: list[Mapping[str, Any]], width: int, wide: bool) -> Iterator[Line]:
    if not lists:
        text = "The files define types only: name the file of a list too."
        yield from wrap([Cell(text, Tone.WARNING)], width)
    for number, entry in enumerate(lists):
        if number:
            yield []
        yield from wrap([Cell(entry["name"], Tone.STRONG), Cell(f": {_summary(entry)}")], width, hanging=2)
        if entry["assumed"]:
            yield from wrap([Cell(_ASSUMED, Tone.WARNING)], width, 2)
        for telegram in entry["telegrams"]:
            yield []
            items, length = _known(telegram["items"]), _known(telegram["length"])
            head = f"SubIndex {telegram['subindex']}: Items {items}, Length {length}"
            if telegram["subindex"] is None:
                first = telegram["elements"][0]["name"]
                head = f"From {first} on, nobody knows what lies in which telegram, and where:"
            elif "cob_id" in telegram:
                cob_id = "?" if telegram["cob_id"] is None else units.cob_id(telegram["cob_id"])
                head = f"COB-ID {cob_id}: DLC {_known(telegram['length'])}"
            yield from wrap([Cell(head)], width, 2)
            rows = [
                [
                    Cell(_known(element["offset"])),
                    Cell(_known(element["bytes"])),
                    Cell(element["name"]),
                    Cell(element["type"], Tone.FAINT),
                ]
                for element in telegram["elements"]
            ]
            yield from align(_COLUMNS, rows, None if wide else width, 2)


def _summary(entry: Mapping[str, Any]) -> str:
    parts = [list_and_port(entry)]
    parts.append("packed" if entry["pack"] else "a telegram a variable")
    if entry["interval_ns"] is not None:
        parts.append(f"every {units.duration(entry['interval_ns'])}")
    telegrams = units.count_of(len(entry["telegrams"]), "telegram")
    if entry["unknown"] is not None:
        parts.append(f"nobody knows how many bytes {entry['unknown']} has")
    else:
        parts.append(f"{units.data_size(entry['data_bytes'])} in {telegrams}")
    return ", ".join(parts) + "."


def _known(number: int | None) -> str:
    return "?" if number is None else str(number)
