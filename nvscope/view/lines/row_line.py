"""A line a row of a database: when, which row of which table, and what it holds."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.view.escape import visible
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines import cells, moments
from nvscope.view.lines.fit import cut
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.table import GAP, Cell, Line, Tone
from nvscope.view.rows.database import RowValue, ToldRows
from nvscope.view.rows.frames import FrameRows

NAME = "db"
MOST_VALUES = 32
"""So many values of a row are told in a line."""

_TIME_DIGITS = 6
_GAP = " " * GAP


class RowLines:
    """A ``LineMaker``: number, time, the row, and its values; variables by what they are called in their program."""

    ends = False

    def __init__(self, moment: Moment = "r", width: int | None = None) -> None:
        self._moment: Moment = moment
        self._width = width
        self._widths = [0] * 3

    def lines(self, rows: FrameRows) -> Iterator[Line]:
        """Yield the lines of rows that are all of databases."""
        part = rows.parts[NAME].part
        told = ToldRows.of(part, MOST_VALUES)
        titles = [str(visible(table.title)) for table in part.tables]
        whence = [
            f"{titles[table]} #{rowid}"
            for table, rowid in zip(part.logged.table.tolist(), part.logged.rowid.tolist(), strict=True)
        ]
        columns = [cells.texts(FIELDS["frame.number"], rows), moments.told(rows, self._moment, _TIME_DIGITS), whence]
        self._widths = [
            max(width, max(map(len, column), default=0)) for width, column in zip(self._widths, columns, strict=True)
        ]
        number_width, time_width, row_width = self._widths
        for place, (number, time, row) in enumerate(zip(*columns, strict=True)):
            line = [
                Cell(f"{number:>{number_width}}", Tone.FAINT),
                Cell(f"{_GAP}{time:>{time_width}}"),
                Cell(f"{_GAP}{row:<{row_width}}"),
                Cell(f"{_GAP}{NAME}{_GAP}", Tone.STRONG),
            ]
            if told.consistent[place] == "0":
                line.append(Cell("data lost before this row  ", Tone.WARNING))
            line.append(Cell(visible(_values(told.values[place], told.left_out[place]))))
            yield line if self._width is None else cut(line, self._width)


def _values(values: list[RowValue], left_out: int) -> str:
    told = [f"{one.variable.name.rpartition('/')[2]}={one.text}" for one in values]
    more = f" … {left_out} more" if left_out else ""
    return f"{' '.join(told) or 'no value'}{more}"
