"""A table of which only the rows in view are made, with a cursor; columns never get narrower."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any

from msgspec import Struct, field
from textual.message import Message

from nvscope.tui.moving import step_of
from nvscope.tui.painting import CURSOR, DrawnLine
from nvscope.tui.scrolled_lines import ScrolledLines
from nvscope.view.lines.table import GAP, Cell, Column, Fitting, Line, fitting, heading, table_line

LONGEST_STRIP = 60
_SHORTEST_STRIP, _WANTED_STRIP = 10, 20
_MAY_GO = 3
"""Columns of at most this importance go for a strip that shows something."""


class Table(Struct, frozen=True):
    """What a table shows: its columns, how many rows, and the cells of a row when they are asked for.

    ``key`` tells what a row is about, so that the cursor stays on it where rows move; ``find`` knows where it is then,
    None where all are looked at. ``stretches`` is the place of a column that takes what room is left, whose cells
    ``strips`` makes of rows and a width; ``title`` is made of the width.
    """

    columns: Sequence[Column]
    count: int
    cells: Callable[[int], Sequence[Cell]]
    key: Callable[[int], Hashable]
    stretches: int | None = None
    strips: Callable[[Sequence[int], int], Sequence[Cell]] | None = None
    title: Callable[[int], str] | None = None
    find: Callable[[Hashable], int | None] | None = None


_NO_TABLE = Table((), 0, lambda _: (), lambda row: row)


class _Fitted(Struct):
    """How a table fits, as long as nothing changes: its fitting, and lines by row."""

    found: Fitting | None = None
    columns: Sequence[Column] = ()
    heading: Line = ()
    lines: dict[int, Line] = field(default_factory=dict)
    window: tuple[int, int, int] = (0, 0, 0)


class TableView(ScrolledLines):
    """Shows a ``Table``; the row under the cursor is ``row``, -1 without any."""

    class Opened(Message):
        """A row was clicked that the cursor was on."""

    class Moved(Message):
        """The cursor is on another row."""

    def __init__(self, **how: Any) -> None:
        super().__init__(**how)
        self.table = _NO_TABLE
        self.row = -1
        self._key: Hashable = None
        self._least: list[int] = []
        self._fitted = _Fitted()
        self.follows = False
        """Whether the cursor stays on the last row when more come."""

    def show(self, table: Table) -> None:
        """Show another table, or the same with other rows; the cursor stays on what it was on."""
        if [one.title for one in table.columns] != [one.title for one in self.table.columns]:
            self._least = []
        self.table = table
        self._fitted = _Fitted()
        if not table.count:
            self.row, self._key = -1, None
        elif self.follows or self.row < 0:
            self.row = table.count - 1 if self.follows else 0
        elif self.row >= table.count or table.key(self.row) != self._key:
            find = table.find or (lambda key: next((row for row in range(table.count) if table.key(row) == key), None))
            found = find(self._key)
            self.row = min(self.row, table.count - 1) if found is None else found
        if self.row >= 0:
            self._key = table.key(self.row)
        # One line more: the heading stays in view above the rows.
        self.set_height(table.count + 1)
        self._bring_into_view()
        self.redraw()

    @property
    def key(self) -> Hashable:
        """What the row under the cursor is about, None without a row."""
        return self._key

    def text(self) -> str:
        """Return the row under the cursor as text."""
        if self.row < 0:
            return ""
        self._fit()
        return "".join(cell.text for cell in self._line(self.row))

    def move(self, action: str) -> bool:
        """Move the cursor as an action says; False where that is none of moving."""
        step = step_of(action, self.size.height - 1, self.table.count)
        if step is None:
            return False
        self.go_to(self.row + step)
        return True

    def go_to(self, row: int) -> None:
        """Put the cursor on a row, or on the nearest that there is."""
        if not self.table.count:
            return
        row = min(max(row, 0), self.table.count - 1)
        if row != self.row:
            self.row, self._key = row, self.table.key(row)
            self.post_message(self.Moved())
        self._bring_into_view()
        self.redraw()

    def _bring_into_view(self) -> None:
        height = max(self.size.height - 1, 1)
        top = self.scroll_offset.y
        if self.row >= 0 and not top <= self.row < top + height:
            target = self.row - height + 1 if self.row >= top + height else self.row
            self.scroll_to(0, max(target, 0), animate=False, force=True)

    def on_resize(self) -> None:
        self._least = []
        self._fitted = _Fitted()
        self.set_height(self.table.count + 1)
        self._bring_into_view()

    def on_click(self, event: Any) -> None:
        row = self.scroll_offset.y + event.y - 1
        if event.y < 1 or not 0 <= row < self.table.count:
            return
        if row == self.row:
            self.post_message(self.Opened())
        self.go_to(row)

    def _window(self) -> tuple[int, int, int]:
        top = self.scroll_offset.y
        # The scroll bar lies over what stands there.
        return top, min(top + max(self.size.height - 1, 0), self.table.count), self.scrollable_content_region.width

    def _fit(self) -> None:
        """Find out how the rows in view fit the width."""
        window = self._window()
        if self._fitted.found is not None and self._fitted.window == window:
            return
        table, (first, stop, width) = self.table, window
        rows = [table.cells(row) for row in range(first, stop)]
        if not self._least:
            self._least = [0] * len(table.columns)
        columns = list(table.columns)
        if table.stretches is not None and table.strips is not None:
            found = fitting(columns, rows, None, least=self._least)
            self._least = list(found.natural)
            kept = self._kept(columns, width)
            room = width - sum(self._least[place] for place in kept) - GAP * len(kept)
            room = max(_SHORTEST_STRIP, min(LONGEST_STRIP, room))
            title = table.title(room) if table.title else ""
            at = sum(place < table.stretches for place in kept)
            strips = table.strips(range(first, stop), room)
            columns = _with(
                [columns[place] for place in kept], at, Column(title, shortest=_SHORTEST_STRIP, verbatim=True)
            )
            rows = [
                _with([cells[place] for place in kept], at, drawn) for cells, drawn in zip(rows, strips, strict=True)
            ]
            least = _with([self._least[place] for place in kept], at, room)
            found = fitting(columns, rows, width, least=least)
        else:
            found = fitting(columns, rows, width, least=self._least)
            self._least = list(found.natural)
        lines = {
            row: table_line(columns, found, cells) for row, cells in zip(range(first, stop), rows, strict=True)
        }  # fmt: skip
        self._fitted = _Fitted(found, columns, heading(columns, found), lines, window)

    def _kept(self, columns: Sequence[Column], width: int) -> list[int]:
        """Return the columns that stay beside the strip: those of least importance go for one that shows something."""
        kept = list(range(len(columns)))
        while width - sum(self._least[place] for place in kept) - GAP * len(kept) < _WANTED_STRIP:
            low = [(one, place) for place in kept if (one := columns[place].importance) is not None and one <= _MAY_GO]
            if not low:
                break
            kept.remove(min(low)[1])
        return kept

    def _line(self, row: int) -> Line:
        return self._fitted.lines.get(row, ())

    def line_in_view(self, y: int) -> DrawnLine:
        if not self.table.columns or not self.size.width:
            return DrawnLine()
        self._fit()
        if y == 0:
            return DrawnLine(self._fitted.heading)
        row = self.scroll_offset.y + y - 1
        return DrawnLine(self._line(row), CURSOR if row == self.row else None)


def _with(items: Sequence[Any], at: int, item: Any) -> list[Any]:
    return [*items[:at], item, *items[at:]]
