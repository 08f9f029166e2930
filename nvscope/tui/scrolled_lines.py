"""Lines that can be scrolled: only those in view are made, and only those that changed are drawn again."""

from __future__ import annotations

from typing import Any

from textual.geometry import Region, Size
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.widget import Widget

from nvscope.tui.painting import DARK, DrawnLine, Palette, strip_of_drawn


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
        self._base = self.rich_style
        # What was drawn on each line of the view.
        self._drawn: dict[int, DrawnLine] = {}

    def line_in_view(self, y: int) -> DrawnLine:
        """Return what stands on a line of the view, counted from its top."""
        raise NotImplementedError

    def set_height(self, lines: int) -> None:
        """Note how many lines there are to be scrolled."""
        size = Size(self.size.width, lines)
        has_bar, keeps_height = lines > self.container_size.height, not self.styles.is_auto_height
        stays = has_bar == self.show_vertical_scrollbar and size.width == self.virtual_size.width
        if not stays or not (has_bar or keeps_height):
            self.virtual_size = size
            return
        # Nothing else has another place then: no layout, which costs more than drawing.
        self.set_reactive(Widget.virtual_size, size)
        if has_bar:
            self.vertical_scrollbar.window_virtual_size = lines
        if self.scroll_offset.y > self.max_scroll_y:
            self.scroll_to(0, self.max_scroll_y, animate=False, force=True)

    def watch_show_vertical_scrollbar(self, is_shown: bool) -> None:
        if is_shown:
            # What was scrolled before it was there, it has not been told.
            self.vertical_scrollbar.position = self.scroll_y

    def redraw(self) -> None:
        """Draw what changed since it was drawn last; what is drawn as a whole, as after scrolling, is anyway."""
        width, height = self.size
        shown = {y: drawn for y, drawn in self._drawn.items() if y < height}
        changed = [y for y, drawn in shown.items() if self.line_in_view(y) != drawn]
        if len(changed) == len(shown):
            self.refresh()
        elif changed:
            self.refresh(*(Region(0, y, width, 1) for y in changed))

    def render_lines(self, crop: Region) -> list[Strip]:
        self._base = self.rich_style
        return super().render_lines(crop)

    def render_line(self, y: int) -> Strip:
        width = self.size.width
        if not width:
            return Strip.blank(width, self._base)
        drawn = self._drawn[y] = self.line_in_view(y)
        return strip_of_drawn(drawn, width, self.palette).apply_style(self._base)
