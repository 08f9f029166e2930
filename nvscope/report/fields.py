"""The fields that -Y and -e may name: for people at a terminal, and as JSON."""

from __future__ import annotations

from typing import Any

from nvscope.report.ansi import paint
from nvscope.units import count_of
from nvscope.version import head
from nvscope.view.escape import visible_document
from nvscope.view.fields.frame import EITHER_OF, expression_names
from nvscope.view.fields.vocabulary import Vocabulary
from nvscope.view.lines.table import GAP, Cell, Line, Tone, wrap
from nvscope.view.lines.text_width import display_width

_MIN_WIDTH = 40


def render(fields: Vocabulary, *, colour: bool = False, width: int = 80) -> str:
    """Return a table of all fields: name, type, what it is; and how many variables are not in it."""
    entries = visible_document(document(fields))["fields"]
    widths = [max(display_width(entry[key]) for entry in entries) + GAP for key in ("name", "type")]
    lines: list[Line] = []
    room = max(width, _MIN_WIDTH)
    for name, kind, meaning in [
        ("field", "type", "meaning"),
        *((entry["name"], entry["type"], f"{entry['label']}: {entry['help']}") for entry in entries),
    ]:
        tone = Tone.STRONG if lines else Tone.FAINT
        head = [Cell(name + " " * (widths[0] - display_width(name)), tone), Cell(kind.ljust(widths[1]))]
        lines += wrap([*head, Cell(meaning)], room, hanging=min(sum(widths), room // 2))
    if left := fields.unlisted:
        told = f"{count_of(left, 'further element')} of lists not listed; -Y and -e know the variables all the same"
        lines += wrap([Cell(told, Tone.FAINT)], room)
    return paint(lines, colour=colour)


def document(fields: Vocabulary) -> dict[str, Any]:
    """Return all fields as data (schema ``nvscope.fields/1``), with an object for each.

    ``filter`` and ``output`` tell whether -Y and -e may name it, ``judged`` whether it is known only when the whole
    capture was read. ``unlisted`` is how many elements of lists are not gone through: their fields may be named too.
    """
    names = expression_names(fields)
    own = [
        {
            "name": field.name,
            "type": field.type.value,
            "label": field.label,
            "help": field.help,
            "filter": not names[field.name].refused,
            "output": not field.judged,
            "judged": field.judged,
        }
        for field in fields.values()
        if not field.refused
    ]
    either = [
        {
            "name": name,
            "type": fields[parts[0]].type.value,
            "label": "Either side",
            "help": f"for -Y: {' or '.join(parts)}",
            "filter": True,
            "output": False,
            "judged": False,
        }
        for name, parts in EITHER_OF.items()
    ]
    return {**head("nvscope.fields/1"), "fields": own + either, "unlisted": fields.unlisted}
