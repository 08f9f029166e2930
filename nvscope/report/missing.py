"""What is missing of what is defined, for people: what it is, why as far as one knows, and what to change.

Takes the rows of ``missing`` in reports and in the variables of a capture. As in ``content``, nothing is escaped here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from nvscope import units
from nvscope.report.content import Row, severity_of, status
from nvscope.view.lines.table import Cell, Line, Tone, wrap
from nvscope.view.missing_kinds import NEVER_CHANGED

TITLE = "Missing"
MOST = 8
"""So many entries are shown unless all are wanted."""

_MOST_RESTING = 3
"""Of more lists than these, variables that never change are one entry."""

_MOST_NAMED = 4


class Entry(NamedTuple):
    """One thing that is missing; ``why`` is "" where nobody knows."""

    mark: Cell
    what: str
    why: str
    next: str


def entries(rows: Sequence[Row], *, every: bool = False) -> tuple[list[Entry], int]:
    """Return what is shown, and how many rows are not; ``every`` one, each by itself, or the first ones."""
    resting = [row for row in rows if row["kind"] == NEVER_CHANGED]
    if every or len(resting) <= _MOST_RESTING:
        found = [_entry(row) for row in rows]
    else:
        found = [_entry(row) for row in rows if row["kind"] != NEVER_CHANGED]
        found.append(_folded(resting))
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
    return Entry(_mark(row), row["what"], row["why"] or _named(row), row["next"])


def _mark(row: Row) -> Cell:
    told = status(severity_of(row["severity"]))
    return Cell(told.text[0], told.tone)


def _named(row: Row) -> str:
    """Return the first variables that a row names."""
    shown = row["variables"][:_MOST_NAMED]
    return _together(shown, len(row["variables"]) - len(shown) + row["variables_cut"])


def _folded(rows: Sequence[Row]) -> Entry:
    number = sum(len(row["variables"]) + row["variables_cut"] for row in rows)
    what = f"{units.count_of(number, 'variable')} of {units.count_of(len(rows), 'list')} never changed, others did"
    lists = [row["list_name"] or units.list_key(row["lists"][0]) for row in rows[:_MOST_NAMED]]
    return Entry(_mark(rows[0]), what, _together(lists, len(rows) - len(lists)), rows[0]["next"])


def _together(names: Sequence[str], more: int) -> str:
    return f"{', '.join(names)}{f' and {units.count(more)} more' if more else ''}"
