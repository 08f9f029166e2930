"""Proposed layouts for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from nvscope import units
from nvscope.enumeration import first_few
from nvscope.report.ansi import paint
from nvscope.view.escape import visible_document
from nvscope.view.lines.table import Cell, Column, Line, Tone, align, wrap

MIN_WIDTH = 40

Row = Mapping[str, Any]

_COLUMNS = (
    Column("Offset", right=True),
    Column("Bytes", right=True, importance=1),
    Column("Type"),
    Column("Grade"),
    Column("Evidence", shortest=16),
    Column("Or", importance=0),
)
_UNPACKED = (Column("SubIndex", right=True), *_COLUMNS[1:])
_TONES = {"sure": Tone.GOOD, "likely": Tone.PLAIN, "guess": Tone.WARNING}
_WORTH_TELLING_BITS = 7.0
_MOST_FIELDS_TOLD = 6


def render(document: Row, *, colour: bool = False, width: int = 80, wide: bool = False) -> str:
    """Return proposals (schema ``nvscope.infer/1``) as text of at most ``width`` columns, ending with a line break."""
    return paint(_lines(visible_document(document), max(width, MIN_WIDTH), wide), colour=colour)


def _lines(document: Row, width: int, wide: bool) -> Iterator[Line]:
    lists = document["lists"]
    if not lists:
        told = "No data telegram was found: there is nothing to propose."
        if document["on_can"]:
            told = (
                "Nothing is proposed of lists on CAN: without Items, nothing tells how many variables a frame carries. "
                "Name their exported lists with --gvl FILE."
            )
        yield from wrap([Cell(told, Tone.WARNING)], width)
        return
    for number, entry in enumerate(lists):
        if number:
            yield []
        yield from wrap(
            [Cell(units.list_key(entry["list"]), Tone.STRONG), Cell(f" from {entry['sender']}: {_summary(entry)}")],
            width,
        )
        if entry["problem"]:
            yield from wrap([Cell(f"A draft would not fit: {entry['problem']}.", Tone.WARNING)], width, 2)
        telegrams = entry["telegrams"]
        if not entry["pack"]:
            rows = [
                [Cell(str(telegram["subindex"])), *_cells(field)[1:]]
                for telegram in telegrams
                for field in _fields(telegram)
            ]
            yield from align(_UNPACKED, rows, None if wide else width, 2)
            continue
        for telegram in telegrams:
            yield []
            yield from _telegram(telegram, width, wide)
    if document["left_out"]:
        yield []
        told = f"{units.count_of(document['left_out'], 'telegram')} of further streams or shapes were not looked at."
        yield from wrap([Cell(told, Tone.WARNING)], width)


def _summary(entry: Row) -> str:
    telegrams = units.count_of(len(entry["telegrams"]), "telegram")
    parts = [
        f"{telegrams} a cycle"
        if entry["pack"]
        else f"not packed, {units.count_of(len(entry['telegrams']), 'variable')}"
    ]
    if entry["interval_ns"] is not None:
        parts.append(f"every {units.duration(entry['interval_ns'])}")
    grades = [field["grade"] for telegram in entry["telegrams"] for field in _fields(telegram)]
    parts += [f"{grades.count(grade)} {grade}" for grade in _TONES if grade in grades]
    return ", ".join(parts) + "."


def _fields(telegram: Row) -> Sequence[Row]:
    return telegram["layouts"][0]["fields"] if telegram["layouts"] else ()


def _telegram(telegram: Row, width: int, wide: bool) -> Iterator[Line]:
    head = f"SubIndex {telegram['subindex']}: Items {telegram['items']}, Length {telegram['length']}, "
    head += units.count_of(telegram["telegrams"], "telegram")
    if telegram["looked_at"] < telegram["telegrams"]:
        head += f", {units.count(telegram['looked_at'])} looked at"
    yield from wrap([Cell(head)], width, 2)
    if telegram["other_shapes"]:
        others = units.count_of(telegram["other_shapes"], "other shape")
        told = f"It was also seen in {others} (Items or Length); this is the commonest."
        yield from wrap([Cell(told, Tone.WARNING)], width, 2)
    if telegram["reason"]:
        yield from wrap([Cell(f"Nothing is proposed: {telegram['reason']}.", Tone.WARNING)], width, 2)
        return
    yield from align(_COLUMNS, [_cells(field) for field in _fields(telegram)], None if wide else width, 2)
    best = {(field["offset"], field["bytes"]) for field in _fields(telegram)}
    for layout in telegram["layouts"][1:]:
        if layout["behind_bits"] > _WORTH_TELLING_BITS:
            continue
        other = [field for field in layout["fields"] if (field["offset"], field["bytes"]) not in best]
        shown = first_few([f"{field['offset']} {field['type']}" for field in other], _MOST_FIELDS_TOLD)
        told = f"Nearly as plausible ({layout['behind_bits']:.1f} bits behind): {shown}."
        yield from wrap([Cell(told, Tone.FAINT)], width, 2, 4)


def _cells(field: Row) -> list[Cell]:
    return [
        Cell(str(field["offset"])),
        Cell(str(field["bytes"])),
        Cell(field["type"], Tone.STRONG),
        Cell(field["grade"], _TONES[field["grade"]]),
        Cell(field["evidence"]),
        Cell(", ".join(field["others"]), Tone.FAINT),
    ]
