"""What is known of one variable, a fact a line."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from nvscope import units
from nvscope.list_key import Transport
from nvscope.view.escape import visible
from nvscope.view.lines.table import NOTHING, Cell, Line, Tone, wrap
from nvscope.view.lines.variable_rows import VariableRow

if TYPE_CHECKING:
    from nvscope.view.lines.read_rows import ReadRow
    from nvscope.view.lines.variable_rows import AnyRow

_INDENT = 12
_MOST_BYTES = 16


def details(
    row: AnyRow, sender: str, nominal_ns: int | None, moment: Callable[[int], str], width: int
) -> list[Line]:  # fmt: skip
    """Return the facts on a variable in lines of at most ``width`` columns.

    ``sender`` is visible already; ``moment`` writes a time. ``nominal_ns`` is the interval of its stream, None where
    nobody knows.
    """
    last = f"the last at {moment(row.last_ns)}, frame {units.count(row.last_frame)}"
    whence = _of_stream(row, sender, nominal_ns, last) if isinstance(row, VariableRow) else _of_read(row, sender, last)
    changed = f"{units.count_of(row.changes, 'time')}, last at {moment(row.changed_ns)}" if row.changes else "never"
    facts = [("Value", visible(row.text)), ("Type", visible(row.type_text)), *whence, ("Changed", changed)]
    if row.bounds is not None:
        facts.append(("Between", " and ".join(visible(text) for text in row.bounds)))
    if isinstance(row, VariableRow) and row.group.earlier:
        facts.append(("Shape", "of before: telegrams that came later have another one"))
    lines: list[Line] = [[Cell(f" {visible(row.name)}", Tone.STRONG)]]
    for title, text in facts:
        first, *others = wrap([Cell(text)], width, _INDENT)
        lines += [[Cell(f" {title:<{_INDENT - 1}}", Tone.FAINT), *first[1:]], *others]
    return lines


_Facts = list[tuple[str, str]]


def _of_stream(row: VariableRow, sender: str, nominal_ns: int | None, last: str) -> _Facts:
    key, known, on_can = row.group.key, row.known, row.group.key.list.transport is Transport.CAN
    place = f"{'frame' if on_can else 'SubIndex'} {key.subindex}, byte {row.offset_bytes}"
    came = units.count_of(known.telegrams, "frame" if on_can else "telegram")
    if nominal_ns:
        came += f", every {units.duration(nominal_ns)}"
    listed = f"{visible(units.list_key(str(key.list)))} {visible(known.layout.list.name)}".strip()
    return [
        ("List", listed + (", packed as assumed" if on_can else f" from {sender}")),
        ("Place", f"{place}: {_bytes(row.raw)}"),
        ("Came", f"{came}; {last}"),
    ]


def _of_read(row: ReadRow, sender: str, last: str) -> _Facts:
    holder = row.group.seen.holder.capitalize()
    facts = [(holder, visible(row.group.listed) + (f", {sender}" if sender not in (NOTHING, row.sender) else ""))]
    if row.place:
        facts.append(("Place", visible(row.place)))
    failed = f", {units.count(row.unreadable)} more without a value" if row.unreadable else ""
    return [*facts, ("Read", f"{units.count_of(row.readings, 'time')}{failed}; {last}")]


def _bytes(raw: bytes) -> str:
    """Return the bytes of a value, the first of many."""
    more = f" … {units.count_of(len(raw), 'byte')}" if len(raw) > _MOST_BYTES else ""
    return raw[:_MOST_BYTES].hex(" ") + more
