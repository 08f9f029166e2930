"""The variables of a capture as a table for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

from nvscope import units
from nvscope.report.ansi import paint
from nvscope.report.content import nanoseconds
from nvscope.view.escape import visible, visible_document
from nvscope.view.table import Cell, Column, Line, Tone, align, wrap

MIN_WIDTH = 40
_NOTHING_CAME = "No telegram of a defined list was found: compare the identifiers and ports of the definition files."

_COLUMNS = (
    Column("Variable", shortest=12),
    Column("Value", shortest=8),
    Column("Type", importance=1),
    Column("Changed", importance=4),
    Column("Changes", right=True, importance=5),
    Column("Min", right=True, importance=3),
    Column("Max", right=True, importance=2),
)


def render(
    document: Mapping[str, Any],
    *,
    colour: bool = False,
    width: int = 80,
    utc: bool = False,
    node_names: Mapping[str, str] = MappingProxyType({}),
    some_came: bool = False,
) -> str:
    """Return variables (schema ``nvscope.vars/1``) as text of at most ``width`` columns, ending with a line break.

    Senders are called by ``node_names``, where these have one by their address. ``some_came``: if there are none, it is
    not because no telegram came.
    """
    names = {node: visible(name) for node, name in node_names.items()}
    rows = visible_document(document)["variables"]
    if not rows:
        missing = "Telegrams of defined lists came, but none that could be decoded." if some_came else _NOTHING_CAME
        return paint(wrap([Cell(missing, Tone.WARNING)], max(width, MIN_WIDTH)), colour=colour)
    return paint(_lines(rows, max(width, MIN_WIDTH), utc, names), colour=colour)


def _lines(rows: list[Mapping[str, Any]], width: int, utc: bool, names: Mapping[str, str]) -> Iterator[Line]:
    groups: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["list"], row["list_name"], row["sender"]), []).append(row)
    for number, ((key, name, sender), members) in enumerate(groups.items()):
        if number:
            yield []
        title = [Cell(f"{key} {name}", Tone.STRONG), Cell(f" from {names.get(sender, sender)}, ")]
        yield from wrap([*title, Cell(units.count_of(max(row["telegrams"] for row in members), "telegram"))], width)
        yield from align(_COLUMNS, [_cells(row, utc) for row in members], width, 2)


def _cells(row: Mapping[str, Any], utc: bool) -> list[Cell]:
    changed = nanoseconds(row["changed_ns"]) or 0
    return [
        Cell(row["name"]),
        Cell(row["text"], Tone.STRONG),
        Cell(row["type"], Tone.FAINT),
        Cell(units.clock_time(changed, utc=utc) if row["changes"] else "never"),
        Cell(units.count(row["changes"])),
        Cell(row["min_text"] or "-"),
        Cell(row["max_text"] or "-"),
    ]
