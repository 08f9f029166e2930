"""The audit for people: can it be trusted, what is wrong and where, how the time is covered, and each variable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from nvscope import units
from nvscope.datalogger.audit.audit import Audit, AuditedTable
from nvscope.datalogger.audit.time_strip import drawn, legend
from nvscope.datalogger.audit.values import Figures, Value
from nvscope.datalogger.audit.words import Names, about, coverage, groups, place, shown_value, told_of_files, verdict
from nvscope.findings.kind import Severity
from nvscope.view.escape import visible
from nvscope.view.lines.table import NO_BREAK, Cell, Column, Line, Tone, align, wrap
from nvscope.view.lines.text_width import display_width

SYMBOLS = {
    None: Cell("✗", Tone.ERROR),
    Severity.ERROR: Cell("✗", Tone.ERROR),
    Severity.WARNING: Cell("!", Tone.WARNING),
    Severity.NOTE: Cell("·", Tone.NOTE),
}
"""What stands in front of a finding, by how bad it is."""

_GOOD = Cell("●", Tone.GOOD)
_INDENT = 2
_LONGEST_STRIP = 100
_MOST_VARIABLES = 40

_COLUMNS = (
    Column("variable", shortest=12, identifier=True),
    Column("stored", right=True),
    Column("changes", right=True),
    Column("unknown", right=True, importance=4),
    Column("first", right=True, importance=1),
    Column("last", right=True, importance=3),
    Column("least", right=True, importance=2),
    Column("greatest", right=True, importance=2),
)
_VALUES = slice(4, 8)
_SHORTEST_TEXT = 8


def lines(audit: Audit, width: int, *, wide: bool = False, every: bool = False) -> Iterator[Line]:
    """Yield all that people want to know, in at most ``width`` columns; tables as wide as they need if ``wide``."""
    severity, sentence = verdict(audit)
    symbol = _GOOD if severity is Severity.NOTE else SYMBOLS[severity]
    yield from wrap([symbol, Cell(" "), Cell(sentence, Tone.STRONG)], width, hanging=_INDENT)
    for bad, told in told_of_files(audit.files):
        tone = Tone.ERROR if bad is Severity.ERROR else Tone.PLAIN
        yield from wrap([Cell(visible(told), tone)], width, _INDENT, 2 * _INDENT)
    for note in audit.notes:
        yield from wrap([Cell(visible(note), Tone.FAINT)], width, _INDENT, 2 * _INDENT)
    for group in groups(audit):
        yield []
        head = f"{group.kind.code} {group.kind.name}"
        yield from wrap([SYMBOLS[group.severity], Cell(" "), Cell(head, Tone.STRONG)], width, hanging=_INDENT)
        for finding in group.shown:
            yield from wrap([Cell(visible(finding.message))], width, 2 * _INDENT, 2 * _INDENT)
            yield from wrap([Cell(visible(place(finding, audit.name_of)), Tone.FAINT)], width, 2 * _INDENT, 3 * _INDENT)
        if group.more:
            yield from wrap([Cell(group.more, Tone.FAINT)], width, 2 * _INDENT, 2 * _INDENT)
        yield from wrap([Cell(f"Next  {group.findings[0].next_step}")], width, 2 * _INDENT, 5 * _INDENT)
    if audit.left_out:
        left = units.count_of(audit.left_out, "finding")
        yield from wrap([Cell(f"{left} more are not kept", Tone.WARNING)], width, _INDENT)
    for table in audit.tables:
        yield []
        yield from _table(table, audit.name_of, width, wide=wide, every=every)


def _table(table: AuditedTable, names: Names, width: int, *, wide: bool, every: bool) -> Iterator[Line]:
    named, *rest = (visible(part) for part in about(table, names))
    head = [Cell(named, Tone.STRONG), Cell("".join(f" · {part}" for part in rest))]
    yield from [head] if wide else wrap(head, width, hanging=_INDENT)
    if told := coverage(table):
        yield from wrap([Cell(told)], width, _INDENT, _INDENT)
    yield from _strip(table, width)
    variables = list(zip(table.audit.table.variables, table.audit.figures, strict=True))
    shown = variables if every else variables[:_MOST_VARIABLES]
    if not shown:
        return
    rows = [
        [
            Cell(visible(variable.name)),
            Cell(units.count(figures.stored)),
            Cell(units.count(figures.changes)),
            Cell(units.percent(figures.unknown, figures.rows) if figures.unknown else "0"),
            *(Cell(visible(shown_value(value)) or "-") for value in _values(figures)),
        ]
        for variable, figures in shown
    ]
    columns = _columns([_values(figures) for _, figures in shown])
    yield from align(columns, rows, None if wide else width, _INDENT)
    if len(shown) < len(variables):
        left = units.count_of(len(variables) - len(shown), "variable")
        yield from wrap([Cell(f"{left} more: --all{NO_BREAK}shows them", Tone.FAINT)], width, _INDENT)


def _values(figures: Figures) -> tuple[Value, ...]:
    return figures.first, figures.last, figures.least, figures.greatest


def _columns(values: Sequence[Sequence[Value]]) -> list[Column]:
    """Return the columns for some values: texts and bytes may be cut, a number that is cut is another one."""
    columns = list(_COLUMNS)
    for at, (column, own) in enumerate(zip(columns[_VALUES], zip(*values, strict=True), strict=True), _VALUES.start):
        if any(isinstance(value, str | bytes) for value in own):
            numbers = [display_width(shown_value(value)) for value in own if isinstance(value, int | float)]
            shortest = max(display_width(column.title), _SHORTEST_TEXT, *numbers)
            columns[at] = replace(column, shortest=shortest)
    return columns


def _strip(table: AuditedTable, width: int) -> Iterator[Line]:
    audit = table.audit
    room = min(width - _INDENT, _LONGEST_STRIP)
    if room < 1:
        return
    marks = audit.coverage.strip.cells(room)
    if not marks or audit.coverage.first_ns is None or audit.coverage.last_ns is None:
        return
    yield [Cell(" " * _INDENT), Cell(drawn(marks, only_changes=audit.table.only_changes))]
    ends = (audit.coverage.first_ns, audit.coverage.last_ns)
    one_day = len({units.date(time_ns, utc=True) for time_ns in ends}) == 1
    tell = units.clock_time if one_day else units.absolute_time
    first, last = (tell(time_ns, utc=True, digits=0) for time_ns in ends)
    space = room - len(first) - len(last)
    if space > 0:
        yield [Cell(" " * _INDENT), Cell(first, Tone.FAINT), Cell(" " * space), Cell(last, Tone.FAINT)]
    if said := legend(marks, only_changes=audit.table.only_changes):
        yield from wrap([Cell("   ".join(said), Tone.FAINT)], width, _INDENT, _INDENT)
