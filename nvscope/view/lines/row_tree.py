"""What a tree tells of a row of a database: its table, and each of its values, with how often that has changed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nvscope import units
from nvscope.view.escape import visible
from nvscope.view.lines.layers import Layer
from nvscope.view.lines.row_line import NAME
from nvscope.view.lines.shown import Spans
from nvscope.view.lines.table import Cell, Tone
from nvscope.view.lines.tree_lines import INDENT, VARIABLES, Entry, Place, field_entry, title_entry
from nvscope.view.rows.database import ToldRows
from nvscope.view.rows.frames import FrameRows


class RowTree:
    """The part of a tree that is about a row, as a ``Tree``."""

    def __init__(self, rows: FrameRows, *, dumps: bool = True) -> None:
        self._part = rows.parts[NAME].part
        self._told = ToldRows.of(self._part)

    def spans(self, place: int) -> Spans:
        return Spans(0, 0, int(self._part.packets.captured[self._part.row[place]]))

    def layers(self, place: int, packet: bytes, link: int) -> Sequence[Layer]:
        return ()

    def entries(self, place: int, packet: bytes) -> Iterator[Entry]:
        logged, told = self._part.logged, self._told
        table = logged.tables[int(logged.table[place])]
        where = f"  {visible(table.title)}, table {visible(table.log.name)}, row id {int(logged.rowid[place])}"
        yield title_entry("DataLogger", [Cell(where)], Place(0, len(packet)))
        consistent = told.consistent[place]
        lost = Tone.WARNING if consistent == "0" else Tone.PLAIN
        meaning = "data was lost before this row" if consistent == "0" else ""
        line = [Cell(f"{'':{INDENT}}{'ConsistentDataSeries':<22}  "), Cell(visible(consistent) or "NULL", lost)]
        yield Entry(line, meaning)
        values = told.values[place]
        what = "only changes are stored" if table.log.only_changes else "every value is stored"
        facts = (
            f"  {units.count(len(values) + told.left_out[place])} of {units.count(len(table.log.variables))}, {what}"
        )
        yield title_entry(VARIABLES, [Cell(facts)])
        for value in values:
            changes = "change" if value.counter == "1" else "changes"
            changed = f", {value.counter} {changes}" if value.counter else ""
            content = packet[value.start : value.stop]
            yield field_entry(
                value.start, content, visible(value.variable.name), [Cell(visible(value.text))],
                visible(f"{value.variable.declared}{changed}"),
            )  # fmt: skip
        if told.left_out[place]:
            yield Entry([Cell(f"{'':{INDENT}}{units.count(told.left_out[place])} more", Tone.FAINT)])
