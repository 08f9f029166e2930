"""The bytes of a frame: those of the field under the cursor lit, those that changed underlined."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from textual.message import Message

from dissectors.batch import Bool
from nvscope.tui.painting import CHANGED, CURSOR, DrawnLine, MarkedSpans
from nvscope.tui.scrolled_lines import ScrolledLines
from nvscope.view.lines.hexdump import PER_LINE, TonedSpan, dump
from nvscope.view.lines.table import Cell, Line
from nvscope.view.lines.tree_lines import Place

_FEWER = 8
_OFFSET = 6
_GAP = 2


def width_of(per_line: int) -> int:
    """Return how many columns a dump of so many bytes a line takes."""
    return _OFFSET + 3 * per_line + _GAP + per_line


class BytesPane(ScrolledLines):
    """Shows bytes; ``byte`` is the one under the cursor, which stands in brackets where ``has_keys``."""

    class Picked(Message):
        """A byte was clicked."""

    def __init__(self, **how: Any) -> None:
        super().__init__(**how)
        self.packet = b""
        self.byte = 0
        self.lit: Place | None = None
        self.has_keys = False
        self._parts: Sequence[TonedSpan] = ()
        self._changed: Bool | None = None
        self._lines: list[Line] = []

    @property
    def per_line(self) -> int:
        """How many bytes there are room for in a line."""
        return PER_LINE if self.size.width >= width_of(PER_LINE) else _FEWER

    def tell(self, packet: bytes, parts: Sequence[TonedSpan], changed: Bool | None) -> None:
        """Show other bytes; the cursor stays at its offset."""
        self.packet, self._parts, self._changed = packet, parts, changed
        self.byte = min(self.byte, max(len(packet) - 1, 0))
        self._draw()

    def light(self, place: Place | None) -> None:
        """Let the bytes of a field stand out, None for those of none."""
        self.lit = place
        if place is not None and not self.has_keys:
            self.byte = min(place.start, max(len(self.packet) - 1, 0))
        self._bring_into_view()
        self.redraw()

    def _draw(self) -> None:
        per_line = self.per_line
        self._lines = list(dump(self.packet, self._parts, per_line=per_line))
        self.set_height(len(self._lines))
        self._bring_into_view()
        self.redraw()

    def move(self, action: str) -> bool:
        """Move the cursor as an action says; False where that is none of moving."""
        line = self.per_line
        page = max(self.size.height, 1) * line
        steps = {
            "move.left": -1, "move.right": 1, "move.down": line, "move.up": -line, "move.page-down": page,
            "move.page-up": -page, "move.half-page-down": page // 2, "move.half-page-up": -page // 2,
            "move.first": -len(self.packet), "move.last": len(self.packet),
        }  # fmt: skip
        if action not in steps:
            return False
        self.byte = min(max(self.byte + steps[action], 0), max(len(self.packet) - 1, 0))
        self._bring_into_view()
        self.redraw()
        return True

    def text(self) -> str:
        """Return the bytes that stand out, else all, as digits."""
        place = self.lit or Place(0, len(self.packet))
        return self.packet[place.start : place.stop].hex(" ")

    def _bring_into_view(self) -> None:
        row, top, height = self.byte // self.per_line, self.scroll_offset.y, max(self.size.height, 1)
        if not top <= row < top + height:
            target = row if row < top else row - height + 1
            self.scroll_to(0, max(target, 0), animate=False, force=True, immediate=True)

    def on_resize(self) -> None:
        self._draw()

    def on_click(self, event: Any) -> None:
        at = (event.x - _OFFSET) // 3
        byte = (self.scroll_offset.y + event.y) * self.per_line + at
        if 0 <= at < self.per_line and byte < len(self.packet):
            self.byte = byte
            self.post_message(self.Picked())

    def line_in_view(self, y: int) -> DrawnLine:
        row = self.scroll_offset.y + y
        if row >= len(self._lines):
            return DrawnLine()
        per_line = self.per_line
        first = row * per_line
        marks = []
        if self._changed is not None:
            own = np.flatnonzero(self._changed[first : first + per_line]).tolist()
            marks.append(MarkedSpans([(_OFFSET + 3 * at, _OFFSET + 3 * at + 2) for at in own], CHANGED))
        if self.lit is not None:
            start, stop = max(self.lit.start - first, 0), min(self.lit.stop - first, per_line)
            if start < stop:
                letters = _OFFSET + 3 * per_line + _GAP
                lit = [(_OFFSET + 3 * start, _OFFSET + 3 * stop - 1), (letters + start, letters + stop)]
                marks.append(MarkedSpans(lit, CURSOR))
        return DrawnLine(self._bracketed(row), marks=marks)

    def _bracketed(self, row: int) -> Line:
        """Return a line with brackets around the byte under the cursor, where that is in it."""
        line, (at_row, at) = self._lines[row], divmod(self.byte, self.per_line)
        if not self.has_keys or at_row != row or not self.packet:
            return line
        before = _OFFSET + 3 * at - 1
        return _replaced(_replaced(line, before, "["), before + 3, "]")


def _replaced(line: Line, column: int, sign: str) -> Line:
    """Return a line with a sign in one of its columns."""
    cells: list[Cell] = []
    at = 0
    for cell in line:
        place = column - at
        if 0 <= place < len(cell.text):
            cell = Cell(f"{cell.text[:place]}{sign}{cell.text[place + 1 :]}", cell.tone)  # noqa: PLW2901
        cells.append(cell)
        at += len(cell.text)
    return cells
