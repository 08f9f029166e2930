"""The list of frames: a line each, of which only those in view are made, however many there are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from textual.message import Message

from dissectors.batch import I64
from nvscope.tui.moving import step_of
from nvscope.tui.painting import CURSOR, DrawnLine
from nvscope.tui.scrolled_lines import ScrolledLines
from nvscope.view.lines.table import Cell, Line, Tone

_NONE = np.empty(0, np.int64)
_MATCH, _NO_MATCH = Cell("• ", Tone.NOTE), Cell("  ")
MARGIN = 2
"""So wide is what tells matches from others."""

MakeLines = Callable[[I64, int | None], Sequence[Line]]
"""Given frame numbers, and that of the frame shown before them, returns a line each."""


class PacketList(ScrolledLines):
    """Shows frames by their numbers, which rise; ``frame`` is the one under the cursor, None without any.

    ``follows``: the cursor stays on the last frame when more come.
    """

    class Moved(Message):
        """The cursor is on another frame."""

    class Opened(Message):
        """A line was clicked that the cursor was on."""

    def __init__(self, **how: Any) -> None:
        super().__init__(**how)
        self.numbers: I64 = _NONE
        self.frame: int | None = None
        self.follows = False
        self._make: MakeLines = lambda numbers, before: ()
        self._matches: I64 | None = None
        self._lines: dict[int, Line] = {}
        self._window: tuple[int, int] = (0, 0)

    def show(self, numbers: I64, make: MakeLines, matches: I64 | None = None) -> None:
        """Show other frames, or more of them; ``matches`` are those to be marked, None where nothing is.

        What is in view stays in view as long as it is there.
        """
        top = self.scroll_offset.y
        top_frame = int(self.numbers[top]) if top < len(self.numbers) else None
        self.numbers, self._make, self._matches = numbers, make, matches
        self._window = (0, 0)
        self.set_height(len(numbers))
        if not len(numbers):
            self.frame = None
        elif self.frame is None or self.follows:
            self.frame = int(numbers[-1 if self.follows else 0])
        else:
            self.frame = int(numbers[self.row])
        if top_frame is not None and not self.follows:
            self._scroll(int(np.searchsorted(numbers, top_frame)))
        self._bring_into_view()
        self.redraw()

    @property
    def row(self) -> int:
        """The row of the cursor: that of its frame, or of the next one where it is no more."""
        if self.frame is None or not len(self.numbers):
            return -1
        return min(int(np.searchsorted(self.numbers, self.frame)), len(self.numbers) - 1)

    def move(self, action: str) -> bool:
        """Move the cursor as an action says; False where that is none of moving."""
        step = step_of(action, self.size.height, len(self.numbers))
        if step is None:
            return False
        self.go_to(self.row + step)
        return True

    def go_to(self, row: int) -> None:
        """Put the cursor on a row, or on the nearest that there is."""
        if not len(self.numbers):
            return
        frame = int(self.numbers[min(max(row, 0), len(self.numbers) - 1)])
        if frame != self.frame:
            self.frame = frame
            self.post_message(self.Moved())
        self._bring_into_view()
        self.redraw()

    def text(self) -> str:
        """Return the line under the cursor as text."""
        row = self.row
        if row < 0:
            return ""
        before = int(self.numbers[row - 1]) if row else None
        return "".join(cell.text for line in self._make(self.numbers[row : row + 1], before) for cell in line)

    def _bring_into_view(self) -> None:
        height, top, row = max(self.size.height, 1), self.scroll_offset.y, self.row
        if row < 0 or top <= row < top + height:
            return
        if not self.follows and not top - height <= row < top + 2 * height:
            self._scroll(row - height // 2)  # what is far away is seen with what is around it
        else:
            self._scroll(row - height + 1 if row >= top + height else row)

    def _scroll(self, top: int) -> None:
        self.scroll_to(0, max(top, 0), animate=False, force=True, immediate=True)

    def on_resize(self) -> None:
        self._window = (0, 0)
        self.set_height(len(self.numbers))
        self._bring_into_view()

    def on_click(self, event: Any) -> None:
        row = self.scroll_offset.y + event.y
        if not 0 <= row < len(self.numbers):
            return
        if row == self.row:
            self.post_message(self.Opened())
        self.go_to(row)

    def _made(self) -> dict[int, Line]:
        """Return the lines in view by row."""
        first = self.scroll_offset.y
        stop = min(first + self.size.height, len(self.numbers))
        if self._window != (first, stop):
            own = self.numbers[first:stop]
            before = int(self.numbers[first - 1]) if first else None
            lines: Sequence[Line] = self._make(own, before) if len(own) else ()
            if self._matches is not None:
                is_match = np.isin(own, self._matches).tolist()
                lines = [
                    [_MATCH if match else _NO_MATCH, *line] for match, line in zip(is_match, lines, strict=False)
                ]  # fmt: skip
            self._lines = dict(enumerate(lines, first))
            self._window = (first, stop)
        return self._lines

    def line_in_view(self, y: int) -> DrawnLine:
        row = self.scroll_offset.y + y
        if row >= len(self.numbers) or not self.size.width:
            return DrawnLine()
        return DrawnLine(self._made().get(row, ()), CURSOR if row == self.row else None)
