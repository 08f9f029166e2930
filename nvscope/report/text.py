"""The report for people at a terminal: the verdict, the capture, a strip of time for each list, then what happened.

Figures, CAN identifiers and findings come behind that, where all is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from nvscope import units
from nvscope.findings.kind import Severity
from nvscope.report import diagnosis, folding, hops, missing, timing
from nvscope.report.ansi import painted
from nvscope.view.escape import visible_document
from nvscope.view.lines.plant import buses, causes, content, happenings, strips, tables
from nvscope.view.lines.table import GAP, NO_BREAK, Cell, Column, Line, Tone, align, aligned, wrap
from nvscope.view.lines.text_width import display_width

if TYPE_CHECKING:
    from nvscope.causes.chronicle import Chronicle
    from nvscope.view.interval_shapes import IntervalShapes
    from nvscope.view.lines.plant.write_table import WriteTable

MIN_WIDTH = 40
_TEXT_WIDTH = 110  # longer lines of prose are hard to read, however wide the terminal is
_MOST_FINDINGS = 40  # more than anybody reads at once
_OTHER = "other"
_UNDER_MARKS = 3  # what is said of rows stands under their first column behind the mark
_BODY_INDENT = 11  # below the status: the width of its longest word, and a gap


class Asked(NamedTuple):
    """How much of a report is shown: ``everything`` is more than usual, ``details`` more than that."""

    everything: bool
    details: bool


def render(
    report: content.Report,
    chronicle: Chronicle | None = None,
    shapes: IntervalShapes | None = None,
    *,
    everything: bool = False,
    details: bool = False,
    colour: bool = False,
    width: int = 80,
    wide: bool = False,
    utc: bool = False,
) -> str:
    """Return the report as text of at most ``width`` columns (40 or more), ending with a line break.

    ``chronicle`` is what the strips of the lists are drawn from, ``shapes`` are how their intervals are spread, where
    that is asked for. ``everything`` adds the figures of lists, the identifiers on CAN and the findings behind the
    causes; ``details`` the same and, for each list, the diagnosis structure of the list and its nodes, all counters,
    and its streams, and shows findings that say the same one by one.
    ``wide`` tables are as wide as they need all the same. ``utc`` tells times in UTC instead of local time. With and
    without ``colour`` the text is the same.
    """
    return "".join(
        pieces(
            report,
            chronicle,
            shapes,
            everything=everything,
            details=details,
            colour=colour,
            width=width,
            wide=wide,
            utc=utc,
        )
    )


def pieces(
    report: content.Report,
    chronicle: Chronicle | None = None,
    shapes: IntervalShapes | None = None,
    *,
    everything: bool = False,
    details: bool = False,
    colour: bool = False,
    width: int = 80,
    wide: bool = False,
    utc: bool = False,
) -> Iterator[str]:
    """Yield the same, some lines at a time."""
    shown = visible_document(report)
    width = max(width, MIN_WIDTH)
    asked = Asked(everything or details, details)
    lines = _lines(shown, chronicle, shapes, asked, width, None if wide else width, content.Clock.of(shown, utc=utc))
    return painted(lines, colour=colour)


def _lines(
    report: content.Report, chronicle: Chronicle | None, shapes: IntervalShapes | None, asked: Asked, width: int,
    room: int | None, clock: content.Clock,
) -> Iterator[Line]:  # fmt: skip
    """Yield the report with sentences of at most ``width`` columns and tables that have ``room``."""
    text_width = min(width, _TEXT_WIDTH)
    yield from _head(report, text_width, width, clock, asked)
    if report["lists"]:
        yield []
        yield from _strips(report, chronicle, asked, text_width, room)
        if shapes is not None:
            yield from _timing(report, shapes, asked, text_width, room)
    yield from causes.lines(report["causes"], text_width, every=asked.details)
    if asked.everything and report["lists"]:
        yield from _section("Figures", width)
        overview = tables.overview(report, details=asked.details, most=None if asked.details else tables.MOST_LISTS)
        yield from aligned([measure.column for measure in overview.measures], overview.rows, room)
        if overview.left:
            yield from wrap([Cell(_more_lists(overview))], text_width)
    shown, left = buses.buses(report, None if asked.details else buses.MOST_BUSES)
    for bus in shown:
        yield from _bus(bus, width, room, clock, asked)
    if left:
        more = f"{units.count_of(left, 'bus', 'buses')} more: -v shows all, --json and --md too."
        yield from ([], *wrap([Cell(more)], text_width))
    if "sdo" in report:
        yield from _parameters(report, width, room, asked)
    if "sdo_writes" in report:
        from nvscope.view.lines.plant import parameter_writes  # noqa: PLC0415

        yield from _writes(parameter_writes, report, clock, width, room, asked)
    if "visu" in report:
        yield from _visu(report, width, room, asked)
    if "visu_writes" in report:
        from nvscope.view.lines.plant import visu_writes  # noqa: PLC0415

        yield from _writes(visu_writes, report, clock, width, room, asked)
    if "visu_others" in report:
        from nvscope.view.lines.plant import visu_others  # noqa: PLC0415

        measures, rows, left = visu_others.others(report, None if asked.details else visu_others.MOST_ROWS)
        yield from _pairs(visu_others.TITLE, measures, rows, left, width, room)
    if "databases" in report:
        from nvscope.view.lines.plant import databases  # noqa: PLC0415

        measures, rows = databases.databases(report, clock)
        yield from _pairs(databases.TITLE, measures, rows, 0, width, room)
        for sentence in databases.remarks(report):
            yield from wrap([Cell(sentence, Tone.FAINT)], text_width, 0, 2)
    measures, rows = hops.hops(report)
    if "hops" in report:
        yield from _section(hops.TITLE, width)
        yield from _table(measures, rows, room) if rows else ()
        for sentence in hops.remarks(report):
            yield from wrap([Cell(sentence, Tone.FAINT)], text_width)
    if asked.everything and report["findings"]:
        yield from _section(f"Findings: {content.tally(report['totals']['findings'])}", width)
        yield from _findings(report, text_width, clock, asked.details)
    if asked.details:
        for entry in report["lists"]:
            yield from _details(entry, width, room, clock)
    if closing := _closing(report, everything=asked.everything):
        yield from ([], *wrap([Cell(closing, Tone.FAINT)], text_width))


def _head(
    report: content.Report, text_width: int, width: int, clock: content.Clock, asked: Asked
) -> Iterator[Line]:  # fmt: skip
    """Yield the verdict, what was captured, and what is missing."""
    mark, told = happenings.headline(report)
    yield from wrap([Cell(f"{mark.text} ", mark.tone), Cell(told, Tone.STRONG)], text_width, hanging=2)
    for path, facts in content.source_facts(report):
        yield from wrap([Cell(f"{path} "), Cell(facts)], width, 2, 4)
    for cells in content.capture_lines(report, clock):
        yield from wrap(cells, text_width, 2, 4)
    for number, line in enumerate(missing.lines(report.get("missing", ()), text_width, every=asked.details)):
        yield from ((line,) if number else ([], line))
    advice = content.advice(report)
    if advice:
        yield from _section("What to check", width)
        for step in advice:
            yield from wrap([Cell(f"- {step}")], text_width, 0, 2)


def _strips(
    report: content.Report, chronicle: Chronicle | None, asked: Asked, text_width: int, room: int | None
) -> Iterator[Line]:  # fmt: skip
    """Yield a row a list, and what the marks in the strips say."""
    found = strips.strips(report, chronicle, room, keys=asked.details, every=asked.details)
    yield from aligned(found.columns, found.rows, room)
    if legend := strips.legend(found.marks):
        yield from wrap([Cell(legend, Tone.FAINT)], text_width, _UNDER_MARKS)
    if found.left:
        yield from wrap([Cell(strips.left_out(found, "-v"))], text_width, _UNDER_MARKS)


def _timing(
    report: content.Report, shapes: IntervalShapes, asked: Asked, text_width: int, room: int | None
) -> Iterator[Line]:  # fmt: skip
    """Yield how the intervals of each list are spread."""
    found = timing.timing(report, shapes, keys=asked.details, every=asked.details)
    yield from _section(timing.TITLE, text_width)
    if found.rows:
        yield from aligned(found.columns, found.rows, room)
        yield from wrap([Cell(timing.LEGEND, Tone.FAINT)], text_width)
    else:
        yield from wrap([Cell(timing.NO_INTERVALS)], text_width)


def _closing(report: content.Report, *, everything: bool) -> str:
    """Return what else can be asked, "" where nothing more is to be said."""
    parts = []
    if told := happenings.folded(report):
        parts.append(f"{told}{'' if everything else ' (--all)'}.")
    if report["causes"]:
        kinds = [cause["kind"] for cause in report["causes"]]
        kind = next((kind for kind in kinds if kind != _OTHER), _OTHER)
        parts.append(f"`nvscope explain {kind}` says more about a cause.")
    elif everything and report["findings"]:
        code = report["findings"][0]["code"]
        parts.append(f"`nvscope explain {code}` says what a finding means and what to do.")
    return " ".join(parts)


def _more_lists(overview: tables.Overview) -> str:
    worst = overview.left_worst
    found = "nothing was found of them" if worst is None else f"none with worse than {content.status(worst).text}"
    return f"{units.count_of(overview.left, 'list')} more, {found}: -v shows all, --json and --md too."


def _parameters(report: content.Report, width: int, room: int | None, asked: Asked) -> Iterator[Line]:
    # Few plants have any.
    from nvscope.view.lines.plant import parameters  # noqa: PLC0415

    measures, rows, left = parameters.parameters(report, None if asked.details else parameters.MOST_PAIRS)
    yield from _pairs(parameters.TITLE, measures, rows, left, width, room)


def _visu(report: content.Report, width: int, room: int | None, asked: Asked) -> Iterator[Line]:
    from nvscope.view.lines.plant import visu  # noqa: PLC0415

    measures, rows, left = visu.visu(report, None if asked.details else visu.MOST_PAIRS)
    yield from _pairs(visu.TITLE, measures, rows, left, width, room)
    for sentence in visu.remarks(report):
        yield from wrap([Cell(sentence, Tone.FAINT)], min(width, _TEXT_WIDTH), 0, 2)


def _pairs(
    title: str, measures: Sequence[tables.Measure], rows: Sequence[content.Row], left: int, width: int,
    room: int | None,
) -> Iterator[Line]:  # fmt: skip
    """Yield a table of who asked whom; ``left`` rows are not in it."""
    if rows:
        yield from _section(title, width)
        yield from _table(measures, rows, room)
    if left:
        more = f"{units.count_of(left, 'pair')} more, none with anything worse: -v shows all, --json and --md too."
        yield from ([], *wrap([Cell(more)], min(width, _TEXT_WIDTH)))


def _writes(
    table: WriteTable, report: content.Report, clock: content.Clock, width: int, room: int | None, asked: Asked
) -> Iterator[Line]:  # fmt: skip
    """Yield a table of who wrote what; ``table`` is its module."""
    measures, rows, left = table.writes(report, clock, None if asked.details else table.MOST_WRITES)
    yield from _section(table.TITLE, width)
    yield from _table(measures, rows, room)
    if left:
        yield from wrap([Cell(table.more(left, "-v"), Tone.FAINT)], min(width, _TEXT_WIDTH))


def _section(title: str, width: int) -> list[Line]:
    return [[], *wrap([Cell(title, Tone.STRONG)], width)]


def _table(
    measures: Sequence[tables.Measure], rows: Sequence[content.Row], room: int | None, indent: int = 0
) -> Iterator[Line]:  # fmt: skip
    cells = [tables.cells(measures, row) for row in rows]
    return aligned([measure.column for measure in measures], cells, room, indent)


def _bus(bus: content.Row, width: int, room: int | None, clock: content.Clock, asked: Asked) -> Iterator[Line]:
    yield []
    yield from wrap(buses.headline(bus, clock), min(width, _TEXT_WIDTH), 0, 2)
    for cells in buses.error_lines(bus, clock):
        yield from wrap(cells, min(width, _TEXT_WIDTH), 2, 4)
    if not asked.everything:
        return
    shown = buses.identifiers(bus, None if asked.details else buses.MOST_IDENTIFIERS)
    for measures, rows in (shown, buses.nodes(bus, clock)):
        if rows:
            yield []
            yield from _table(measures, rows, room, 2)


def _findings(report: content.Report, width: int, clock: content.Clock, details: bool) -> Iterator[Line]:
    list_names, node_names = content.list_names(report), content.node_names(report)
    entries = folding.entries(report["findings"], each=details)
    shown = entries if details else entries[:_MOST_FINDINGS]
    for place, entry in enumerate(shown):
        if place:
            yield []
        finding = entry.row
        title = [Cell(f"{finding['code']} {finding['name']}", Tone.STRONG), Cell(entry.title())]
        status = content.status(Severity.of(finding["severity"]))
        gap = NO_BREAK * (_BODY_INDENT - display_width(status.text))
        yield from wrap([Cell(status.text.replace(" ", NO_BREAK) + gap, status.tone), *title], width, 0, _BODY_INDENT)
        named, part = entry.about(list_names, node_names)
        if named or part:
            yield from wrap([Cell(", ".join(named + part))], width, _BODY_INDENT)
        yield from wrap([Cell(entry.message(list_names, node_names))], width, _BODY_INDENT)
        if finding["hint"]:
            yield from wrap([Cell("Next: ", Tone.STRONG), Cell(finding["hint"])], width, _BODY_INDENT)
        evidence = content.evidence(finding, clock)
        if evidence:
            yield from wrap([Cell(evidence, Tone.FAINT)], width, _BODY_INDENT)
        for one in entry.parts if details else ():
            yield from wrap(
                [Cell(f"{folding.identifier(one)}: {one['message']}")], width, _BODY_INDENT, _BODY_INDENT + 2
            )
            if one["hint"] != finding["hint"]:
                yield from wrap([Cell("Next: ", Tone.STRONG), Cell(one["hint"])], width, _BODY_INDENT + 2)
            if evidence := content.evidence(one, clock):
                yield from wrap([Cell(evidence, Tone.FAINT)], width, _BODY_INDENT + 2)
    left = sum(len(entry.places) for entry in entries[len(shown) :])
    if left > 0:
        yield []
        more = f"{units.count_of(left, 'finding')} more, none worse than these: -v shows all, --json and --md too."
        yield from wrap([Cell(more)], width)
    if remark := folding.remark(shown):
        yield from ([], *wrap([Cell(remark, Tone.FAINT)], width))


def _details(entry: content.Row, width: int, room: int | None, clock: content.Clock) -> Iterator[Line]:
    yield from _section(" ".join(filter(None, (units.list_key(entry["key"]), entry["name"]))), width)
    yield from _diagnosis(entry, width, room, clock)
    for measures, rows in (tables.streams(entry), tables.intervals(entry)):
        if rows:
            yield []
            yield from _table(measures, rows, room)
    yield []
    counted, others = diagnosis.counter_parts(entry)
    for label, parts in (("counted: ", counted), ("zero: ", others)):
        if parts:
            yield from wrap([Cell(label, Tone.FAINT), Cell(", ".join(parts))], min(width, _TEXT_WIDTH), 0, 2)


def _diagnosis(entry: content.Row, width: int, room: int | None, clock: content.Clock) -> Iterator[Line]:
    """Yield the table of the diagnosis structures, side by side as far as the width allows, then below each other."""
    holders = [("list", entry["diag"])]
    holders += ((" ".join(filter(None, (node["address"], node["name"]))), node["diag"]) for node in entry["nodes"])
    block: list[tuple[str, content.Row]] = []
    used = 0
    for title, diag in holders:
        rows = diagnosis.diagnosis_rows([diag], clock)
        label_width = max(display_width(label.text) for label, _ in rows)
        needed = GAP + max(display_width(title), *(display_width(value.text) for _, value in rows))
        if block and used + needed > width:
            yield from _diagnosis_block(block, room, clock)
            yield []
            block = []
        used = (used if block else label_width) + needed
        block.append((title, diag))
    yield from _diagnosis_block(block, room, clock)


def _diagnosis_block(block: Sequence[tuple[str, content.Row]], room: int | None, clock: content.Clock) -> list[Line]:
    header = [Column(""), *(Column(title, right=True, shortest=12) for title, _ in block)]
    return align(header, diagnosis.diagnosis_rows([diag for _, diag in block], clock), room)
