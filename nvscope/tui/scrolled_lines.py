"""Lines that can be scrolled: only those in view are made, and only those that changed are drawn again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from rich.style import Style
from textual.geometry import Region, Size
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.widget import Widget

from nvscope.tui.painting import DARK, Palette, marked, strip_of
from nvscope.view.lines.table import Line


class MarkedSpans(NamedTuple):
    """Stretches of the columns of a line, which rise, and the style that lies over them."""

    spans: Sequence[tuple[int, int]]
    style: Style


class DrawnLine(NamedTuple):
    """A line as it is drawn: ``over`` lies over the styles of all its cells, ``marks`` over some columns."""

    line: Line = ()
    over: Style | None = None
    marks: Sequence[MarkedSpans] = ()


class ScrolledLines(ScrollView):
    """Shows what ``line_in_view`` says; whoever changes that calls ``redraw``.

    A screen is looked at over slow lines, too: lines that are the same as before are not sent again.
    """

    can_focus = False
    DEFAULT_CSS = """
    ScrolledLines { height: 1fr; scrollbar-size-vertical: 1; scrollbar-size-horizontal: 0; overflow-x: hidden; }
    """

    def __init__(self, *, palette: Palette = DARK, **how: Any) -> None:
        super().__init__(**how)
        self.palette = palette
        self._base = Style()
        # What was drawn on each line of the view, and what else it hangs on.
        self._drawn: dict[int, DrawnLine] = {}
        self._drawn_for: tuple[object, ...] = ()

    def line_in_view(self, y: int) -> DrawnLine:
        """Return what stands on a line of the view, counted from its top."""
        raise NotImplementedError

    def set_height(self, lines: int) -> None:
        """Note how many lines there are to be scrolled."""
        size, before = Size(self.size.width, lines), self.virtual_size
        if self.show_vertical_scrollbar and size.width == before.width and lines > self.container_size.height:
            # The scroll bar stays, so nothing else has another place: no layout, which costs more than drawing.
            self.set_reactive(Widget.virtual_size, size)
            self.vertical_scrollbar.window_virtual_size = lines
        else:
            self.virtual_size = size

    def redraw(self) -> None:
        """Draw what changed since it was drawn last."""
        drawn_for = self._hangs_on()
        if drawn_for != self._drawn_for:
            self._drawn.clear()
            self.refresh()
            return
        width = self.size.width
        changed = [y for y, drawn in self._drawn.items() if self.line_in_view(y) != drawn]
        if len(changed) == len(self._drawn):
            self.refresh()
        elif changed:
            self.refresh(*(Region(0, y, width, 1) for y in changed))

    def _hangs_on(self) -> tuple[object, ...]:
        return self.size, self.scroll_offset, id(self.palette), self.rich_style

    def render_lines(self, crop: Region) -> list[Strip]:
        self._base, self._drawn_for = self.rich_style, self._hangs_on()
        return super().render_lines(crop)

    def render_line(self, y: int) -> Strip:
        width = self.size.width
        if not width:
            return Strip.blank(width, self._base)
        drawn = self._drawn[y] = self.line_in_view(y)
        strip = strip_of(drawn.line, width, self.palette, drawn.over)
        for spans, style in drawn.marks:
            if spans:
                strip = marked(strip, spans, style)
        return strip.apply_style(self._base)
