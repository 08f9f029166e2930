"""The fields of a frame: a tree whose lines know their bytes; headers that carry the message are folded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dissectors.batch import Bool
from nvscope.tui.lines_view import LinesView
from nvscope.tui.packets.text import first_line
from nvscope.tui.painting import CHANGED, CURSOR, DrawnLine, MarkedSpans
from nvscope.view.lines.table import Cell, Line, Tone
from nvscope.view.lines.tree import PlacedLine
from nvscope.view.lines.tree_lines import BYTES_AT, SHOWN_BYTES, Place

_FOLDED, _UNFOLDED = Cell("+ ", Tone.FAINT), Cell("- ", Tone.FAINT)
_NO_SIGN = Cell("  ")
SIGN_WIDTH = 2


class FieldsPane(LinesView):
    """Shows a tree; the cursor is on one of its lines, ``is_lit`` whether that stands out.

    Parts of the tree are folded by their title, the same in every frame: at first all that is in front of the message.
    """

    def __init__(self, **how: Any) -> None:
        super().__init__(**how)
        self.is_lit = False
        self._tree: Sequence[PlacedLine] = ()
        self._shown: list[int] = []
        self._folds: dict[str, bool] = {}
        self._changed: Bool | None = None
        self._tells_bytes = False
        # The title of a part, and which of its lines; None until somebody has moved the cursor.
        self._at: tuple[str, int] | None = None

    def tell(self, tree: Sequence[PlacedLine], changed: Bool | None, *, tells_bytes: bool) -> None:
        """Show the tree of another frame; the cursor stays on the same field where there is one.

        ``tells_bytes``: its lines have the bytes, of which those that ``changed`` are underlined.
        """
        self._tree, self._changed, self._tells_bytes = tree, changed, tells_bytes
        self._again()

    def _identities(self) -> list[tuple[str, int]]:
        found, title, count = [], "", 0
        for line in self._tree:
            title, count = (line.title, 0) if line.title else (title, count + 1)
            found.append((title, count))
        return found

    def _again(self) -> None:
        lines: list[Line] = []
        self._shown = []
        is_folded = False
        for at, line in enumerate(self._tree):
            if line.title:
                is_folded = self._is_folded(line)
            elif is_folded:
                continue
            self._shown.append(at)
            sign = (_FOLDED if is_folded else _UNFOLDED) if line.title else _NO_SIGN
            lines.append([sign, *line.line])
        identities = self._identities()
        first = self._row_of(first_line(self._tree) if self._tree else 0)
        wanted = self._at
        if wanted is None:
            self.show(lines, range(len(lines)), first)
            if len(lines) > self.size.height:
                is_title = self._tree[self._shown[first]].title
                self.scroll_to(0, first if is_title else first - 1, animate=False, force=True, immediate=True)
            return
        # Where the part is folded, or shorter here, it is its last line.
        own = [row for row, at in enumerate(self._shown) if identities[at][0] == wanted[0]]
        entry = next((row for row in own if identities[self._shown[row]] == wanted), own[-1] if own else first)
        self.show(lines, range(len(lines)), entry)

    def _is_folded(self, line: PlacedLine) -> bool:
        return self._folds.get(line.title, line.is_carrier)

    def _row_of(self, at: int) -> int:
        return next((row for row, own in enumerate(self._shown) if own >= at), max(len(self._shown) - 1, 0))

    def move(self, action: str) -> bool:
        known = super().move(action)
        if known:
            self._note()
        return known

    def _note(self) -> None:
        if self._shown:
            self._at = self._identities()[self._shown[self.entry]]

    def fold(self) -> bool:
        """Fold the part whose title is under the cursor, or unfold it; False where there is none."""
        line = self.current
        if line is None or not line.title:
            return False
        self._folds[line.title] = not self._is_folded(line)
        self._again()
        return True

    @property
    def current(self) -> PlacedLine | None:
        """The line under the cursor."""
        return self._tree[self._shown[self.entry]] if 0 <= self.entry < len(self._shown) else None

    @property
    def title(self) -> str:
        """The title of the part that the cursor is in."""
        if 0 <= self.entry < len(self._shown):
            return self._identities()[self._shown[self.entry]][0]
        return ""

    @property
    def place(self) -> Place | None:
        """The bytes that the line under the cursor is about."""
        line = self.current
        return None if line is None else line.place

    def go_to_byte(self, byte: int) -> None:
        """Put the cursor on the line that tells most closely of a byte, which is unfolded if it has to be."""
        best: tuple[int, int] | None = None
        for at, line in enumerate(self._tree):
            if line.place is not None and line.place.start <= byte < line.place.stop:
                size = line.place.stop - line.place.start
                if best is None or size < best[0]:
                    best = size, at
        if best is None:
            return
        self._at = self._identities()[best[1]]
        if best[1] not in self._shown:
            self._folds[self._at[0]] = False
        self._again()

    def text(self) -> str:
        """Return the line under the cursor as text."""
        line = self.current
        return "" if line is None else "".join(cell.text for cell in line.line).strip()

    def on_click(self, event: Any) -> None:
        row = self.scroll_offset.y + event.y
        if 0 <= row < len(self._shown):
            again = row == self.entry
            self.entry = row
            self._note()
            if again:
                self.fold()
            self.redraw()

    def line_in_view(self, y: int) -> DrawnLine:
        row = self.scroll_offset.y + y
        if row >= len(self.lines):
            return DrawnLine()
        over = CURSOR if self.is_lit and row == self.entry else None
        return DrawnLine(self.lines[row], over, (MarkedSpans(self._changed_at(row), CHANGED),))

    def _changed_at(self, row: int) -> list[tuple[int, int]]:
        """Return the columns of bytes that changed."""
        line = self._tree[self._shown[row]]
        if self._changed is None or not self._tells_bytes or line.place is None or not line.tells_place:
            return []
        own = np.flatnonzero(self._changed[line.place.start : line.place.stop])
        size = line.place.stop - line.place.start
        most = size if size <= SHOWN_BYTES else SHOWN_BYTES - 1
        first = SIGN_WIDTH + BYTES_AT
        return [(first + 3 * at, first + 3 * at + 2) for at in own.tolist() if at < most]
