"""The table of what is spoken over the ports of web visualization beside it, and is not decoded.

Takes the rows of the report of schema ``nvscope.report/2``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Sequence

from dissectors.web_protocols import WebProtocol
from nvscope.view.lines.plant.content import Report, Row, node_names
from nvscope.view.lines.plant.tables import Measure, count_cell
from nvscope.view.lines.table import Cell, Column, Tone
from nvscope.view.lines.visu_words import protocol_words

TITLE = "Not decoded, on the ports of WebVisu"
MOST_ROWS = 20
"""So many are shown unless all are wanted."""


def others(report: Report, most: int | None = None) -> tuple[list[Measure], list[Row], int]:
    """Return columns and rows of the table, and how many rows there are beside these."""
    found: Sequence[Row] = report.get("visu_others", ())
    names = node_names(report)
    rows: list[Row] = [
        {
            **row,
            "says": names.get(row["client"], row["client"]),
            "to": names.get(row["server"], row["server"]),
            "words": protocol_words(WebProtocol[row["protocol"].upper().replace("-", "_")]),
        }
        for row in found[:most]
    ]
    return list(ROWS), rows, len(found) - len(rows)


ROWS = (
    Measure(Column("who", shortest=12, identifier=True), lambda row: Cell(row["says"], Tone.STRONG)),
    Measure(Column("whom", shortest=12, identifier=True), lambda row: Cell(row["to"])),
    Measure(Column("port", right=True), lambda row: Cell(str(row["port"]))),
    Measure(Column("what"), lambda row: Cell(row["words"])),
    Measure(Column("times", right=True), lambda row: count_cell(row["count"])),
    Measure(Column("first frame", right=True, importance=5), lambda row: count_cell(row["first_frame"])),
)
