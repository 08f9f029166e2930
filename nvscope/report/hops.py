"""The table of variables that several lists have: from where to where, how late, and for how long they differed."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope import units
from nvscope.enumeration import first_few
from nvscope.view.lines.plant.content import Report, Row
from nvscope.view.lines.plant.tables import Measure, duration_cell
from nvscope.view.lines.table import NOTHING, Cell, Column, Tone

TITLE = "Hops: the same variable in several lists"


def hops(report: Report) -> tuple[list[Measure], list[Row]]:
    """Return columns and rows of the table; no rows where it was not asked for."""
    rows = [row for key in _KEYS for row in report.get(key, [])]
    return [one for one in _HOPS if one is not _MISSED or any("missed" in row for row in rows)], rows


def remarks(report: Report) -> Sequence[str]:
    """Return what is to be said about the table, or about its absence."""
    if "hops" not in report:
        return ()
    told = []
    if not any(report.get(key) for key in _KEYS):
        told.append(
            "No variable was seen in two lists: only variables of the same name and type are compared, of lists that "
            "are defined."
        )
    if report.get("logged_hops"):
        told.append(
            "missed: changes of a list that a database has not. Delays are between two clocks, that of the database's "
            "controller and that of the capture."
        )
    if different := report["hops_of_other_types"]:
        told.append(f"Not compared, since their types differ: {first_few(different, _MOST_NAMED)}.")
    return told


_MOST_NAMED = 6


def _followed(row: Row) -> Cell:
    """Return how many changes followed; the others are to values that the other end never had."""
    text = f"{units.count(row['followed'])} of {units.count(row['changes'])}"
    if not row["changes"]:
        return Cell("no change", Tone.FAINT)
    return Cell(text, Tone.WARNING if row["followed"] < row["changes"] else Tone.PLAIN)


def _differed(row: Row) -> Cell:
    if not row["observed_ns"]:
        return Cell(NOTHING, Tone.FAINT)
    return Cell(units.percent(row["differed_ns"], row["observed_ns"]))


def _now(row: Row) -> Cell:
    if row["equal"]:
        return Cell("equal", Tone.FAINT)
    return Cell(f"{row['from']['text']} / {row['to']['text']}", Tone.WARNING)


_KEYS = ("hops", "page_hops", "logged_hops")


def _missed(row: Row) -> Cell:
    """Return how many changes of a list a database has not."""
    if "missed" not in row:
        return Cell(NOTHING, Tone.FAINT)
    return Cell(units.count(row["missed"]), Tone.WARNING if row["missed"] else Tone.FAINT)


_MISSED = Measure(Column("missed", right=True, importance=9), _missed)
_HOPS = (
    Measure(Column("variable", shortest=12, identifier=True), lambda row: Cell(row["variable"], Tone.STRONG)),
    Measure(Column("from", shortest=16, identifier=True), lambda row: Cell(units.list_key(row["from"]["list"]))),
    Measure(Column("to", shortest=16, identifier=True), lambda row: Cell(units.list_key(row["to"]["list"]))),
    Measure(Column("followed", right=True, importance=9), _followed),
    _MISSED,
    Measure(Column("delay p50", right=True, importance=10), lambda row: duration_cell(row["delay_ns"]["p50"])),
    Measure(Column("p99", right=True, importance=5), lambda row: duration_cell(row["delay_ns"]["p99"])),
    Measure(Column("max", right=True, importance=7), lambda row: duration_cell(row["delay_ns"]["max"])),
    Measure(Column("differed", right=True, importance=8), _differed),
    Measure(Column("at the end", importance=6), _now),
)
