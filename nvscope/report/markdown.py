"""The report for pasting into an issue or a ticket: the same content as the text, as Markdown (GitHub's, GitLab's)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from nvscope.findings.kind import Severity
from nvscope.report import folding, hops, missing, timing
from nvscope.report.ansi import batched
from nvscope.view.escape import markdown_code, markdown_safe
from nvscope.view.lines.plant import buses, content, happenings, strips, tables
from nvscope.view.lines.table import NO_BREAK, NOTHING, Cell, Column

if TYPE_CHECKING:
    from nvscope.causes.chronicle import Chronicle
    from nvscope.view.interval_shapes import IntervalShapes
    from nvscope.view.lines.plant.write_table import WriteTable


def render(
    report: content.Report, chronicle: Chronicle | None = None, shapes: IntervalShapes | None = None, *,
    utc: bool = False, everything: bool = False, details: bool = False,
) -> str:  # fmt: skip
    """Return the report as Markdown, ending with a line break; ``utc`` tells times in UTC instead of local time.

    ``chronicle`` is what the strips of the lists are drawn from, ``shapes`` are how their intervals are spread, where
    that is asked for. ``everything`` adds the figures of lists, identifiers on CAN and the findings; ``details`` shows
    in them what the controllers count as errors, and findings that say the same one by one.
    """
    return "".join(pieces(report, chronicle, shapes, utc=utc, everything=everything, details=details))


def pieces(
    report: content.Report, chronicle: Chronicle | None = None, shapes: IntervalShapes | None = None, *,
    utc: bool = False, everything: bool = False, details: bool = False,
) -> Iterator[str]:  # fmt: skip
    """Yield the same, some lines at a time."""
    clock = content.Clock.of(report, utc=utc)
    for lines in batched(_lines(report, chronicle, shapes, clock, everything=everything or details, details=details)):
        yield "\n".join(lines) + "\n"


def _lines(
    report: content.Report, chronicle: Chronicle | None, shapes: IntervalShapes | None, clock: content.Clock, *,
    everything: bool, details: bool,
) -> Iterator[str]:  # fmt: skip
    head = happenings.headline(report)
    yield f"**{markdown_safe(f'{head[0].text} {head[1]}')}**"
    yield ""
    for path, facts in content.source_facts(report):
        yield f"- {markdown_code(path)} {markdown_safe(facts)}" if path else f"- {markdown_safe(facts)}"
    for cells in content.capture_lines(report, clock):
        yield f"- {markdown_safe(''.join(cell.text for cell in cells))}"
    yield from _missing(report, details=details)
    advice = content.advice(report)
    if advice:
        yield ""
        yield "### What to check"
        yield ""
        for step in advice:
            yield f"- {step}"
    if report["lists"]:
        yield ""
        yield from _strips(report, chronicle, details=details)
        if shapes is not None:
            yield from _timing(report, shapes, details=details)
    yield from _causes(report)
    if everything and report["lists"]:
        yield ""
        yield "### Figures"
        yield ""
        overview = tables.overview(report, details=details)
        yield from _rows([measure.column for measure in overview.measures], overview.rows)
    for bus in buses.buses(report)[0]:
        yield from _bus(bus, clock, everything=everything)
    if "sdo" in report:
        from nvscope.view.lines.plant import parameters  # noqa: PLC0415  # few plants have any

        measures, rows, _ = parameters.parameters(report)
        yield from _titled(parameters.TITLE, measures, rows)
    if "sdo_writes" in report:
        from nvscope.view.lines.plant import parameter_writes  # noqa: PLC0415

        yield from _writes(parameter_writes, report, clock, details=details)
    if "visu" in report:
        from nvscope.view.lines.plant import visu  # noqa: PLC0415

        measures, rows, _ = visu.visu(report)
        yield from _titled(visu.TITLE, measures, rows)
        for sentence in visu.remarks(report):
            yield from ("", markdown_safe(sentence))
    if "visu_writes" in report:
        from nvscope.view.lines.plant import visu_writes  # noqa: PLC0415

        yield from _writes(visu_writes, report, clock, details=details)
    if "visu_others" in report:
        from nvscope.view.lines.plant import visu_others  # noqa: PLC0415

        measures, rows, _ = visu_others.others(report)
        yield from _titled(visu_others.TITLE, measures, rows)
    if "databases" in report:
        from nvscope.view.lines.plant import databases  # noqa: PLC0415

        yield from _titled(databases.TITLE, *databases.databases(report, clock))
        for sentence in databases.remarks(report):
            yield from ("", markdown_safe(sentence))
    if "hops" in report:
        yield ""
        yield f"### {hops.TITLE}"
        yield ""
        measures, rows = hops.hops(report)
        yield from _table(measures, rows) if rows else ()
        for sentence in hops.remarks(report):
            yield ""
            yield markdown_safe(sentence)
    if everything and report["findings"]:
        yield ""
        yield f"### Findings: {content.tally(report['totals']['findings'])}"
        yield from _findings(report, clock, details)
    if told := happenings.folded(report):
        yield ""
        yield f"{told}{'' if everything else ' (--all)'}."
    yield ""
    tool = report["tool"]
    yield f"_{markdown_safe(tool['name'])} {markdown_safe(tool['version'])}_"


def _missing(report: content.Report, *, details: bool) -> Iterator[str]:
    shown, left = missing.entries(report.get("missing", ()), every=details)
    if not shown:
        return
    yield ""
    yield f"### {missing.TITLE}"
    yield ""
    for entry in shown:
        why = f": {markdown_safe(entry.why)}" if entry.why else ""
        yield f"- {entry.mark.text} **{markdown_safe(entry.what)}**{why}. {markdown_safe(entry.next)}"
    if left:
        yield f"- {missing.left_out(left)}"


def _strips(report: content.Report, chronicle: Chronicle | None, *, details: bool) -> Iterator[str]:
    found = strips.strips(report, chronicle, None, keys=details, every=details)
    yield from _rows(found.columns, found.rows)
    if legend := strips.legend(found.marks):
        yield ""
        yield markdown_safe(legend)
    if found.left:
        yield ""
        yield strips.left_out(found, "-v")


def _timing(report: content.Report, shapes: IntervalShapes, *, details: bool) -> Iterator[str]:
    found = timing.timing(report, shapes, keys=details, every=details)
    yield from ("", f"### {timing.TITLE}", "")
    if found.rows:
        yield from _rows(found.columns, found.rows)
        yield from ("", markdown_safe(timing.LEGEND))
    else:
        yield timing.NO_INTERVALS


def _causes(report: content.Report) -> Iterator[str]:
    for number, cause in enumerate(report["causes"], 1):
        yield ""
        mark = happenings.symbol(happenings.severity_of(cause)).text
        yield f"**{mark} {number} {markdown_safe(cause['title'])}** ({markdown_safe(cause['kind'])})"
        yield ""
        yield from (f"- ✓ {markdown_safe(fact)}" for fact in cause["checked"])
        yield f"- **Next:** {markdown_safe(cause['next'])}"


def _writes(table: WriteTable, report: content.Report, clock: content.Clock, *, details: bool) -> Iterator[str]:
    """Yield a table of who wrote what; ``table`` is its module."""
    measures, rows, left = table.writes(report, clock, None if details else table.MOST_WRITES)
    yield from _titled(table.TITLE, measures, rows)
    if left:
        yield from ("", markdown_safe(table.more(left, "-v")))


def _titled(title: str, measures: Sequence[tables.Measure], rows: Sequence[content.Row]) -> Iterator[str]:
    yield from ("", f"### {title}", "")
    yield from _table(measures, rows)


def _table(measures: Sequence[tables.Measure], rows: Sequence[content.Row]) -> Iterator[str]:
    return _rows([measure.column for measure in measures], (tables.cells(measures, row) for row in rows))


def _rows(columns: Sequence[Column], rows: Iterable[Sequence[Cell]]) -> Iterator[str]:
    yield _row([column.title for column in columns])
    yield _row(["---:" if column.right else "---" for column in columns])
    for cells in rows:
        yield _row([_cell(column, cell.text) for column, cell in zip(columns, cells, strict=True)])


def _cell(column: Column, text: str) -> str:
    if text == NOTHING:
        return text
    return markdown_code(text) if column.identifier or column.verbatim else markdown_safe(text)


def _row(texts: Sequence[str]) -> str:
    return f"| {' | '.join(texts)} |"


def _bus(bus: content.Row, clock: content.Clock, *, everything: bool) -> Iterator[str]:
    yield ""
    yield f"### Bus {markdown_code(bus['channel'])}"
    yield ""
    told = "".join(cell.text for cell in buses.headline(bus, clock)[2:])
    yield f"- {markdown_safe(told.replace(NO_BREAK, ' '))}"
    for cells in buses.error_lines(bus, clock):
        yield f"- {markdown_safe(''.join(cell.text for cell in cells).replace(NO_BREAK, ' '))}"
    for measures, rows in (buses.identifiers(bus), buses.nodes(bus, clock)):
        if rows and everything:
            yield ""
            yield from _table(measures, rows)


def _findings(report: content.Report, clock: content.Clock, details: bool) -> Iterator[str]:
    list_names, node_names = content.list_names(report), content.node_names(report)
    yield ""
    entries = folding.entries(report["findings"], each=details)
    for entry in entries:
        finding = entry.row
        label = content.status(Severity.of(finding["severity"])).text
        title = f"- **{label} {markdown_safe(finding['code'])} {markdown_safe(finding['name'])}**{entry.title()}"
        named, part = entry.about(list_names, node_names)
        about = ", ".join([markdown_code(text) for text in named] + part)
        yield f"{title}: {about}" if about else title
        yield f"  - {markdown_safe(entry.message(list_names, node_names))}"
        if finding["hint"]:
            yield f"  - **Next:** {markdown_safe(finding['hint'])}"
        evidence = content.evidence(finding, clock)
        if evidence:
            yield f"  - {evidence}"
        for one in entry.parts if details else ():
            yield f"  - {folding.identifier(one)}: {markdown_safe(one['message'])}"
            if one["hint"] != finding["hint"]:
                yield f"    - **Next:** {markdown_safe(one['hint'])}"
            if evidence := content.evidence(one, clock):
                yield f"    - {evidence}"
    if remark := folding.remark(entries):
        yield from ("", remark)
