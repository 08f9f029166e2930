"""Lines on the screen that are drawn anew for each size, as plots are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from textual.strip import Strip
from textual.widget import Widget

from nvscope.tui.painting import DARK, Palette, strip_of
from nvscope.view.lines.table import Line

Draw = Callable[[int, int], Sequence[Line]]
"""Given a width and a height of at least 1, returns at most so many lines."""


class DrawnView(Widget):
    """Shows what is drawn for its size."""

    can_focus = False

    def __init__(self, *, palette: Palette = DARK, **how: Any) -> None:
        super().__init__(**how)
        self.palette = palette
        self._draw: Draw = lambda _width, _height: ()
        self._lines: Sequence[Line] | None = None

    def show(self, draw: Draw) -> None:
        """Show something else."""
        self._draw, self._lines = draw, None
        self.refresh()

    def on_resize(self) -> None:
        self._lines = None

    def render_line(self, y: int) -> Strip:
        width, height = self.size
        if not width or not height:
            return Strip.blank(width, self.rich_style)
        if self._lines is None:
            self._lines = self._draw(width, height)
        line: Line = self._lines[y] if y < len(self._lines) else ()
        return strip_of(line, width, self.palette).apply_style(self.rich_style)
