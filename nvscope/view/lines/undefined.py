"""What is said where no value can be shown: why, what to do, and which lists are there all the same."""

from __future__ import annotations

from itertools import islice
from typing import Any

from nvscope import units
from nvscope.view.lines.plant.content import Report, node_names
from nvscope.view.lines.plant.tables import OVERVIEW, looked_at
from nvscope.view.lines.table import Cell, Column, Line, Tone, align, wrap

_HOW = (
    "Name the files that the PLC project exports with --gvl FILE, or in nvscope.toml as "
    'definitions = ["plc/**/*.gvl"]. Without such files, `nvscope vars FILE --infer` proposes layouts from a capture.'
)
_NOT_DEFINED = f"No list is defined, so that nobody knows which variables there are. {_HOW}"
_NOT_COME = (
    "No telegram of a defined list was decoded: compare identifiers and ports of the definition files with these lists."
)
_NOT_THIS = f"No value of this list: its variables are not defined, or nothing of it could be decoded. {_HOW}"
_MOST_LISTS = 100
_CELLS = {measure.column.title: measure.cell for measure in OVERVIEW}
_TITLES = ("sender", "interval", "sent")
_COLUMNS = (
    Column("list", identifier=True),
    Column("sender", shortest=9, identifier=True, importance=2),
    Column("interval", right=True, importance=1),
    Column("sent", right=True, importance=1),
)


def no_values(report: Report, only: str | None, defined: bool, width: int) -> list[Line]:
    """Return why there is no value, in lines of at most ``width`` columns; the report is visible already.

    ``only`` is the key of the list that was asked for, None for all. ``defined``: there are lists with variables.
    """
    told = _NOT_THIS if only is not None else _NOT_COME if defined else _NOT_DEFINED
    lines: list[Line] = [*wrap([Cell(told)], width, 1), []]
    count = len(report["lists"])
    if not count:
        return [*lines, [Cell(" No list was seen yet.", Tone.FAINT)]]
    names = node_names(report)
    rows = [_row(entry, names) for entry in islice(report["lists"], _MOST_LISTS)]
    lines += [[Cell(f" {units.count_of(count, 'list')} seen", Tone.STRONG)], *align(_COLUMNS, rows, width, 1)]
    if count > _MOST_LISTS:
        lines.append([Cell(f" {units.count(count - _MOST_LISTS)} more", Tone.FAINT)])
    return lines


def _row(entry: Any, names: Any) -> list[Cell]:
    looked = looked_at(entry, names)
    called = f"{units.list_key(entry['key'])} {entry['name'] or ''}".strip()
    return [Cell(called), *(_CELLS[title](looked) for title in _TITLES)]
