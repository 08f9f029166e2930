"""The causes for people at a terminal: each in two to five lines, what was checked, and the one next step.

Takes the causes of the report of schema ``nvscope.report/2``, already visible.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

from nvscope import units
from nvscope.findings.kind import Severity
from nvscope.view.lines.plant.content import Row
from nvscope.view.lines.plant.happenings import severity_of, symbol
from nvscope.view.lines.table import Cell, Line, Tone, wrap
from nvscope.view.lines.text_width import display_width

MOST_CAUSES = 20
"""So many are shown unless all are wanted."""

_MOST_LINES = 5
_INDENT = 5
_BETWEEN = 5
"""So far apart stand facts on one line."""

_NEXT = "Next  "


def lines(
    causes: Sequence[Row], width: int, *, every: bool = False, numbers: Sequence[int] | None = None
) -> Iterator[Line]:  # fmt: skip
    """Yield the causes, of at most ``width`` columns; ``every`` one of them, with every fact.

    ``numbers`` are those that they have elsewhere, where they are in another order there.
    """
    shown = causes if every else causes[:MOST_CAUSES]
    for number, cause in zip(numbers or range(1, len(shown) + 1), shown, strict=False):
        yield []
        yield from lines_of(number, cause, width, every=every)
    if left := len(causes) - len(shown):
        more = f"{units.count_of(left, 'cause')} more, none of more weight: -v shows all, --json and --md too."
        yield from ([], *wrap([Cell(more)], width))


def lines_of(number: int, cause: Row, width: int, *, every: bool = False) -> Iterator[Line]:
    """Yield one cause, with every fact that was checked where ``every`` one is wanted."""
    yield from _wrapped(
        number, severity_of(cause), cause["title"], cause["kind"], cause["next"], tuple(cause["checked"]), width, every
    )


@lru_cache(2048)
def _wrapped(
    number: int, severity: Severity, title: str, kind: str, step: str, checked: Sequence[str], width: int, every: bool
) -> Sequence[Line]:  # fmt: skip
    """Return the same of what a cause tells: a screen shows hundreds at each look, of which few have changed."""
    head = [symbol(severity), Cell(f" {number}".ljust(_INDENT - 2) + " "), Cell(title, Tone.STRONG)]
    first = _with_kind(wrap(head, width, hanging=_INDENT), kind, width)
    after = wrap([Cell(_NEXT, Tone.STRONG), Cell(step)], width, _INDENT, _INDENT + len(_NEXT))
    room = None if every else _MOST_LINES - len(first) - len(after)
    return (*first, *_checked(checked, width, room), *after)


def _with_kind(title: list[Line], kind: str, width: int) -> list[Line]:
    """Return a title with the name of its kind at the right, on a line of its own only where there is no room."""
    free = width - _width(title[-1])
    if free > display_width(kind):
        *before, last = title
        return [*before, [*last, Cell(" " * (free - display_width(kind))), Cell(kind, Tone.FAINT)]]
    return [*title, [Cell(" " * (width - display_width(kind))), Cell(kind, Tone.FAINT)]]


def _checked(facts: Sequence[str], width: int, most: int | None) -> list[Line]:
    """Return facts as lines, several on one as far as they fit; the first one, and of the others what has room whole.

    ``most`` are the lines that there is room for, None for as many as they need.
    """
    found: list[Line] = []
    for fact in facts:
        cells = [Cell("✓ ", Tone.GOOD), Cell(fact)]
        needed = _BETWEEN + _width(cells)
        if found and _width(found[-1]) + needed <= width:
            found[-1] = [*found[-1], Cell(" " * _BETWEEN), *cells]
            continue
        lines = wrap(cells, width, _INDENT, _INDENT + 2)
        if not found or most is None or len(found) + len(lines) <= most:
            found += lines
    return found


def _width(line: Line) -> int:
    return sum(display_width(cell.text) for cell in line)
