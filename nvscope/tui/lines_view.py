"""Lines of text on the screen that can be scrolled, some of which are entries that a cursor moves over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from textual.geometry import Size
from textual.scroll_view import ScrollView
from textual.strip import Strip

from nvscope.tui.moving import step_of
from nvscope.tui.painting import CURSOR, DARK, Palette, strip_of
from nvscope.view.lines.table import Line


class LinesView(ScrollView):
    """Shows lines; ``starts`` are the first lines of entries, ``entry`` is the one under the cursor, -1 without any."""

    can_focus = False
    DEFAULT_CSS = """
    LinesView { height: 1fr; scrollbar-size-vertical: 1; scrollbar-size-horizontal: 0; overflow-x: hidden; }
    """

    def __init__(self, *, palette: Palette = DARK, **how: Any) -> None:
        super().__init__(**how)
        self.palette = palette
        self.lines: Sequence[Line] = ()
        self.starts: Sequence[int] = ()
        self.entry = -1

    def show(self, lines: Sequence[Line], starts: Sequence[int] = (), entry: int | None = None) -> None:
        """Show other lines; the cursor is put on an entry, or stays at its place."""
        self.lines, self.starts = lines, starts
        wanted = self.entry if entry is None else entry
        self.entry = min(max(wanted, 0), len(starts) - 1)
        self.virtual_size = Size(self.size.width, len(lines))
        if entry is not None:
            self._bring_into_view()
        self.refresh()

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
        self.refresh()
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
        self.virtual_size = Size(self.size.width, len(self.lines))

    def render_line(self, y: int) -> Strip:
        width, at, base = self.size.width, self.scroll_offset.y + y, self.rich_style
        if at >= len(self.lines):
            return Strip.blank(width, base)
        over = CURSOR if 0 <= self.entry < len(self.starts) and at == self.starts[self.entry] else None
        return strip_of(self.lines[at], width, self.palette, over).apply_style(base)
