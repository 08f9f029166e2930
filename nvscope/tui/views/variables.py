"""The variables: their values, what changed just now, and a plot or the details of the one under the cursor."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from textual.app import ComposeResult
from textual.timer import Timer

from nvscope import units
from nvscope.enumeration import joined
from nvscope.list_key import Transport
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
from nvscope.view.lines.variable_cells import COLUMNS, LEGEND, Notch, age, cells, without_senders
from nvscope.view.lines.variable_details import details
from nvscope.view.lines.variable_rows import Order, RowKey, StreamGroup, VariableRow, VariableRows

if TYPE_CHECKING:
    from nvscope.view.lines.variable_rows import AnyRow

_PATIENCE_S = 0.15
"""A plot waits so long until the cursor stays where it is."""

_UNREAD_NS = 10_000_000_000
"""From then on, a page seems not to ask for a value any more: pages ask every few seconds."""

_PLOT, _DETAILS = "plot", "details"


class VariablesView(View):
    """The variables of all lists that are defined, of pages and of databases, or of one of these.

    Below is a plot or the details of one of them.
    """

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
        self._names: Mapping[str, str] = {}
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
            look.scene.variables, self._lists(look), self._order, backwards=self._backwards, before=self._rows,
            read_ones=look.scene.read_ones,
        )  # fmt: skip
        rows = self._rows
        lists = dict.fromkeys(group.listed for group in rows.groups if isinstance(group, StreamGroup))
        if lists.keys() != self._names.keys():
            self._names = units.short_list_keys(lists)
        self.set_class(not len(rows), "-undefined")
        if not len(rows):
            defined = look.scene.inquiry.layouts is not None
            self._undefined.show(no_values(look.report, self._only, defined, max(self.size.width - 1, 18)))
        self._table.show(
            Table(
                COLUMNS if self._has_senders else without_senders(COLUMNS), len(rows), self._cells,
                lambda number: rows.row(number).key, find=rows.find,
            )
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
        found = cells(
            row, look.now_ns, list_name=self._called(row), sender=self._sender(row), notched=row.key in self._notch,
            grown_old=self._grown_old(row, look),
        )  # fmt: skip
        return found if self._has_senders else without_senders(found)

    @property
    def _has_senders(self) -> bool:
        """Whether anybody sent a value; it is not known as long as there is none."""
        groups = self._rows.groups
        return not groups or any(isinstance(group, StreamGroup) or group.has_sender for group in groups)

    def _grown_old(self, row: AnyRow, look: Look) -> str:
        """Return why nobody knows whether a value is still the same, "" where somebody does."""
        if not isinstance(row, VariableRow):
            passed_ns = look.now_ns - row.last_ns
            return f"read {age(passed_ns)} ago" if not row.variable.lasts and passed_ns >= _UNREAD_NS else ""
        if row.group.earlier:
            return f"until {units.clock_time(row.last_ns, utc=look.utc, digits=0)}: other shape"
        silent_ns = self._silences.silent_ns(row.group.key, row.last_ns)
        return "" if silent_ns is None else f"silent {age(silent_ns)}"

    def _called(self, row: AnyRow) -> str:
        """Return what a list is called: its identifier, and its name."""
        if not isinstance(row, VariableRow):
            return visible(row.group.listed)
        return f"{visible(self._names[row.group.listed])} {visible(row.known.layout.list.name)}".strip()

    def _sender(self, row: AnyRow) -> str:
        if isinstance(row, VariableRow):
            sender = "" if row.group.key.list.transport is Transport.CAN else row.group.key.sender
        else:
            sender = row.sender
        if not sender or self._look is None:
            return NOTHING  # nobody knows who sends on a bus, and nobody sent what is in a database
        scene = self._look.scene
        names = scene.inquiry.project.node_names if scene.node_names is None else scene.node_names
        return visible(names.get(sender) or sender)

    def _nominal_ns(self, row: AnyRow) -> int | None:
        return self._silences.nominal_ns(row.group.key) if isinstance(row, VariableRow) else None

    def _tell_heading(self, lists: int) -> None:
        rows = self._rows
        parts = [Cell(f" {units.count_of(len(rows), 'variable')}")]
        if self._only is not None:
            name = self._called(rows.row(0)) if len(rows) else visible(units.list_key(self._only))
            parts = [Cell(f" only {name}", Tone.STRONG), Cell(f" {units.count_of(len(rows), 'variable')}")]
        elif len(rows.groups) > 1:
            parts.append(Cell(f" of {self._holders(lists)}"))
        if never := sum(group.never for group in rows.groups if not isinstance(group, StreamGroup)):
            parts.append(Cell(f"   {units.count(never)} never readable", Tone.FAINT))
        for seen in () if self._look is None else self._look.scene.read_ones.values():
            if seen.left_out:
                told = f"   of {seen.title}, those beyond the first {units.count(len(seen.variables))} are left out"
                parts.append(Cell(told, Tone.WARNING))
        if self._notch.count:
            parts.append(Cell(f"   # {units.count(self._notch.count)} notched", Tone.WARNING))
        if self._order or self._backwards:
            told = f"by {self._order or 'definition'}" + (", backwards" if self._backwards else "")
            parts.append(Cell(f"   {told}", Tone.FAINT))
        if any(isinstance(one, StreamGroup) and one.key.list.transport is Transport.CAN for one in rows.groups):
            parts.append(Cell("   CAN lists: packed as assumed", Tone.FAINT))
        self._heading.tell(parts, [Cell(f"{LEGEND} ", Tone.FAINT)] if len(rows) else ())

    def _holders(self, lists: int) -> str:
        """Return of how many lists, controllers and databases there are variables."""
        counts = {"list": lists} if lists else {}
        for group in self._rows.groups:
            if not isinstance(group, StreamGroup):
                counts[group.seen.holder] = counts.get(group.seen.holder, 0) + 1
        return joined([units.count_of(count, holder) for holder, count in counts.items()])

    # What is below the table.

    def _tell_below(self) -> None:
        row, look = self.row, self._look
        for name in (_PLOT, _DETAILS):
            self.set_class(row is not None and self._below == name, f"-{name}")
        if row is None or look is None:
            return
        if self._below == _PLOT:
            self._plot.follow(row, look, self._nominal_ns(row))
        elif self._below == _DETAILS:
            told = details(
                row, self._sender(row), self._nominal_ns(row), look.clock.moment, max(self.size.width - 1, 18),
            )  # fmt: skip
            self._details.show(told)

    @property
    def row(self) -> AnyRow | None:
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
            scene = self._look.scene
            self._notch.cut(VariableRows(scene.variables, read_ones=scene.read_ones).groups, self._look.now_ns)
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
        self.post_message(self.Asked("view.packets", f"#{row.last_frame}"))
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
        return "" if row is None else f"{visible(row.name)} = {visible(row.text)}"

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
