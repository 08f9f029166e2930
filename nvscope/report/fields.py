"""The fields that -Y and -e may name: for people at a terminal, and as JSON."""

from __future__ import annotations

from typing import Any

from nvscope.report.ansi import paint
from nvscope.view.fields import EITHER_OF, EXPRESSION_NAMES, FIELDS
from nvscope.view.table import Cell, Column, Tone, align

_MIN_WIDTH = 40


def render(*, colour: bool = False, width: int = 80) -> str:
    """Return a table of all fields: name, type, what it is."""
    columns = [Column("field"), Column("type"), Column("meaning", shortest=16)]
    rows = [[Cell(name, Tone.STRONG), Cell(kind), Cell(f"{label}: {text}")] for name, kind, label, text in _entries()]
    return paint(align(columns, rows, max(width, _MIN_WIDTH)), colour=colour)


def document() -> dict[str, Any]:
    """Return all fields as data (schema ``nvscope.fields/1``), with an object for each.

    ``filter`` and ``output`` tell whether -Y and -e may name it.
    """
    fields = [
        {
            "name": name,
            "type": kind,
            "label": label,
            "help": text,
            "filter": not EXPRESSION_NAMES[name].refused,
            "output": name in FIELDS,
        }
        for name, kind, label, text in _entries()
    ]
    return {"schema": "nvscope.fields/1", "fields": fields}


def _entries() -> list[tuple[str, str, str, str]]:
    own = [(field.name, field.type.value, field.label, field.help) for field in FIELDS.values()]
    either = [
        (name, FIELDS[parts[0]].type.value, "Either side", f"for -Y: {' or '.join(parts)}")
        for name, parts in EITHER_OF.items()
    ]
    return own + either
