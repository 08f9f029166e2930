"""The table of writes of web visualization: who wrote what where, over which value, and what became of it.

Takes the rows of the report of schema ``nvscope.report/2``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from nvscope import units
from nvscope.tracker.readings.form import HIDDEN
from nvscope.tracker.visu.events import OK
from nvscope.tracker.visu.writes import WriteOutcome
from nvscope.view.lines.plant.content import Clock, Report, Row, nanoseconds, node_names
from nvscope.view.lines.plant.tables import Measure, used, without_idle_port
from nvscope.view.lines.table import NOTHING, Cell, Column, Tone

TITLE = "WebVisu writes"
MOST_WRITES = 20
"""So many are shown unless all are wanted: the last ones; those that were confirmed and change nothing go first."""

_TONES = {
    WriteOutcome.CONFIRMED: Tone.GOOD, WriteOutcome.REFUSED: Tone.ERROR, WriteOutcome.UNANSWERED: Tone.ERROR,
    WriteOutcome.OPEN: Tone.FAINT,
}  # fmt: skip


def writes(report: Report, clock: Clock, most: int | None = MOST_WRITES) -> tuple[list[Measure], list[Row], int]:
    """Return columns and rows of the table, and how many further writes there are; none without writes."""
    found: Sequence[Row] = report.get("visu_writes", ())
    shown = list(found)
    if most is not None and len(shown) > most:
        last = sorted(range(len(shown)), key=lambda place: (_changes_nothing(shown[place]), -place))[:most]
        shown = [shown[place] for place in sorted(last)]
    names = node_names(report)
    rows: list[Row] = [
        {
            **row,
            "at": clock.moment(nanoseconds(row["time_ns"]) or 0),
            "who": names.get(row["client"], row["client"]),
            "whom": names.get(row["server"], row["server"]),
        }
        for row in shown
    ]
    return used(without_idle_port(WRITES, rows, ("who", "whom")), rows), rows, len(found) - len(rows)


def more(left: int, option: str) -> str:
    """Return what is said of further writes; ``option`` is what shows them, too."""
    return f"… and {units.count(left)} more: {option} shows all that are kept, --json too."


def _changes_nothing(row: Row) -> bool:
    same: bool = row["old"] == row["new"] and row["outcome"] == WriteOutcome.CONFIRMED
    return same and not row["hidden"]


def _value(row: Row, name: str) -> Cell:
    """Return a value as it was sent; of a REAL without the zeros that its page puts behind it."""
    text = row[name]
    if row["hidden"] and (name != "old" or row["old_known"]):
        return Cell(HIDDEN, Tone.FAINT)
    if text is None:
        return Cell(NOTHING, Tone.FAINT)
    if row["type"] in _OF_REALS and _DECIMALS.fullmatch(text):
        text = text.rstrip("0").removesuffix(".")
    return Cell(text)


def _outcome(row: Row) -> Cell:
    """Return what became of a write; of one that was refused the HTTP status that says so."""
    told, status = row["outcome"], row["status"]
    is_told = told == WriteOutcome.REFUSED and status not in (None, OK)
    return Cell(f"{told}: HTTP {status}" if is_told else told, _TONES[WriteOutcome(told)])


_OF_REALS = ("REAL", "LREAL")
_DECIMALS = re.compile(r"[+-]?[0-9]+\.[0-9]+")


WRITES = (
    Measure(Column("time", importance=7), lambda row: Cell(row["at"])),
    Measure(Column("who", shortest=12, identifier=True), lambda row: Cell(row["who"], Tone.STRONG)),
    Measure(Column("whom", shortest=12, identifier=True, importance=9), lambda row: Cell(row["whom"])),
    Measure(Column("port", right=True), lambda row: Cell(str(row["port"]))),
    Measure(Column("variable", shortest=10, identifier=True), lambda row: Cell(row["variable"])),
    Measure(Column("old", shortest=8, importance=12, verbatim=True, values=True), lambda row: _value(row, "old")),
    Measure(Column("new", shortest=8, verbatim=True, values=True), lambda row: _value(row, "new")),
    Measure(Column("outcome", shortest=10, importance=11), _outcome),
    Measure(Column("frame", right=True, importance=2), lambda row: Cell(str(row["frame"]))),
)
