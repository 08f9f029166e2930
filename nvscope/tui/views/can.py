"""CAN: how busy each bus is, which identifiers take it, its errors, and its CANopen nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from textual.app import ComposeResult

from nvscope.list_key import Transport
from nvscope.tracker.can.bus import CanBusSummary
from nvscope.tui.lines_view import LinesView
from nvscope.tui.look import Look
from nvscope.tui.table_view import Table, TableView
from nvscope.tui.views.view import View
from nvscope.view.lines.plant import bus_load
from nvscope.view.lines.table import Cell, Line, wrap

_NARROWEST = 20
_TALL, _TALL_BARS = 34, 3
_NO_TABLE = Table((), 0, lambda _: (), lambda row: row)


class CanView(View):
    """The buses, one of which is looked at more closely: the next one with the next pane."""

    title = "CAN"
    action = "view.can"
    DEFAULT_CSS = """
    CanView #can-head { height: auto; max-height: 50%; }
    CanView #can-below { height: auto; max-height: 40%; border-top: solid $foreground 20%; }
    """

    def __init__(self) -> None:
        super().__init__(id="can")
        self._look: Look | None = None
        self._channel: str | None = None
        self._sort, self._reversed = "share", False
        self._alone = False
        self._shown: Sequence[bus_load.Identifier] = ()

    def compose(self) -> ComposeResult:
        self._head, self._table, self._below = LinesView(id="can-head"), TableView(), LinesView(id="can-below")
        yield self._head
        yield self._table
        yield self._below

    def show(self, look: Look) -> None:
        self._look = look
        width = max(self.size.width - 1, _NARROWEST)
        known, rows = look.scene.snapshot.summary.can.buses, look.report.get("buses", ())
        self._table.display = bool(known)
        if not known:
            self._shown = ()
            self._table.show(_NO_TABLE)
            told = bus_load.NOTHING_YET if look.scene.at_ns is None else bus_load.NO_CAN
            self._head.show(wrap([Cell(told)], width))
            self._below.display = False
            return
        place = self._place(known)
        bus, row = known[place], rows[place]
        self._head.display = not self._alone
        self._head.show(self._headlines(look, known, rows, place, width))
        self._show_identifiers(look, bus, row)
        below = bus_load.below(row, look.clock, width)
        self._below.display = bool(below) and not self._alone
        self._below.show(below)

    def _headlines(
        self, look: Look, known: Sequence[CanBusSummary], rows: Sequence[Mapping[str, Any]], place: int, width: int
    ) -> list[Line]:  # fmt: skip
        scene, plain = look.scene, self.app.console.options.ascii_only
        bus = known[place]
        numbers = [one.number for one in scene.snapshot.summary.can.lists if one.key.port == bus.channel]
        strip = bus_load.strip_of(bus, scene.pace, numbers, look.now_ns, width)
        limit = scene.inquiry.project.limits.bus_load_percent
        height = _TALL_BARS if self.size.height >= _TALL else 1
        lines = bus_load.headlines(rows, known, look.now_ns, look.clock, place, width)
        lines += [[], *bus_load.strip_lines(strip, limit, height, plain=plain), []]
        return lines

    def _show_identifiers(self, look: Look, bus: CanBusSummary, row: Mapping[str, Any]) -> None:
        shown = bus_load.identifiers(look.scene.snapshot.summary.can, bus)
        choice = look.choice
        if choice is not None and not choice.suspended and choice.lists is not None:
            chosen = {
                (stream.cob_id, stream.extended)
                for entry in look.scene.snapshot.summary.can.lists
                if entry.key.port == bus.channel and str(entry.key) in choice.lists for stream in entry.streams
            }  # fmt: skip
            shown = [one for one in shown if (one.cob_id, one.extended) in chosen]
        # Numbers begin with the largest: that is what somebody looks for.
        backwards = (self._sort != "identifier") is not self._reversed
        shown.sort(key=bus_load.SORTS[self._sort], reverse=backwards)
        self._shown = shown
        told = row["identifiers"]
        self._table.show(
            Table(
                bus_load.IDENTIFIER_COLUMNS, len(shown),
                lambda at: bus_load.identifier_cells(shown[at], told[shown[at].place], look.now_ns),
                lambda at: (shown[at].cob_id, shown[at].extended),
            )
        )  # fmt: skip

    def _place(self, known: Sequence[CanBusSummary]) -> int:
        return next((place for place, bus in enumerate(known) if bus.channel == self._channel), 0)

    def on_resize(self) -> None:
        self._again()

    def on_table_view_opened(self) -> None:
        self.act("view.open")

    def _again(self) -> None:
        if self._look is not None:
            self.show(self._look)

    def act(self, action: str, told: str = "") -> bool:
        if self._table.move(action):
            return True
        known = self._look.scene.snapshot.summary.can.buses if self._look is not None else ()
        if action == "view.pane":
            if known:
                self._channel = known[(self._place(known) + 1) % len(known)].channel
        elif action == "show.sort":
            names = list(bus_load.SORTS)
            if told and told not in names:
                self.app.notify(f"Sort by one of: {', '.join(names)}", severity="warning")
                return True
            self._sort = told or names[(names.index(self._sort) + 1) % len(names)]
            self._reversed = False
            self.app.notify(f"Sorted by {self._sort}", timeout=2)
        elif action == "show.reverse":
            self._reversed = not self._reversed
        elif action == "view.maximise":
            self._alone = not self._alone
        elif action == "view.open":
            if (key := self._list_key()) is not None:
                self.post_message(self.Asked("view.variables", key))
        else:
            return False
        self._again()
        return True

    def _list_key(self) -> str | None:
        """Return the key of the list that the identifier under the cursor is of."""
        look, key = self._look, self._table.key
        if look is None or not isinstance(key, tuple):
            return None
        summary = look.scene.snapshot.summary.can
        channel = summary.buses[self._place(summary.buses)].channel
        return next(
            (str(entry.key) for entry in summary.lists if entry.key.port == channel
             for stream in entry.streams if (stream.cob_id, stream.extended) == key), None,
        )  # fmt: skip

    def hints(self) -> Sequence[str]:
        return ("view.pane", "show.sort", "view.open", "view.maximise")

    def copied(self) -> str:
        return self._table.text()

    def place(self) -> Any:
        return None if self._table.key is None else (self._channel, self._table.key)

    def go_to(self, place: Any) -> bool:
        channel, key = place
        self._channel = channel
        self._again()
        found = next((at for at, one in enumerate(self._shown) if (one.cob_id, one.extended) == key), None)
        if found is not None:
            self._table.go_to(found)
        return found is not None

    def restrict(self, key: str | None) -> None:
        """Put the cursor on the first identifier of a list."""
        look = self._look
        if look is None or key is None or not key.startswith(Transport.CAN):
            return
        for entry in look.scene.snapshot.summary.can.lists:
            if str(entry.key) == key and entry.streams:
                self.go_to((str(entry.key.port), (entry.streams[0].cob_id, entry.streams[0].extended)))
