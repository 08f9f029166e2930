"""The table of writes of parameters: who wrote what where, over which value, and what became of it.

Takes the rows of the report of schema ``nvscope.report/2``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Sequence

from nvscope import units
from nvscope.tracker.parameter.writes import Outcome
from nvscope.view.lines.plant.content import Clock, Report, Row, nanoseconds, node_names
from nvscope.view.lines.plant.tables import Measure, used, without_idle_port
from nvscope.view.lines.table import NOTHING, Cell, Column, Tone

TITLE = "Parameter writes"
MOST_WRITES = 20
"""So many are shown unless all are wanted: the last ones; those that were confirmed and change nothing go first."""

_TONES = {
    Outcome.CONFIRMED: Tone.GOOD, Outcome.REFUSED: Tone.ERROR, Outcome.BUSY: Tone.WARNING,
    Outcome.UNANSWERED: Tone.ERROR, Outcome.OPEN: Tone.FAINT,
}  # fmt: skip


def writes(report: Report, clock: Clock, most: int | None = MOST_WRITES) -> tuple[list[Measure], list[Row], int]:
    """Return columns and rows of the table, and how many further writes there are; none without writes."""
    found: Sequence[Row] = report.get("sdo_writes", ())
    shown = list(found)
    if most is not None and len(shown) > most:
        last = sorted(range(len(shown)), key=lambda place: (_changes_nothing(shown[place]), -place))[:most]
        shown = [shown[place] for place in sorted(last)]
    names = node_names(report)
    rows: list[Row] = [
        {
            **row,
            "at": clock.moment(nanoseconds(row["time_ns"]) or 0),
            "who": names.get(row["requester"], row["requester"]),
            "whom": names.get(row["partner"], row["partner"]),
        }
        for row in shown
    ]
    return used(without_idle_port(WRITES, rows, ("who", "whom")), rows), rows, len(found) - len(rows)


def more(left: int, option: str) -> str:
    """Return what is said of further writes; ``option`` is what shows them, too."""
    return f"… and {units.count(left)} more: {option} shows all that are kept, --json too."


def _changes_nothing(row: Row) -> bool:
    same = (row["old"], row["old_bytes"]) == (row["new"], row["new_bytes"])
    return same and row["outcome"] == Outcome.CONFIRMED


def _outcome(row: Row) -> Cell:
    error = (row["error"] or "").removeprefix("ODError").removeprefix("Reply")
    return Cell(f"{row['outcome']}: {error}" if error else row["outcome"], _TONES[Outcome(row["outcome"])])


def _old(row: Row) -> Cell:
    return Cell(NOTHING, Tone.FAINT) if row["old_text"] is None else Cell(row["old_text"])


WRITES = (
    Measure(Column("time", importance=7), lambda row: Cell(row["at"])),
    Measure(Column("who", shortest=12, identifier=True), lambda row: Cell(row["who"], Tone.STRONG)),
    Measure(Column("whom", shortest=12, identifier=True, importance=9), lambda row: Cell(row["whom"])),
    Measure(Column("port", right=True), lambda row: Cell(str(row["port"]))),
    Measure(
        Column("parameter", shortest=10, identifier=True),
        lambda row: Cell(row["name"] or units.parameter(row["index"], row["subindex"])),
    ),
    Measure(Column("old", shortest=8, importance=12, verbatim=True, values=True), _old),
    Measure(Column("new", shortest=8, verbatim=True, values=True), lambda row: Cell(row["new_text"])),
    Measure(Column("outcome", shortest=10, importance=11), _outcome),
    Measure(Column("frame", right=True, importance=2), lambda row: Cell(str(row["frame"]))),
)
