"""What is watched, for dumb terminals and files: the table from time to time, and what begins or ends when it does."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nvscope import units
from nvscope.analysis.news import is_over
from nvscope.report.ansi import paint
from nvscope.view.escape import visible, visible_document
from nvscope.view.lines.plant import content, happenings, strips, transactions
from nvscope.view.lines.plant.content import Report
from nvscope.view.lines.plant.tables import cells
from nvscope.view.lines.table import Cell, Line, Tone, aligned, fitting, heading, table_line, wrap

if TYPE_CHECKING:
    from nvscope.analysis.news import Told
    from nvscope.causes.cause import Cause
    from nvscope.causes.chronicle import Chronicle

MIN_WIDTH = 40
STRIP_NS = 120_000_000_000
"""So much time the strips show at most."""

MOST_PAIRS = 20
"""So many pairs are shown, the worst of them."""

_UNDER_MARKS = 3


def table(
    report: Report, chronicle: Chronicle | None, pairs: Sequence[Mapping[str, Any]] = (), *, per_s: float | None = None,
    colour: bool = False, width: int = 80, utc: bool = False,
) -> str:  # fmt: skip
    """Return the verdict, a row a list and one a pair, as text of at most ``width`` columns, ending with an empty line.

    ``pairs`` are those of ``nvscope.watch/1``.
    """
    shown, width = visible_document(report), max(width, MIN_WIDTH)
    return paint([*_table(shown, chronicle, visible_document(pairs), per_s, width, utc), []], colour=colour)


def _table(
    report: Report, chronicle: Chronicle | None, pairs: Sequence[Mapping[str, Any]], per_s: float | None, width: int,
    utc: bool,
) -> Iterator[Line]:  # fmt: skip
    mark, told = happenings.headline(report)
    clock = content.Clock.of(report, utc=utc)
    until_ns = content.watched_until_ns(report["capture"])
    facts = [] if until_ns is None else [clock.second(until_ns)]
    if per_s is not None:
        facts.append(units.rate(per_s))
    drops = report["capture"]["drops"]
    if drops:
        facts.append(f"{units.count(drops)} dropped")
    head = [Cell(f"{mark.text} ", mark.tone), Cell(told, Tone.STRONG), *(Cell(f" · {fact}") for fact in facts)]
    yield from wrap(head, width, hanging=2)
    if report["lists"]:
        found = strips.strips(report, chronicle, width)
        yield from aligned(found.columns, found.rows, width)
        if legend := strips.legend(found.marks):
            yield from wrap([Cell(legend, Tone.FAINT)], width, _UNDER_MARKS)
        if found.left:
            yield from wrap([Cell(strips.left_out(found, "report -v"))], width, _UNDER_MARKS)
    if pairs:
        yield from _pairs(pairs, until_ns or 0, width)


def _pairs(pairs: Sequence[Mapping[str, Any]], until_ns: int, width: int) -> Iterator[Line]:
    """Yield the table of who asks whom; columns for which there is no room are seen on the screen."""
    measures, rows = transactions.pair_table(pairs, until_ns)
    columns = [measure.column for measure in measures]
    shown = [cells(measures, row) for row in rows[:MOST_PAIRS]]
    found = fitting(columns, shown, width)
    yield heading(columns, found)
    yield from (table_line(columns, found, row) for row in shown)
    if len(rows) > len(shown):
        left = units.count(len(rows) - len(shown))
        yield from wrap([Cell(f"… and {left} more pairs: report -v shows all")], width, _UNDER_MARKS)


def news(
    told: Told, at_ns: int | None, *, colour: bool = False, width: int = 80, utc: bool = False
) -> str:  # fmt: skip
    """Return what began and what is over, a paragraph each, as text; "" where that is nothing."""
    when = "" if at_ns is None else f"{units.clock_time(at_ns, utc=utc).partition('.')[0]} "
    lines: list[Line] = []
    width = max(width, MIN_WIDTH)
    for cause in told.new:
        lines += _of_cause(cause, when, width)
    begun = {id(cause) for cause in told.new}
    for cause, heir in zip(told.ended, told.instead, strict=True):
        if id(cause) not in begun:
            mark, over = ("● ", "over") if is_over(cause, heir) else ("→ ", _what_became(heir))
            ended = [Cell(when, Tone.FAINT), Cell(mark, Tone.GOOD), Cell(f"{visible(cause.title)}: {over}")]
            lines += wrap(ended, width, hanging=len(when) + 2)
    return paint(lines, colour=colour) if lines else ""


def _what_became(heir: Cause | None) -> str:
    """Return how to tell that what followed shows a cause to have been none."""
    return "no longer told: what followed explains it" if heir is None else f"now told as: {visible(heir.title)}"


def _of_cause(cause: Cause, when: str, width: int) -> Iterator[Line]:
    mark, indent = happenings.symbol(cause.severity), len(when) + 2
    title = [Cell(when, Tone.FAINT), Cell(f"{mark.text} ", mark.tone), Cell(visible(cause.title), Tone.STRONG)]
    yield from wrap(title, width, hanging=indent)
    for fact in cause.checked[:3]:
        yield from wrap([Cell("✓ ", Tone.GOOD), Cell(visible(fact))], width, indent, indent + 2)
    yield from wrap([Cell("Next  ", Tone.STRONG), Cell(visible(cause.next))], width, indent, indent + 6)
