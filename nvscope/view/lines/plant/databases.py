"""The table of databases of DataLoggers: how much each holds, from when to when, and where data was lost.

Takes the rows of the report of schema ``nvscope.report/2``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Sequence

from nvscope import units
from nvscope.capture.formats import DATABASES
from nvscope.view.lines.plant.content import Clock, Report, Row, nanoseconds
from nvscope.view.lines.plant.tables import Measure, count_cell
from nvscope.view.lines.table import Cell, Column, Tone

TITLE = "Databases"


def databases(report: Report, clock: Clock) -> tuple[list[Measure], list[Row]]:
    """Return columns and rows of the table; none without databases."""

    def moment(key: str) -> Measure:
        title = "from" if key == "start_ns" else "to"
        return Measure(Column(title, importance=3), lambda row: Cell(clock.moment(nanoseconds(row[key]) or 0)))

    columns = [
        Measure(Column("database", shortest=12, identifier=True), lambda row: Cell(row["database"], Tone.STRONG)),
        Measure(Column("rows", right=True), lambda row: count_cell(row["rows"])),
        Measure(Column("tables", right=True, importance=1), lambda row: count_cell(row["tables"])),
        Measure(Column("variables", right=True, importance=4), lambda row: count_cell(row["variables"])),
        moment("start_ns"), moment("end_ns"),
        Measure(Column("data lost", right=True, importance=5), lambda row: count_cell(row["lost"], Tone.WARNING)),
    ]  # fmt: skip
    return columns, list(report.get("databases", ()))


def remarks(report: Report) -> Sequence[str]:
    """Return what the last column says, where it says something, and what else tells of databases."""
    told = []
    for row in report.get("databases", ()):
        if row["lost"]:
            says = "says" if row["lost"] == 1 else "say"
            told.append(
                f"{row['database']}: {units.count_of(row['lost'], 'row')} {says} that data was lost before "
                f"(ConsistentDataSeries 0), the first in frame {units.count(row['first_lost_frame'])}."
            )
    if any(one["format"] in DATABASES for one in report["capture"]["sources"]):
        told.append(
            "`nvscope audit FILE.db` tells whether one can be trusted; `nvscope vars FILE.db` shows its variables."
        )
    return told
