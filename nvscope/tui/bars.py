"""The bars of the screen: what is watched and how it is, the views, and what keys do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from textual.strip import Strip
from textual.widget import Widget

from nvscope import units
from nvscope.findings.kind import Severity
from nvscope.tui.actions import Keymap
from nvscope.tui.look import Look
from nvscope.tui.painting import DARK, Palette, strip_of
from nvscope.view.escape import visible
from nvscope.view.lines.fit import cut
from nvscope.view.lines.plant.happenings import is_now, severity_of, symbol
from nvscope.view.lines.short_names import short_names
from nvscope.view.lines.table import Cell, Line, Tone
from nvscope.view.lines.text_width import display_width, shorten

_LEAST_NAME = 16
_LOUD = 8  # from so much on, it is told that something is wrong


class Bar(Widget):
    """One line of toned text, with a part at the right where there is room."""

    can_focus = False
    DEFAULT_CSS = """
    Bar { height: 1; width: 100%; }
    """

    def __init__(self, *, palette: Palette = DARK, **how: Any) -> None:
        super().__init__(**how)
        self.palette = palette
        self._left: Line = ()
        self._right: Line = ()

    def tell(self, left: Line, right: Line = ()) -> None:
        """Show other text."""
        if (left, right) != (self._left, self._right):
            self._left, self._right = left, right
            self.refresh()

    def render_line(self, y: int) -> Strip:
        width = self.size.width
        taken, right = _width(self._left), _width(self._right)
        line = cut(self._left, width) if taken > width else list(self._left)
        if self._right and taken + right + 1 <= width:
            line += [Cell(" " * (width - taken - right)), *self._right]
        return strip_of(line, width, self.palette).apply_style(self.rich_style)

    def on_click(self, event: Any) -> None:
        self.clicked(event.x)

    def clicked(self, x: int) -> None:
        """Somebody clicked at a column."""


def _width(line: Line) -> int:
    return sum(display_width(cell.text) for cell in line)


def head(look: Look, state: str, width: int) -> tuple[Line, Line]:
    """Return what is watched and how it is, and the time, in so many columns; ``state`` says whether time goes on.

    Where there is little room, what is least telling is left out.
    """
    report, scene = look.report, look.scene
    start_ns = scene.snapshot.summary.start_ns
    rows = [cause for cause in report["causes"] if severity_of(cause) > Severity.NOTE]
    now = [cause for cause in rows if is_now(cause)]
    # What is told, and how much it matters.
    parts: list[tuple[int, Cell]] = []
    if start_ns is not None:
        parts.append((2, Cell(units.duration(look.now_ns - start_ns), Tone.FAINT)))
    infos = scene.snapshot.infos
    failed = [info for info in infos if info.failure]
    if not rows and report["lists"] and not failed:
        parts.append((9, Cell("● all well", Tone.GOOD)))
    for severity in (Severity.ERROR, Severity.WARNING):
        if number := sum(severity_of(cause) is severity for cause in now):
            parts.append((9, Cell(f"{symbol(severity).text} {number} now", symbol(severity).tone)))
    if passed := len(rows) - len(now):
        parts.append((5, Cell(f"{passed} passed", Tone.FAINT)))
    parts.append((6, Cell(units.count_of(len(report["lists"]), "list"))))
    if failed:
        parts.append((9, Cell(f"✗ {visible(failed[0].path)} ended", Tone.ERROR)))
    rate = scene.pace.of_all()
    if rate is not None and look.live and not failed:
        parts.append((4, Cell(units.rate(rate))))
    drops = report["capture"]["drops"]
    if drops or look.live:
        told = "dropped ?" if drops is None else f"dropped {units.count(drops)}"
        parts.append((8 if drops else 3, Cell(told, Tone.ERROR if drops else Tone.FAINT)))
    right = [Cell(f"{state} ", Tone.WARNING)] if state else []
    clock = [Cell(f"{look.clock.second(look.now_ns).rpartition(' ')[2]} ")] if start_ns is not None else []
    names = ", ".join(visible(info.path) for info in infos[:2]) + (f" +{len(infos) - 2}" if len(infos) > 2 else "")
    title, shortest = [Cell(" nvscope ", Tone.STRONG)], min(display_width(names), _LEAST_NAME)
    while True:
        taken = _width([*title, *right, *clock, *(cell for _, cell in parts)]) + 3 * len(parts) + 1
        if taken + shortest <= width:
            break
        # What is broken is told as long as there is room for anything.
        if quiet := [part for part in parts if part[0] < _LOUD]:
            parts.remove(min(quiet, key=lambda part: part[0]))
        elif title:
            title = []
        elif clock:
            clock = []
        elif shortest:
            shortest = 0
        elif parts:
            parts.remove(min(parts, key=lambda part: part[0]))
        else:
            break
    room = max(width - taken, shortest)
    line = title or [Cell(" ")]
    if room:
        line.append(Cell(short_names({names}, room).get(names, names) if display_width(names) > room else names))
    for place, (_, cell) in enumerate(parts):
        line += [Cell("   " if room or place else ""), cell]
    right += clock
    return line, right


class Tabs(Bar):
    """The views with their keys; the one in front stands out. Where there is little room, they stand closer."""

    def __init__(self, titles: Sequence[str], keys: Sequence[str]) -> None:
        super().__init__(id="tabs")
        self._titles = titles
        self._told = [f"{key} {title}".strip() for key, title in zip(keys, titles, strict=True)]
        self._place = -1

    def front(self, place: int) -> None:
        """Show which view is in front."""
        self._place = place
        self._lay_out()

    def on_resize(self) -> None:
        self._lay_out()

    @property
    def _gap(self) -> int:
        """How wide it is between two of them: each has a side of its own there, or both share it."""
        wide = 1 + sum(display_width(told) + 2 for told in self._told)
        return 2 if wide <= self.size.width else 1

    def _lay_out(self) -> None:
        line: list[Cell] = [Cell(" ")]
        for number, told in enumerate(self._told):
            is_front = number == self._place
            if self._gap > 1 or not number:
                line.append(Cell("[" if is_front else " ", Tone.STRONG if is_front else Tone.FAINT))
            line.append(Cell(told, Tone.STRONG if is_front else Tone.FAINT))
            before_front = self._gap == 1 and number + 1 == self._place
            side = "]" if is_front else "[" if before_front else " "
            line.append(Cell(side, Tone.FAINT if side == " " else Tone.STRONG))
        self.tell(line)

    def clicked(self, x: int) -> None:
        at = 1
        for title, told in zip(self._titles, self._told, strict=True):
            stop = at + display_width(told) + self._gap
            if at <= x < stop:
                self.app.act("view." + title.lower())  # type: ignore[attr-defined]
                return
            at = stop


_SHORT = {
    "time.freeze": "freeze", "find.filter": "filter", "show.sort": "sort", "view.open": "open",
    "program.command": "command", "program.help": "keys", "view.packets": "packets", "time.previous-finding": "before",
    "time.next-finding": "next", "show.notch": "notch", "show.plot": "plot", "show.hex": "bytes", "view.pane": "pane",
    "find.next": "match", "time.back": "back", "time.forward": "on",
}  # fmt: skip


_PLAYED = ("time.freeze", "replay.step", "replay.step-back", "replay.faster", "time.next-finding")
_SHORT_PLAYED = {"time.freeze": "pause", "replay.step-back": "back", "time.next-finding": "next cause"}


def foot(
    keymap: Keymap, hints: Sequence[str], states: Sequence[str], width: int, *, plays: bool = False
) -> tuple[Line, Line]:  # fmt: skip
    """Return what keys do, the most useful first, and what is in force: a filter, a recording, how time is.

    ``plays``: a capture is played, and how is what people want to know first. Where there is no room for both, what
    keys do gives way: they are told by the help, too.
    """
    state = "   ".join(states)
    if display_width(state) > width - 2:
        state = shorten(state, max(width - 2, 1))
    short = _SHORT | _SHORT_PLAYED if plays else _SHORT
    names = dict.fromkeys((*(_PLAYED if plays else ()), *hints, "program.command", "program.help"))
    told = [
        [Cell(key, Tone.STRONG), Cell(f" {short.get(name, name.partition('.')[2])}   ", Tone.FAINT)]
        for name in names if (key := keymap.key_of(name))
    ]  # fmt: skip
    while told and _width([cell for cells in told for cell in cells]) + 1 > width - display_width(state) - 2:
        # The help is the last one to go.
        del told[-3 if len(told) > 2 else 0]
    return [Cell(" "), *(cell for cells in told for cell in cells)], [Cell(f"{state} ", Tone.FAINT)]
