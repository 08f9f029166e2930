"""What is missing of what is defined, for people: what it is, why as far as one knows, and what to change.

Takes the rows of ``missing`` in reports and in the variables of a capture. As in ``content``, nothing is escaped here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from nvscope import units
from nvscope.enumeration import first_few
from nvscope.view.lines.plant.content import Row
from nvscope.view.lines.plant.happenings import severity_of, symbol
from nvscope.view.lines.table import Cell, Line, Tone, wrap
from nvscope.view.missing_kinds import NEVER_CHANGED, NEVER_SEEN

TITLE = "Missing"
MOST = 8
"""So many entries are shown unless all are wanted."""

_MOST_ALIKE = 3
"""Of more lists than these of which the same is said, it is said once."""

_MOST_NAMED = 4


class Entry(NamedTuple):
    """One thing that is missing; ``why`` is "" where nobody knows."""

    mark: Cell
    what: str
    why: str
    next: str


def entries(rows: Sequence[Row], *, every: bool = False) -> tuple[list[Entry], int]:
    """Return what is shown, and how many entries are not; ``every`` row by itself, or the first ones, folded."""
    alike: dict[tuple[str, str | None, str], list[Row]] = {}
    for row in rows:
        alike.setdefault((row["kind"], row["why"], row["next"]), []).append(row)
    found = []
    for own in alike.values():
        if every or len(own) <= _MOST_ALIKE or own[0]["kind"] not in (NEVER_SEEN, NEVER_CHANGED):
            found += [_entry(row) for row in own]
        else:
            found.append(_folded(own))
    shown = found if every else found[:MOST]
    return shown, len(found) - len(shown)


def left_out(left: int) -> str:
    """Return what is said of entries that are not shown."""
    return f"{units.count(left)} more: --json has all."


def lines(rows: Sequence[Row], width: int, *, every: bool = False) -> Iterator[Line]:
    """Yield the section, in lines of at most ``width`` columns; nothing where nothing is missing."""
    shown, left = entries(rows, every=every)
    if not shown:
        return
    yield [Cell(TITLE, Tone.STRONG)]
    for entry in shown:
        cells = [Cell(f"{entry.mark.text} ", entry.mark.tone), Cell(entry.what, Tone.STRONG)]
        cells.append(Cell(f"{f': {entry.why}' if entry.why else ''}. {entry.next}"))
        yield from wrap(cells, width, 0, 2)
    if left:
        yield from wrap([Cell(left_out(left), Tone.FAINT)], width, 2)


def _entry(row: Row) -> Entry:
    return Entry(symbol(severity_of(row)), row["what"], row["why"] or _named(row), row["next"])


def _named(row: Row) -> str:
    """Return the first variables that a row names."""
    variables = row["variables"]
    return first_few(variables, _MOST_NAMED, of=len(variables) + row["variables_cut"])


def _folded(rows: Sequence[Row]) -> Entry:
    lists = units.count_of(len(rows), "list")
    names = [row["list_name"] or units.list_key(row["lists"][0]) for row in rows]
    what = f"{lists} were never seen"
    if rows[0]["kind"] == NEVER_CHANGED:
        number = sum(len(row["variables"]) + row["variables_cut"] for row in rows)
        what = f"{units.count_of(number, 'variable')} of {lists} never changed, others did"
    return Entry(symbol(severity_of(rows[0])), what, first_few(names, _MOST_NAMED), rows[0]["next"])
