"""The report for pasting into an issue or a ticket: the same content as the text, as Markdown (GitHub's, GitLab's)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from nvscope.findings.kind import Severity
from nvscope.report import buses, content, folding, hops, tables
from nvscope.report.ansi import batched
from nvscope.view.escape import markdown_code, markdown_safe
from nvscope.view.lines.table import NO_BREAK, NOTHING, Cell


def render(report: content.Report, *, utc: bool = False, details: bool = False) -> str:
    """Return the report as Markdown, ending with a line break; ``utc`` tells times in UTC instead of local time.

    ``details`` adds what the controllers count as errors, and shows findings that say the same one by one.
    """
    return "".join(pieces(report, utc=utc, details=details))


def pieces(report: content.Report, *, utc: bool = False, details: bool = False) -> Iterator[str]:
    """Yield the same, some lines at a time."""
    for lines in batched(_lines(report, content.Clock.of(report, utc=utc), details)):
        yield "\n".join(lines) + "\n"


def _lines(report: content.Report, clock: content.Clock, details: bool) -> Iterator[str]:
    yield f"**{markdown_safe(content.headline(report).text)}**"
    yield ""
    for path, facts in content.source_facts(report):
        yield f"- {markdown_code(path)} {markdown_safe(facts)}" if path else f"- {markdown_safe(facts)}"
    for cells in content.capture_lines(report, clock):
        yield f"- {markdown_safe(''.join(cell.text for cell in cells))}"
    advice = content.advice(report)
    if advice:
        yield ""
        yield "### What to check"
        yield ""
        for step in advice:
            yield f"- {step}"
    if report["lists"]:
        yield ""
        overview = tables.overview(report, details=details)
        yield from _rows(overview.measures, overview.rows)
    for bus in buses.buses(report)[0]:
        yield from _bus(bus, clock)
    if "hops" in report:
        yield ""
        yield f"### {hops.TITLE}"
        yield ""
        measures, rows = hops.hops(report)
        yield from _table(measures, rows) if rows else ()
        for sentence in hops.remarks(report):
            yield ""
            yield markdown_safe(sentence)
    if report["findings"]:
        yield ""
        yield f"### Findings: {content.tally(report['totals']['findings'])}"
        yield from _findings(report, clock, details)
    yield ""
    tool = report["tool"]
    yield f"_{markdown_safe(tool['name'])} {markdown_safe(tool['version'])}_"


def _table(measures: Sequence[tables.Measure], rows: Sequence[content.Row]) -> Iterator[str]:
    return _rows(measures, (tables.cells(measures, row) for row in rows))


def _rows(measures: Sequence[tables.Measure], rows: Iterable[Sequence[Cell]]) -> Iterator[str]:
    yield _row([measure.column.title for measure in measures])
    yield _row(["---:" if measure.column.right else "---" for measure in measures])
    for cells in rows:
        yield _row([_cell(measure, cell.text) for measure, cell in zip(measures, cells, strict=True)])


def _cell(measure: tables.Measure, text: str) -> str:
    if text == NOTHING:
        return text
    return markdown_code(text) if measure.column.identifier else markdown_safe(text)


def _row(texts: Sequence[str]) -> str:
    return f"| {' | '.join(texts)} |"


def _bus(bus: content.Row, clock: content.Clock) -> Iterator[str]:
    yield ""
    yield f"### Bus {markdown_code(bus['channel'])}"
    yield ""
    told = "".join(cell.text for cell in buses.headline(bus, clock)[2:])
    yield f"- {markdown_safe(told.replace(NO_BREAK, ' '))}"
    for cells in buses.error_lines(bus, clock):
        yield f"- {markdown_safe(''.join(cell.text for cell in cells).replace(NO_BREAK, ' '))}"
    for measures, rows in (buses.identifiers(bus), buses.nodes(bus, clock)):
        if rows:
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
