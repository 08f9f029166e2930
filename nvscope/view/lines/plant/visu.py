"""The table of web visualization: which page asked which controller, how often, how long replies took, what was wrong.

Takes the rows of the report of schema ``nvscope.report/2``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Sequence

from nvscope import units
from nvscope.enumeration import first_few
from nvscope.view.lines.plant.content import Report, Row, node_names
from nvscope.view.lines.plant.tables import Measure, count_cell, duration_cell, rare_cell, used, with_port
from nvscope.view.lines.table import Cell, Column, Tone

TITLE = "WebVisu"
MOST_PAIRS = 50
"""So many pairs are shown unless all are wanted: those of which something is wrong before the others."""

_MOST_NAMED = 5
_WRONG = ("refused", "unanswered", "miscounted", "ambiguous")


def visu(report: Report, most: int | None = None) -> tuple[list[Measure], list[Row], int]:
    """Return columns and rows of the table, and how many rows there are beside these; none without such requests."""
    found: Sequence[Row] = report.get("visu", ())
    names = node_names(report)
    rows: list[Row] = [
        {
            **row,
            "asks": names.get(row["client"], row["client"]),
            "asked": names.get(row["server"], row["server"]),
        }
        for row in found
    ]
    if most is not None and len(rows) > most:
        worst = sorted(range(len(rows)), key=lambda place: not any(rows[place][name] for name in _WRONG))[:most]
        rows = [rows[place] for place in sorted(worst)]
    return used(with_port(PAIRS, rows, ENDS), rows), rows, len(found) - len(rows)


def remarks(report: Report) -> Sequence[str]:
    """Return which variables never changed though pages asked for them again and again, or could never be read.

    And between whom bytes were sent again as others.
    """
    names, told = node_names(report), []
    for row in report.get("visu", ()):
        if count := row.get("other_bytes", 0):
            ends = " and ".join(names.get(row[end], row[end]) for end in ("client", "server"))
            told.append(
                f"{ends}: {units.count_of(count, 'byte')} came again as others. What came first is shown; the receiver "
                "may have taken the others, as with somebody who wants to hide what is sent."
            )
    for row in report.get("visu_unchanging", ()):
        server = names.get(row["server"], row["server"])
        every = units.count_of(row["variables"], "variable")
        for kind, what in (("unchanged", "never changed"), ("unreadable", "could never be read (???)")):
            if count := len(row[kind]) + row[f"{kind}_cut"]:
                named = first_few(row[kind], _MOST_NAMED, of=count, between="; ")
                told.append(f"{server}: {units.count(count)} of {every} {what}: {named}.")
    return told


def _polled(row: Row) -> Cell:
    return duration_cell(row["polling_ns"]["p50"])


ENDS = ("asks", "asked")
PAIRS = (
    Measure(Column("asks", shortest=12, identifier=True), lambda row: Cell(row["asks"], Tone.STRONG)),
    Measure(Column("asked", shortest=12, identifier=True), lambda row: Cell(row["asked"])),
    Measure(Column("port", right=True, importance=2), lambda row: Cell(str(row["port"]))),
    Measure(Column("reads", right=True, importance=10), lambda row: count_cell(row["reads"])),
    Measure(Column("every", right=True, importance=7), _polled),
    Measure(Column("variables", right=True, importance=6), lambda row: count_cell(row["variables"])),
    Measure(Column("writes", right=True, importance=10), lambda row: count_cell(row["writes"], Tone.NOTE)),
    Measure(Column("refused", right=True, importance=9), lambda row: count_cell(row["refused"], Tone.ERROR)),
    Measure(Column("took p50", right=True, importance=8), lambda row: duration_cell(row["latency_ns"]["p50"])),
    Measure(Column("p99", right=True, importance=4), lambda row: duration_cell(row["latency_ns"]["p99"])),
    Measure(Column("max", right=True, importance=5), lambda row: duration_cell(row["latency_ns"]["max"])),
    Measure(Column("unanswered", right=True, importance=9), lambda row: count_cell(row["unanswered"], Tone.ERROR)),
    Measure(Column("miscounted", right=True, importance=7), lambda row: rare_cell(row["miscounted"], Tone.WARNING)),
    Measure(Column("ambiguous", right=True, importance=6), lambda row: rare_cell(row["ambiguous"], Tone.WARNING)),
    Measure(Column("cut", right=True, importance=5), lambda row: rare_cell(row["cut"], Tone.WARNING)),
    Measure(Column("bytes missing", right=True, importance=4), lambda row: rare_cell(row["gap_bytes"], Tone.WARNING)),
    Measure(Column("connections", right=True, importance=1), lambda row: count_cell(row["connections"])),
)
