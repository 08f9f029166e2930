"""The plot of one variable over what the ring holds, read in a thread beside the screen."""

from __future__ import annotations

import time
from collections.abc import Hashable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from textual.app import ComposeResult
from textual.containers import Vertical
from textual.message import Message
from textual.worker import get_current_worker

from nvscope import units
from nvscope.analysis.traced_telegrams import SILENT_PERCENT, TracedElement
from nvscope.analysis.tracing import Trace, Traced, Tracing
from nvscope.analysis.watching import Scene
from nvscope.tui.drawn_view import DrawnView
from nvscope.tui.look import Look
from nvscope.view.escape import visible
from nvscope.view.lines.plot import Axes, Curve, plot
from nvscope.view.lines.table import Cell, Line, Tone, wrap
from nvscope.view.lines.value_axes import axes_of
from nvscope.view.lines.variable_cells import age, cut
from nvscope.view.lines.variable_rows import RowKey, VariableRow

if TYPE_CHECKING:
    from nvscope.view.lines.variable_rows import AnyRow

_SHOWN_S = 0.2
"""What was read is shown so often while more is read."""

_MANY_FRAMES = 20_000
"""To read so many takes a moment: it is said how far that is."""


class PlotPane(Vertical):
    """A plot, and a cursor in it that reads the value at a time."""

    class Read(Message):
        """More of a variable was read; ``done``: all that there was."""

        def __init__(self, tracing: Tracing, trace: Trace, *, done: bool) -> None:
            super().__init__()
            self.tracing, self.trace, self.done = tracing, trace, done

    def __init__(self) -> None:
        super().__init__(id="variables-plot")
        self._row: AnyRow | None = None
        self._look: Look | None = None
        self._nominal_ns: int | None = None
        self._of: tuple[RowKey, Hashable] | None = None
        self._tracing: Tracing | None = None
        self._trace: Trace | None = None
        self._reading = False
        self._cursor_ns: int | None = None
        self._cells = 1

    def compose(self) -> ComposeResult:
        self._drawn = DrawnView()
        yield self._drawn

    def follow(self, row: AnyRow, look: Look, nominal_ns: int | None) -> None:
        """Show a variable at a moment; what is not read yet is read meanwhile."""
        of = row.key, _version_of(row)
        self._row, self._look, self._nominal_ns = row, look, nominal_ns
        if of != self._of:
            self.end()
            self._of, self._row, self._look = of, row, look
            traced = traced_of(row)
            if traced.has_numbers:
                self._tracing = Tracing(traced)
        self._read_on()
        self._drawn.show(self._lines)

    def end(self) -> None:
        """Read nothing any more."""
        self.workers.cancel_group(self, "trace")
        self._of = self._tracing = self._trace = self._cursor_ns = self._row = self._look = None
        self._reading = False

    def _read_on(self) -> None:
        look, tracing, trace = self._look, self._tracing, self._trace
        if tracing is None or look is None or self._reading:
            return
        recent = look.scene.recent
        if trace is not None and (trace.stop_frame, trace.start_ns) == (recent.stop_frame, recent.first_ns):
            return
        self._reading = True
        self.run_worker(
            partial(self._read, tracing, look.scene, self._nominal_ns), thread=True, exclusive=True, group="trace"
        )  # fmt: skip

    def _read(self, tracing: Tracing, scene: Scene, nominal_ns: int | None) -> None:
        worker, told_s, trace = get_current_worker(), time.monotonic(), None
        for trace in tracing.read(scene, nominal_ns):
            if worker.is_cancelled:
                return
            if time.monotonic() - told_s > _SHOWN_S:
                told_s = time.monotonic()
                self.post_message(self.Read(tracing, trace, done=False))
        if trace is not None:
            self.post_message(self.Read(tracing, trace, done=True))

    def on_plot_pane_read(self, message: Read) -> None:
        message.stop()
        if message.tracing is not self._tracing:
            return
        self._trace = message.trace
        if message.done:
            self._reading = False
            self._read_on()
        self._drawn.show(self._lines)

    # What is drawn.

    def _axes(self, trace: Trace, look: Look) -> Axes:
        assert self._tracing is not None
        start_ns = look.now_ns if trace.start_ns is None else trace.start_ns
        traced = self._tracing.traced
        return axes_of(
            traced.type_of(trace.value), trace.value, start_ns, max(look.now_ns, start_ns + 1), utc=look.utc,
            holds=traced.holds,
        )  # fmt: skip

    def _lines(self, width: int, height: int) -> Sequence[Line]:
        row, look, trace = self._row, self._look, self._trace
        if row is None or look is None:
            return ()
        name = Cell(f" {visible(row.name)}  ", Tone.STRONG)
        if self._tracing is None:
            told = f"{row.type_text}: only numbers, times and BOOL have a plot."
            if row.is_hidden:
                told = "It is, or may be, a password: it has no plot."
            return wrap([name, Cell(visible(told), Tone.FAINT)], width, 0, 1)
        if trace is None:
            return [[name, Cell("reading …", Tone.FAINT)]]
        axes = self._axes(trace, look)
        curve = Curve(trace.time_ns, trace.value.astype(float), trace.run)
        plotted = plot(curve, axes, width, max(height - 1, 1), self._cursor_ns)
        self._cells = plotted.cells
        return [[name, *self._reading_at(trace, axes, look), *self._told(trace, look)], *plotted.lines]

    def _reading_at(self, trace: Trace, axes: Axes, look: Look) -> list[Cell]:
        """Return the value at the cursor and its time; without a cursor the last one."""
        assert self._tracing is not None
        cell_ns = axes.length_ns // self._cells
        at = trace.at(look.now_ns if self._cursor_ns is None else self._cursor_ns + cell_ns // 2)
        if at is None:
            return [Cell("no value", Tone.FAINT)]
        ends = at + 1 < len(trace.run) and trace.run[at + 1] != trace.run[at]
        time_ns = int(trace.time_ns[at])
        if self._cursor_ns is not None and ends and time_ns < self._cursor_ns - cell_ns // 2:
            clock = units.clock_time(self._cursor_ns, utc=look.utc)
            return [Cell("nothing came, or it was lost", Tone.WARNING), Cell(f"  at {clock}")]
        text = cut(visible(self._tracing.traced.text(trace.value[at])))
        when = f"  at {units.clock_time(time_ns, utc=look.utc)}, frame {units.count(int(trace.frame[at]))}"
        return [Cell(text, Tone.STRONG), Cell(when, Tone.PLAIN if self._cursor_ns is not None else Tone.FAINT)]

    def _told(self, trace: Trace, look: Look) -> list[Cell]:
        """Return what else is to be said of what is drawn."""
        told = []
        recent = look.scene.recent
        if self._cursor_ns is None and self._nominal_ns and len(trace.time_ns):
            passed_ns = look.now_ns - int(trace.time_ns[-1])
            if trace.stop_frame == recent.stop_frame and passed_ns * 100 > self._nominal_ns * SILENT_PERCENT:
                told.append(Cell(f"   silent {age(passed_ns)}", Tone.WARNING))
        if recent.stop_frame - trace.stop_frame > _MANY_FRAMES:
            read = max(trace.stop_frame - recent.first_frame, 0)
            told.append(Cell(f"   {units.percent(read, len(recent))} read …", Tone.FAINT))
        elif trace.thinned:
            told.append(Cell("   thinned: extremes stay", Tone.FAINT))
        return told

    # What keys do.

    def move(self, action: str) -> bool:
        """Move the cursor to the left or right; False where an action is none of that."""
        trace, look = self._trace, self._look
        if action not in ("move.left", "move.right"):
            return False
        if trace is None or look is None or self._tracing is None:
            return True
        axes = self._axes(trace, look)
        step_ns = max(axes.length_ns // self._cells, 1)
        if self._cursor_ns is None:
            self._cursor_ns = axes.end_ns - step_ns // 2
        else:
            self._cursor_ns += step_ns if action == "move.right" else -step_ns
        self._cursor_ns = min(max(self._cursor_ns, axes.start_ns + step_ns // 2), axes.end_ns - step_ns // 2)
        self._drawn.show(self._lines)
        return True

    def leave_cursor(self) -> bool:
        """Take the cursor away; False where there is none."""
        there = self._cursor_ns is not None
        self._cursor_ns = None
        self._drawn.show(self._lines)
        return there


def traced_of(row: AnyRow) -> Traced:
    """Return a variable as what is traced."""
    if isinstance(row, VariableRow):
        key = row.group.key
        return TracedElement(key.list, key.subindex, key.sender, row.known.layout, row.place)
    from nvscope.analysis.traced_readings import TracedReadings  # noqa: PLC0415  not of captures without any

    return TracedReadings(row.group.key.source, row.variable, row.has_numbers, row.hidden_frame)


def _version_of(row: AnyRow) -> Hashable:
    """Return what a variable is read anew for."""
    return id(row.known.layout) if isinstance(row, VariableRow) else (row.hidden_frame, row.has_numbers)
