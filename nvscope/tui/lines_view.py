"""Lines of text on the screen that can be scrolled, some of which are entries that a cursor moves over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nvscope.tui.moving import step_of
from nvscope.tui.painting import CURSOR, DrawnLine
from nvscope.tui.scrolled_lines import ScrolledLines
from nvscope.view.lines.table import Line


class LinesView(ScrolledLines):
    """Shows lines; ``starts`` are the first lines of entries, ``entry`` is the one under the cursor, -1 without any."""

    def __init__(self, **how: Any) -> None:
        super().__init__(**how)
        self.lines: Sequence[Line] = ()
        self.starts: Sequence[int] = ()
        self.entry = -1

    def show(self, lines: Sequence[Line], starts: Sequence[int] = (), entry: int | None = None) -> None:
        """Show other lines; the cursor is put on an entry, or stays at its place."""
        self.lines, self.starts = lines, starts
        wanted = self.entry if entry is None else entry
        self.entry = min(max(wanted, 0), len(starts) - 1)
        self.set_height(len(lines))
        if entry is not None:
            self._bring_into_view()
        self.redraw()

    def move(self, action: str) -> bool:
        """Move as an action says, from entry to entry where there are any; False where that is none of moving."""
        step = step_of(action, self.size.height - 1, len(self.lines))
        if step is None:
            return False
        if self.starts and action in ("move.down", "move.up", "move.first", "move.last"):
            self.entry = min(max(self.entry + step, 0), len(self.starts) - 1)
            self._bring_into_view()
        else:
            self.scroll_to(0, self.scroll_offset.y + step, animate=False, force=True)
        self.redraw()
        return True

    def _bring_into_view(self) -> None:
        if not 0 <= self.entry < len(self.starts):
            return
        first = self.starts[self.entry]
        stop = self.starts[self.entry + 1] if self.entry + 1 < len(self.starts) else len(self.lines)
        top, height = self.scroll_offset.y, max(self.size.height, 1)
        if first < top or stop > top + height:
            target = first if first < top or stop - first > height else stop - height
            self.scroll_to(0, max(target, 0), animate=False, force=True)

    def on_resize(self) -> None:
        self.set_height(len(self.lines))

    def line_in_view(self, y: int) -> DrawnLine:
        at = self.scroll_offset.y + y
        if at >= len(self.lines):
            return DrawnLine()
        is_current = 0 <= self.entry < len(self.starts) and at == self.starts[self.entry]
        return DrawnLine(self.lines[at], CURSOR if is_current else None)
