"""The table of the Parameter Manager: who asked whom, how often, how long replies took, and what went wrong.

Takes the rows of the report of schema ``nvscope.report/2``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Sequence

from nvscope import units
from nvscope.view.lines.plant.content import Report, Row, node_names
from nvscope.view.lines.plant.tables import Measure, count_cell, duration_cell, rare_cell, used, with_port
from nvscope.view.lines.table import NOTHING, Cell, Column, Tone

TITLE = "Parameter Manager"
MOST_PAIRS = 50
"""So many pairs of nodes are shown unless all are wanted: those of which something is wrong before the others."""

_WRONG = ("timeouts", "unexpected", "undeliverable")


def parameters(report: Report, most: int | None = None) -> tuple[list[Measure], list[Row], int]:
    """Return columns and rows of the table, and how many rows there are beside these; none without such telegrams."""
    found: Sequence[Row] = report.get("sdo", ())
    names = node_names(report)
    rows: list[Row] = [
        {
            **row,
            "asks": names.get(row["requester"], row["requester"]),
            "asked": names.get(row["partner"], row["partner"]),
        }
        for row in found
    ]
    if most is not None and len(rows) > most:
        worst = sorted(range(len(rows)), key=lambda place: not _is_wrong(rows[place]))[:most]
        rows = [rows[place] for place in sorted(worst)]
    return used(with_port(PAIRS, rows, ENDS), rows), rows, len(found) - len(rows)


def _is_wrong(row: Row) -> bool:
    return bool(row["errors"]) or any(row[name] for name in _WRONG)


def _refused(row: Row) -> Cell:
    errors = [(name.removeprefix("ODError").removeprefix("Reply"), count) for name, count in row["errors"].items()]
    told = ", ".join(f"{units.count(count)} {name}" for name, count in errors)
    return Cell(told, Tone.ERROR) if told else Cell(NOTHING, Tone.FAINT)


ENDS = ("asks", "asked")
PAIRS = (
    Measure(Column("asks", shortest=12, identifier=True), lambda row: Cell(row["asks"], Tone.STRONG)),
    Measure(Column("asked", shortest=12, identifier=True), lambda row: Cell(row["asked"])),
    Measure(Column("port", right=True, importance=2), lambda row: Cell(str(row["port"]))),
    Measure(Column("requests", right=True, importance=10), lambda row: count_cell(row["requests"])),
    Measure(Column("took p50", right=True, importance=8), lambda row: duration_cell(row["latency_ns"]["p50"])),
    Measure(Column("p99", right=True, importance=5), lambda row: duration_cell(row["latency_ns"]["p99"])),
    Measure(Column("max", right=True, importance=7), lambda row: duration_cell(row["latency_ns"]["max"])),
    Measure(Column("unanswered", right=True, importance=10), lambda row: count_cell(row["timeouts"], Tone.ERROR)),
    Measure(Column("came back", right=True, importance=9), lambda row: rare_cell(row["undeliverable"], Tone.ERROR)),
    Measure(Column("repeated", right=True, importance=4), lambda row: rare_cell(row["retransmissions"], Tone.WARNING)),
    Measure(Column("unexpected", right=True, importance=6), lambda row: rare_cell(row["unexpected"], Tone.WARNING)),
    Measure(Column("copies", right=True, importance=3), lambda row: rare_cell(row["copies"])),
    Measure(Column("busy", right=True, importance=3), lambda row: rare_cell(row["busy"])),
    Measure(Column("refused", importance=9), _refused),
)
