"""The variables: their values, what changed just now, and a plot or the details of the one under the cursor."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from textual.app import ComposeResult
from textual.timer import Timer

from nvscope import units
from nvscope.list_key import ListKey, Transport
from nvscope.tui.bars import Bar
from nvscope.tui.lines_view import LinesView
from nvscope.tui.look import Look
from nvscope.tui.plot_pane import PlotPane
from nvscope.tui.silent_streams import Silences
from nvscope.tui.table_view import Table, TableView
from nvscope.tui.views.view import View
from nvscope.view.escape import visible
from nvscope.view.lines.table import NOTHING, Cell, Tone
from nvscope.view.lines.undefined import no_values
from nvscope.view.lines.variable_cells import COLUMNS, LEGEND, Notch, cells
from nvscope.view.lines.variable_details import details
from nvscope.view.lines.variable_rows import Order, RowKey, StreamKey, VariableRow, VariableRows

_PATIENCE_S = 0.15
"""A plot waits so long until the cursor stays where it is."""

_PLOT, _DETAILS = "plot", "details"


class VariablesView(View):
    """The variables of all lists that are defined, or of one; below, a plot or the details of one of them."""

    title = "Variables"
    action = "view.variables"
    DEFAULT_CSS = """
    VariablesView #below { height: auto; max-height: 60%; border-top: solid $foreground 20%; display: none; }
    VariablesView PlotPane { height: 50%; border-top: solid $foreground 20%; display: none; }
    VariablesView #undefined { display: none; }
    VariablesView.-plot PlotPane { display: block; }
    VariablesView.-details #below { display: block; }
    VariablesView.-alone TableView { display: none; }
    VariablesView.-alone PlotPane { height: 1fr; }
    VariablesView.-alone #below { height: 1fr; max-height: 100%; }
    VariablesView.-undefined TableView { display: none; }
    VariablesView.-undefined #undefined { display: block; }
    """

    def __init__(self) -> None:
        super().__init__(id="variables")
        self._look: Look | None = None
        self._rows = VariableRows(())
        self._order = Order.DEFINITION
        self._backwards = False
        self._only: str | None = None
        self._notch = Notch()
        self._silences = Silences(None)
        self._names: Mapping[ListKey, str] = {}
        self._below = ""
        self._timer: Timer | None = None

    def compose(self) -> ComposeResult:
        self._heading, self._table = Bar(id="variables-heading"), TableView()
        self._plot, self._details = PlotPane(), LinesView(id="below")
        self._undefined = LinesView(id="undefined")
        yield self._heading
        yield self._table
        yield self._undefined
        yield self._plot
        yield self._details

    def show(self, look: Look) -> None:
        self._look = look
        self._silences = Silences(look)
        self._rows = VariableRows(
            look.scene.variables, self._lists(look), self._order, backwards=self._backwards, before=self._rows
        )
        rows = self._rows
        lists = dict.fromkeys(group.key.list for group in rows.groups)
        if lists.keys() != self._names.keys():
            short = units.short_list_keys(str(key) for key in lists)
            self._names = {key: short[str(key)] for key in lists}
        self.set_class(not len(rows), "-undefined")
        if not len(rows):
            defined = look.scene.inquiry.layouts is not None
            self._undefined.show(no_values(look.report, self._only, defined, max(self.size.width - 1, 18)))
        self._table.show(
            Table(COLUMNS, len(rows), self._cells, lambda number: rows.row(number).key, find=rows.find)
        )  # fmt: skip
        self._tell_heading(len(lists))
        self._tell_below()

    def _lists(self, look: Look) -> Collection[str] | None:
        """Return the keys of the lists that are shown, None for all."""
        choice = look.choice
        chosen = None if choice is None or choice.suspended else choice.lists
        if self._only is None:
            return chosen
        return {self._only} if chosen is None or self._only in chosen else set()

    def _cells(self, number: int) -> Sequence[Cell]:
        look, row = self._look, self._rows.row(number)
        assert look is not None
        key, known = row.group.key, row.known
        return cells(
            row, look.now_ns, list_name=self._called(row), sender=self._sender(key),
            silent_ns=None if row.group.earlier else self._silences.silent_ns(key, known.last_ns),
            notched=row.key in self._notch,
            until=units.clock_time(known.last_ns, utc=look.utc, digits=0) if row.group.earlier else "",
        )  # fmt: skip

    def _called(self, row: VariableRow) -> str:
        """Return what a list is called: its identifier, and its name."""
        return f"{visible(self._names[row.group.key.list])} {visible(row.known.layout.list.name)}".strip()

    def _sender(self, key: StreamKey) -> str:
        if key.list.transport is Transport.CAN or self._look is None:
            return NOTHING  # nobody knows who sends on a bus
        scene = self._look.scene
        names = scene.inquiry.project.node_names if scene.node_names is None else scene.node_names
        return visible(names.get(key.sender) or key.sender)

    def _tell_heading(self, lists: int) -> None:
        rows = self._rows
        parts = [Cell(f" {units.count_of(len(rows), 'variable')}")]
        if self._only is not None:
            name = self._called(rows.row(0)) if len(rows) else visible(units.list_key(self._only))
            parts = [Cell(f" only {name}", Tone.STRONG), Cell(f" {units.count_of(len(rows), 'variable')}")]
        elif lists > 1:
            parts.append(Cell(f" of {units.count_of(lists, 'list')}"))
        if self._notch.count:
            parts.append(Cell(f"   # {units.count(self._notch.count)} notched", Tone.WARNING))
        if self._order or self._backwards:
            told = f"by {self._order or 'definition'}" + (", backwards" if self._backwards else "")
            parts.append(Cell(f"   {told}", Tone.FAINT))
        if any(group.key.list.transport is Transport.CAN for group in rows.groups):
            parts.append(Cell("   CAN lists: packed as assumed", Tone.FAINT))
        self._heading.tell(parts, [Cell(f"{LEGEND} ", Tone.FAINT)] if len(rows) else ())

    # What is below the table.

    def _tell_below(self) -> None:
        row, look = self.row, self._look
        for name in (_PLOT, _DETAILS):
            self.set_class(row is not None and self._below == name, f"-{name}")
        if row is None or look is None:
            return
        if self._below == _PLOT:
            self._plot.follow(row, look, self._silences.nominal_ns(row.group.key))
        elif self._below == _DETAILS:
            told = details(
                row, self._sender(row.group.key), self._silences.nominal_ns(row.group.key), look.clock.moment,
                max(self.size.width - 1, 18),
            )  # fmt: skip
            self._details.show(told)

    @property
    def row(self) -> VariableRow | None:
        """The variable under the cursor."""
        return self._rows.row(self._table.row) if 0 <= self._table.row < len(self._rows) else None

    def on_table_view_moved(self) -> None:
        if self._timer is not None:
            self._timer.stop()
        if self._below == _PLOT:
            self._timer = self.set_timer(_PATIENCE_S, self._tell_below)
        else:
            self._tell_below()

    def on_table_view_opened(self) -> None:
        self.act("view.open")

    def act(self, action: str, told: str = "") -> bool:
        if self._below == _PLOT and self._plot.move(action):
            return True
        if self._below and self.has_class("-alone") and self._below == _DETAILS and self._details.move(action):
            return True
        if (self._table if len(self._rows) else self._undefined).move(action):
            return True
        done = getattr(self, f"_do_{action.replace('.', '_').replace('-', '_')}", None)
        if done is None or done(told) is False:
            return False
        if self._look is not None:
            self.show(self._look)
        return True

    def _do_show_sort(self, told: str) -> None:
        orders = list(Order)
        names = [str(order) for order in orders if order] + ["definition"]
        if told and told not in names:
            self.app.notify(f"Sort by one of: {', '.join(names)}", severity="warning")
            return
        following = orders[(orders.index(self._order) + 1) % len(orders)]
        self._order = Order("" if told == "definition" else told) if told else following
        self._backwards = False

    def _do_show_reverse(self, _: str) -> None:
        self._backwards = not self._backwards

    def _do_show_notch(self, _: str) -> None:
        if self._notch.count:
            self._notch.clear()
        elif self._look is not None:
            # Of all lists, those that are not shown now too.
            self._notch.cut(VariableRows(self._look.scene.variables).groups, self._look.now_ns)
            if not self._notch.count:
                self.app.notify("Nothing has changed within the last 3 s", timeout=2)

    def _do_show_plot(self, _: str) -> bool | None:
        if self.row is None:
            return False
        self._open("" if self._below == _PLOT else _PLOT)
        return None

    def _do_view_open(self, _: str) -> bool | None:
        if self.row is None:
            return False
        if self._below == _DETAILS:
            return self._do_view_packets("")
        self._open(_DETAILS)
        return None

    def _do_view_packets(self, told: str) -> bool | None:
        row = self.row
        if told or row is None:
            return False
        self.post_message(self.Asked("view.packets", f"#{row.known.last_frame}"))
        return None

    def _do_view_maximise(self, _: str) -> bool | None:
        if not self._below:
            return False
        self.toggle_class("-alone")
        return None

    def _do_program_back(self, _: str) -> bool | None:
        if self._below == _PLOT and self._plot.leave_cursor():
            return None
        if self._below:
            self._open("")
        elif self._only is not None:
            self._only = None
        else:
            return False
        return None

    def _open(self, below: str) -> None:
        self._below = below
        if not below:
            self.remove_class("-alone")
            self._plot.end()

    def restrict(self, key: str | None) -> None:
        self._only = key
        if self._look is not None:
            self.show(self._look)

    def hints(self) -> Sequence[str]:
        if self._below == _PLOT:
            return ("move.left", "move.right", "show.plot", "view.maximise", "program.back")
        return ("show.notch", "show.plot", "view.open", "show.sort", "find.filter")

    def copied(self) -> str:
        row = self.row
        return "" if row is None else f"{visible(row.element.name)} = {visible(row.text)}"

    def place(self) -> Any:
        return self._table.key

    def go_to(self, place: Any) -> bool:
        found = self._rows.find(place) if isinstance(place, RowKey) else None
        if found is None and self._only is not None:
            self.restrict(None)
            found = self._rows.find(place)
        if found is not None:
            self._table.go_to(found)
        return found is not None

    def on_resize(self) -> None:
        if self._look is not None:
            self.show(self._look)
