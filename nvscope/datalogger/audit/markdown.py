"""The audit as Markdown, for a ticket or a pull request."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope import units
from nvscope.datalogger.audit.audit import Audit, AuditedTable
from nvscope.datalogger.audit.time_strip import drawn, legend
from nvscope.datalogger.audit.words import Names, about, coverage, groups, place, shown_value, told_of_files, verdict
from nvscope.findings.kind import Severity
from nvscope.view.escape import markdown_code, markdown_safe

_MARKS = {None: "✗", Severity.ERROR: "✗", Severity.WARNING: "!", Severity.NOTE: "●"}
_STRIP = 80


def markdown(audit: Audit) -> Iterator[str]:
    """Yield lines: the verdict, what is wrong and where, and each table with its variables."""
    severity, sentence = verdict(audit)
    yield f"**{_MARKS[severity]} {markdown_safe(sentence)}**"
    told = [note for _, note in told_of_files(audit.files)] + audit.notes
    if told:
        yield ""
        yield from (f"- {markdown_safe(one)}" for one in told)
    for group in groups(audit):
        yield ""
        yield f"- **{group.severity.word} {group.kind.code} {group.kind.name}**"
        for finding in group.shown:
            yield f"  - {markdown_safe(finding.message)} {markdown_code(place(finding, audit.name_of))}"
        if group.more:
            yield f"  - {markdown_safe(group.more)}"
        yield f"  - Next: {markdown_safe(group.findings[0].next_step)}"
    for table in audit.tables:
        yield ""
        yield from _table(table, audit.name_of)


def _table(table: AuditedTable, names: Names) -> Iterator[str]:
    named, *rest = about(table, names)
    yield f"{markdown_code(named)} · {' · '.join(map(markdown_safe, rest))}"
    if covered := coverage(table):
        yield ""
        yield markdown_safe(covered)
    marks = table.audit.coverage.strip.cells(_STRIP)
    if marks:
        yield ""
        yield markdown_code(drawn(marks, only_changes=table.audit.table.only_changes).replace(" ", "."))
        if said := legend(marks, only_changes=table.audit.table.only_changes):
            yield f"({markdown_safe(', '.join(said))})"
    yield ""
    yield "| variable | stored | changes | unknown | first | last | least | greatest |"
    yield "|---|---:|---:|---:|---:|---:|---:|---:|"
    for variable, figures in zip(table.audit.table.variables, table.audit.figures, strict=True):
        values = (figures.first, figures.last, figures.least, figures.greatest)
        cells = (
            markdown_code(variable.name), units.count(figures.stored), units.count(figures.changes),
            units.count(figures.unknown), *(markdown_code(shown_value(value)) for value in values),
        )  # fmt: skip
        yield f"| {' | '.join(cells)} |"
