"""A row a list: who sends it, a strip of time in which the eye finds what happened, and what that was in words.

Takes the report of schema ``nvscope.report/2`` and the ``Chronicle`` beside it. Nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from nvscope import units
from nvscope.causes.mark import Mark
from nvscope.findings.kind import Severity
from nvscope.view.escape import visible
from nvscope.view.lines.plant.content import Report, Row, nanoseconds, node_names, watched_until_ns
from nvscope.view.lines.plant.happenings import Concern, concerns, symbol
from nvscope.view.lines.plant.tables import OVERVIEW, Measure, looked_at
from nvscope.view.lines.table import GAP, NOTHING, Cell, Column, Tone
from nvscope.view.lines.text_width import display_width

if TYPE_CHECKING:
    from nvscope.causes.chronicle import Chronicle

MOST_ROWS, LEAST_WELL = 24, 4
"""So many lists are shown unless all are wanted; of those without a fault at least so many."""

MOST_CONCERNED = 60
"""So many with a fault."""

_SHORTEST, _LONGEST, _WIDE = 16, 100, 60

MARKS: Mapping[Mark, tuple[str, str]] = {
    Mark.USUAL: ("━", "as usual"),
    Mark.SILENT: (" ", "silent"),
    Mark.LATE: ("!", "late or torn"),
    Mark.UNANSWERED: ("▒", "not acknowledged"),
    Mark.RESTARTED: ("R", "restarted"),
    Mark.SEVERAL_SENDERS: ("╪", "several senders"),
    Mark.LOST: ("×", "lost"),
}
"""The character of each mark, and what it says."""


class Strips(NamedTuple):
    """The table of lists: its columns, a row of cells for each list shown, and how many lists are not shown.

    ``left_concerned`` of these have a fault; ``marks`` are those that the strips show.
    """

    columns: list[Column]
    rows: list[list[Cell]]
    left: int
    left_concerned: int
    marks: Sequence[Mark]


def strips(
    report: Report, chronicle: Chronicle | None, width: int | None, *, keys: bool = False, every: bool = False
) -> Strips:  # fmt: skip
    """Return the table in at most ``width`` columns, None for as many as it needs.

    Lists that causes concern come first, in their order. ``keys``: lists are told by their keys; ``every``: none is
    left out.
    """
    told, entries = concerns(report), report["lists"]
    shown = shown_lists(report, told, every=every)
    names = units.short_list_keys(entry["key"] for entry in entries)
    measures = _measures(told, names, keys=keys)
    nodes = node_names(report)
    looked = [looked_at(entry, nodes) for entry in shown.entries]
    measured = [[measure.cell(entry) for measure in measures] for entry in looked]
    places = [place for place in range(len(measures)) if any(row[place].text not in ("", NOTHING) for row in measured)]
    columns = [measures[place].column for place in places]
    rows = [[row[place] for place in places] for row in measured]
    marks: Sequence[Mark] = ()
    if chronicle is not None and rows:
        at = next(place for place, column in enumerate(columns) if column.title in _BEHIND)
        room = _room(columns, rows, width)
        keys_of = keys_among([entry["key"] for entry in shown.entries], chronicle.numbers)
        drawn = chronicle.strips(list(keys_of), room)
        columns.insert(at, Column(_scale(report, chronicle, room), verbatim=True))
        for row, one in zip(rows, drawn, strict=True):
            row.insert(at, Cell("".join(MARKS[mark][0] for mark in one)))
        marks = sorted({mark for one in drawn for mark in one})
    left = len(entries) - len(rows)
    return Strips(columns, rows, left, shown.left_concerned, marks)


class ShownLists(NamedTuple):
    """The lists that are shown, those that causes concern first, in their order; and how many of these are not."""

    entries: Sequence[Row]
    left_concerned: int


def shown_lists(report: Report, told: Mapping[str, Concern] | None = None, *, every: bool = False) -> ShownLists:
    """Return the lists of a report that are shown; ``told`` is what happened to them, if it is known already."""
    told = concerns(report) if told is None else told
    entries: Sequence[Row] = report["lists"]
    by_key: dict[str, Row] = {entry["key"]: entry for entry in entries if entry["key"] in told}
    concerned = [by_key[key] for key in told]
    well = [entry for entry in entries if entry["key"] not in told]
    chosen = concerned if every else concerned[:MOST_CONCERNED]
    rest = well if every else well[: max(MOST_ROWS - len(chosen), LEAST_WELL)]
    return ShownLists([*chosen, *rest], len(concerned) - len(chosen))


_MEASURED = {measure.column.title: measure for measure in OVERVIEW}
_BEHIND = ("interval", "sent")
"""In front of the first of these columns that is there, the strip stands."""


def _measures(told: Mapping[str, Concern], names: Mapping[str, str], *, keys: bool) -> list[Measure]:
    def severity(entry: Row) -> Severity | None:
        concern = told.get(entry["key"])
        return concern.severity if concern else None

    def words(entry: Row) -> Cell:
        concern = told.get(entry["key"])
        return Cell(concern.words, symbol(concern.severity).tone) if concern else Cell("")

    def name(entry: Row) -> Cell:
        return Cell(units.list_key(entry["key"]) if keys else entry["name"] or names[entry["key"]], Tone.STRONG)

    return [
        Measure(Column(""), lambda entry: symbol(severity(entry))),
        Measure(Column("list", shortest=8, identifier=True), name),
        Measure(Column("sender", shortest=12, importance=3, identifier=True), _MEASURED["sender"].cell),
        Measure(Column("interval", right=True, importance=2), _MEASURED["interval"].cell),
        Measure(Column("sent", right=True, importance=1), _MEASURED["sent"].cell),
        Measure(Column(""), words),
    ]


def keys_among(shown: Sequence[str], known: Collection[str]) -> Sequence[str]:
    """Return keys as what stands beside a report has them, given how the report shows them."""
    if all(key in known for key in shown):
        return shown
    raw = {visible(key): key for key in known}
    return [raw[key] for key in shown]


def _room(columns: Sequence[Column], rows: Sequence[Sequence[Cell]], width: int | None) -> int:
    """Return how many cells a strip has beside the other columns."""
    if width is None:
        return _WIDE
    natural = [
        max(display_width(column.title), *(display_width(row[place].text) for row in rows))
        for place, column in enumerate(columns)
    ]
    return max(_SHORTEST, min(_LONGEST, width - sum(natural) - GAP * len(columns)))


def _scale(report: Report, chronicle: Chronicle, cells: int) -> str:
    """Return the scale of strips: of a part of the time, how long it is; it ends now."""
    whole_ns, shown_ns = _length_ns(report), chronicle.end_ns - chronicle.start_ns
    if shown_ns >= whole_ns or chronicle.start_ns == nanoseconds(report["capture"]["start_ns"]):
        return scale(whole_ns, cells)
    return f"last {units.duration(shown_ns)}"[:cells]


def _length_ns(report: Report) -> int:
    start_ns, end_ns = nanoseconds(report["capture"]["start_ns"]), watched_until_ns(report["capture"])
    return max((end_ns or 0) - (start_ns or 0), 1)


_UNITS = ((1, "ns"), (1_000, "µs"), (1_000_000, "ms"), (1_000_000_000, "s"), (60 * 10**9, "min"), (3600 * 10**9, "h"),
          (86400 * 10**9, "d"))  # fmt: skip
_STEPS = (1, 2, 5)
_LEAST_CELLS = 6


def scale(length_ns: int, cells: int) -> str:
    """Return the scale of a strip: ``0 s`` and further moments, at the cells in which they are."""
    unit_ns, unit = next((one for one in reversed(_UNITS) if one[0] * 2 <= length_ns), _UNITS[0])
    step, power = 1, 1
    while unit_ns * step * power * cells < _LEAST_CELLS * length_ns:
        following = _STEPS.index(step) + 1
        step, power = (_STEPS[following], power) if following < len(_STEPS) else (1, power * 10)
    text = f"0 {unit}"
    for number in range(step * power, length_ns // unit_ns + 1, step * power):
        place = number * unit_ns * cells // length_ns
        told = str(number)
        if place + len(told) > cells:
            break
        if place > len(text):
            text = text.ljust(place) + told
    return text


def left_out(found: Strips, option: str) -> str:
    """Return what is said of lists that are not shown, and which ``option`` shows them."""
    what = f"{units.count(found.left_concerned)} of them affected" if found.left_concerned else "all well"
    return f"{units.count_of(found.left, 'list')} more, {what}: {option} shows all, --json too."


def legend(marks: Sequence[Mark]) -> str:
    """Return what the marks in some strips say, "" where they show nothing but what is usual."""
    told = [f"{MARKS[mark][0]} {MARKS[mark][1]}" for mark in reversed(marks) if mark > Mark.SILENT]
    return ", ".join(told)
