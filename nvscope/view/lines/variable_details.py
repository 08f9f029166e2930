"""What is known of one variable, a fact a line."""

from __future__ import annotations

from collections.abc import Callable

from nvscope import units
from nvscope.definition.variables import type_text
from nvscope.list_key import Transport
from nvscope.view.escape import visible
from nvscope.view.lines.table import Cell, Line, Tone, wrap
from nvscope.view.lines.variable_rows import VariableRow

_INDENT = 10
_MOST_BYTES = 16


def details(
    row: VariableRow, sender: str, nominal_ns: int | None, moment: Callable[[int], str], width: int
) -> list[Line]:  # fmt: skip
    """Return the facts on a variable in lines of at most ``width`` columns.

    ``sender`` is visible already; ``moment`` writes a time. ``nominal_ns`` is the interval of its stream, None where
    nobody knows.
    """
    key, known, on_can = row.group.key, row.known, row.group.key.list.transport is Transport.CAN
    place = f"{'frame' if on_can else 'SubIndex'} {key.subindex}, byte {row.offset_bytes}"
    came = units.count_of(known.telegrams, "frame" if on_can else "telegram")
    if nominal_ns:
        came += f", every {units.duration(nominal_ns)}"
    came += f"; the last at {moment(known.last_ns)}, frame {units.count(known.last_frame)}"
    changed = f"{units.count_of(row.changes, 'time')}, last at {moment(row.changed_ns)}" if row.changes else "never"
    listed = f"{visible(units.list_key(str(key.list)))} {visible(known.layout.list.name)}".strip()
    facts = [
        ("Value", visible(row.text)),
        ("Type", visible(type_text(row.element.type))),
        ("List", listed + (", packed as assumed" if on_can else f" from {sender}")),
        ("Place", f"{place}: {_bytes(row.raw)}"),
        ("Came", came),
        ("Changed", changed),
    ]
    if row.bounds is not None:
        facts.append(("Between", " and ".join(visible(text) for text in row.bounds)))
    if row.group.earlier:
        facts.append(("Shape", "of before: telegrams that came later have another one"))
    lines: list[Line] = [[Cell(f" {visible(row.element.name)}", Tone.STRONG)]]
    for title, text in facts:
        first, *others = wrap([Cell(text)], width, _INDENT)
        lines += [[Cell(f" {title:<{_INDENT - 1}}", Tone.FAINT), *first[1:]], *others]
    return lines


def _bytes(raw: bytes) -> str:
    """Return the bytes of a value, the first of many."""
    more = f" … {units.count_of(len(raw), 'byte')}" if len(raw) > _MOST_BYTES else ""
    return raw[:_MOST_BYTES].hex(" ") + more
