"""The report for people at a terminal: the verdict, the capture, lists, CAN buses, then the findings, worst first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nvscope import units
from nvscope.findings.kind import Severity
from nvscope.report import buses, content, hops, tables
from nvscope.report.ansi import painted
from nvscope.view.escape import visible_document
from nvscope.view.lines.table import GAP, NO_BREAK, Cell, Column, Line, Tone, align, aligned, display_width, wrap

MIN_WIDTH = 40
_TEXT_WIDTH = 110  # longer lines of prose are hard to read, however wide the terminal is
_MOST_FINDINGS = 40  # more than anybody reads at once
_BODY_INDENT = 11  # below the status: the width of its longest word, and a gap


def render(
    report: content.Report, *, colour: bool = False, width: int = 80, utc: bool = False, details: bool = False
) -> str:
    """Return the report as text of at most ``width`` columns (40 or more), ending with a line break.

    ``utc`` tells times in UTC instead of local time. ``details`` adds, for each list, the diagnosis structure of the
    list and its nodes, all counters, and its streams. With and without ``colour`` the text is the same.
    """
    return "".join(pieces(report, colour=colour, width=width, utc=utc, details=details))


def pieces(
    report: content.Report, *, colour: bool = False, width: int = 80, utc: bool = False, details: bool = False
) -> Iterator[str]:  # fmt: skip
    """Yield the same, some lines at a time."""
    shown = visible_document(report)
    lines = _lines(shown, max(width, MIN_WIDTH), content.Clock.of(shown, utc=utc), details)
    return painted(lines, colour=colour)


def _lines(report: content.Report, width: int, clock: content.Clock, details: bool) -> Iterator[Line]:
    text_width = min(width, _TEXT_WIDTH)
    head = content.headline(report)
    yield from wrap([Cell("● ", head.tone), Cell(head.text, Tone.STRONG)], text_width, hanging=2)
    for path, facts in content.source_facts(report):
        yield from wrap([Cell(f"{path} "), Cell(facts)], width, 2, 4)
    for cells in content.capture_lines(report, clock):
        yield from wrap(cells, text_width, 2, 4)
    advice = content.advice(report)
    if advice:
        yield from _section("What to check", width)
        for step in advice:
            yield from wrap([Cell(f"- {step}")], text_width, 0, 2)
    if report["lists"]:
        yield from _section("Lists", width)
        measures, overview = tables.overview(report)
        yield from aligned([measure.column for measure in measures], overview, width)
    shown, left = buses.buses(report, None if details else buses.MOST_BUSES)
    for bus in shown:
        yield from _bus(bus, width, clock, details)
    if left:
        more = f"{units.count_of(left, 'bus', 'buses')} more: -v shows all, --json and --md too."
        yield from ([], *wrap([Cell(more)], text_width))
    measures, rows = hops.hops(report)
    if "hops" in report:
        yield from _section(hops.TITLE, width)
        yield from _table(measures, rows, width) if rows else ()
        for sentence in hops.remarks(report):
            yield from wrap([Cell(sentence, Tone.FAINT)], text_width)
    if report["findings"]:
        yield from _section(f"Findings: {content.tally(report['totals']['findings'])}", width)
        yield from _findings(report, text_width, clock, None if details else _MOST_FINDINGS)
    if details:
        for entry in report["lists"]:
            yield from _details(entry, width, clock)
    if report["findings"]:
        yield []
        code = report["findings"][0]["code"]
        closing = f"nvscope explain CODE, for example {code}, tells what a finding means and what to do."
        yield from wrap([Cell(closing, Tone.FAINT)], text_width)


def _section(title: str, width: int) -> list[Line]:
    return [[], *wrap([Cell(title, Tone.STRONG)], width)]


def _table(
    measures: Sequence[tables.Measure], rows: Sequence[content.Row], width: int, indent: int = 0
) -> Iterator[Line]:  # fmt: skip
    cells = [tables.cells(measures, row) for row in rows]
    return aligned([measure.column for measure in measures], cells, width, indent)


def _bus(bus: content.Row, width: int, clock: content.Clock, details: bool) -> Iterator[Line]:
    yield []
    yield from wrap(buses.headline(bus, clock), min(width, _TEXT_WIDTH), 0, 2)
    for cells in buses.error_lines(bus, clock):
        yield from wrap(cells, min(width, _TEXT_WIDTH), 2, 4)
    shown = buses.identifiers(bus, None if details else buses.MOST_IDENTIFIERS)
    for measures, rows in (shown, buses.nodes(bus, clock)):
        if rows:
            yield []
            yield from _table(measures, rows, width, 2)


def _findings(report: content.Report, width: int, clock: content.Clock, most: int | None) -> Iterator[Line]:
    list_names, node_names = content.list_names(report), content.node_names(report)
    for place, finding in enumerate(report["findings"] if most is None else report["findings"][:most]):
        if place:
            yield []
        title = [Cell(f"{finding['code']} {finding['name']}", Tone.STRONG)]
        if finding["count"] > 1:
            title.append(Cell(f", {units.count(finding['count'])} times"))
        status = content.status(Severity.of(finding["severity"]))
        gap = NO_BREAK * (_BODY_INDENT - display_width(status.text))
        yield from wrap([Cell(status.text.replace(" ", NO_BREAK) + gap, status.tone), *title], width, 0, _BODY_INDENT)
        named, part = content.about(finding, list_names, node_names)
        if named or part:
            yield from wrap([Cell(", ".join(named + part))], width, _BODY_INDENT)
        yield from wrap([Cell(finding["message"])], width, _BODY_INDENT)
        if finding["hint"]:
            yield from wrap([Cell("Next: ", Tone.STRONG), Cell(finding["hint"])], width, _BODY_INDENT)
        evidence = content.evidence(finding, clock)
        if evidence:
            yield from wrap([Cell(evidence, Tone.FAINT)], width, _BODY_INDENT)
    left = len(report["findings"]) - (most or len(report["findings"]))
    if left > 0:
        yield []
        more = f"{units.count_of(left, 'finding')} more, none worse than these: -v shows all, --json and --md too."
        yield from wrap([Cell(more)], width)


def _details(entry: content.Row, width: int, clock: content.Clock) -> Iterator[Line]:
    yield from _section(" ".join(filter(None, (units.list_key(entry["key"]), entry["name"]))), width)
    yield from _diagnosis(entry, width, clock)
    for measures, rows in (tables.streams(entry), tables.intervals(entry)):
        if rows:
            yield []
            yield from _table(measures, rows, width)
    yield []
    counted, others = tables.counter_parts(entry)
    for label, parts in (("counted: ", counted), ("zero: ", others)):
        if parts:
            yield from wrap([Cell(label, Tone.FAINT), Cell(", ".join(parts))], min(width, _TEXT_WIDTH), 0, 2)


def _diagnosis(entry: content.Row, width: int, clock: content.Clock) -> Iterator[Line]:
    """Yield the table of the diagnosis structures, side by side as far as the width allows, then below each other."""
    holders = [("list", entry["diag"])]
    holders += ((" ".join(filter(None, (node["address"], node["name"]))), node["diag"]) for node in entry["nodes"])
    block: list[tuple[str, content.Row]] = []
    used = 0
    for title, diag in holders:
        rows = tables.diagnosis_rows([diag], clock)
        label_width = max(display_width(label.text) for label, _ in rows)
        needed = GAP + max(display_width(title), *(display_width(value.text) for _, value in rows))
        if block and used + needed > width:
            yield from _diagnosis_block(block, width, clock)
            yield []
            block = []
        used = (used if block else label_width) + needed
        block.append((title, diag))
    yield from _diagnosis_block(block, width, clock)


def _diagnosis_block(block: Sequence[tuple[str, content.Row]], width: int, clock: content.Clock) -> list[Line]:
    header = [Column(""), *(Column(title, right=True, shortest=12) for title, _ in block)]
    return align(header, tables.diagnosis_rows([diag for _, diag in block], clock), width)
