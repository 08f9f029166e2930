"""The transactions: who asks whom, how often, how long replies take; below, what one pair has said of late."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from textual.app import ComposeResult

from nvscope.analysis.transactions.recent_transactions import MOST_PAIRS
from nvscope.analysis.transactions.rows import pair_of, pair_rows, transaction_rows
from nvscope.analysis.transactions.transaction import Pair
from nvscope.tui.bars import Bar
from nvscope.tui.lines_view import LinesView
from nvscope.tui.look import Look
from nvscope.tui.table_view import Table, TableView
from nvscope.tui.views.view import View
from nvscope.view.escape import visible_document
from nvscope.view.lines.plant import transactions as lines
from nvscope.view.lines.table import Cell, Tone, wrap
from nvscope.view.lines.text_width import display_width

_NARROWEST = 20
_PAIRS, _SAID = "pairs", "said"
Row = Mapping[str, Any]
_NO_TABLE = Table((), 0, lambda _: (), lambda row: row)


class TransactionsView(View):
    """The pairs, those first of whose requests something became that should not; below, the transactions of one."""

    title = "Transactions"
    action = "view.transactions"
    DEFAULT_CSS = """
    TransactionsView #transactions-said { height: auto; max-height: 6; border-top: solid $foreground 20%; }
    TransactionsView #transactions-nothing { height: 1fr; }
    TransactionsView #transactions-pairs { height: 1fr; }
    TransactionsView #transactions-title { border-top: solid $foreground 20%; height: 2; }
    TransactionsView #transactions-last { height: 2fr; }
    """

    def __init__(self) -> None:
        super().__init__(id="transactions")
        self._look: Look | None = None
        self._rows: Sequence[Row] = ()
        self._said: Sequence[Row] = ()
        self._sort, self._reversed = "", False
        self._pane, self._opened, self._alone = _PAIRS, False, False

    def compose(self) -> ComposeResult:
        self._nothing = LinesView(id="transactions-nothing")
        self._pairs, self._title = TableView(id="transactions-pairs"), Bar(id="transactions-title")
        self._last, self._whole = TableView(id="transactions-last"), LinesView(id="transactions-said")
        yield self._nothing
        yield self._pairs
        yield self._title
        yield self._last
        yield self._whole

    def show(self, look: Look) -> None:
        self._look = look
        scene = look.scene
        rows: list[Row] = visible_document(pair_rows(scene.document, scene.transactions))
        self._rows = self._ordered(rows)
        self._nothing.display, self._pairs.display = not rows, bool(rows)
        if not rows:
            told = lines.NOTHING_YET if look.scene.at_ns is None else lines.NO_TRANSACTIONS
            self._nothing.show(lines.nothing_lines(told, max(self.size.width - 1, _NARROWEST)))
            self._opened = False
        measures = lines.pair_measures(look.now_ns, rows)
        self._pairs.show(
            Table(
                [measure.column for measure in measures], len(rows),
                lambda at: [measure.cell(self._rows[at]) for measure in measures],
                lambda at: pair_of(self._rows[at]),
            )
        )  # fmt: skip
        self._show_last()

    def _ordered(self, rows: Sequence[Row]) -> Sequence[Row]:
        """Return rows in their order: worst first, or as somebody wants them."""
        value, backwards = _SORTS[self._sort]
        return sorted(rows, key=value, reverse=backwards is not self._reversed)

    def _show_last(self) -> None:
        """Show the transactions of the pair under the cursor, where it is open."""
        look, pair = self._look, self._pairs.key
        is_open = self._opened and look is not None and isinstance(pair, Pair)
        for widget in (self._title, self._last, self._whole):
            widget.display = is_open and not (self._alone and self._pane == _PAIRS)
        if self._rows:
            self._pairs.display = not (is_open and self._alone and self._pane == _SAID)
        if not is_open:
            self._said = ()
            self._last.show(_NO_TABLE)
            return
        assert look is not None
        assert isinstance(pair, Pair)
        seen = look.scene.transactions
        # The newest one first: that is what somebody looks for.
        self._said = visible_document(transaction_rows(seen, pair)[::-1])
        row = self._rows[self._pairs.row]
        mark = "▸ " if self._pane == _SAID else "  "
        name = f"{mark}{lines.ends(row)}  "
        room = max(self.size.width, _NARROWEST) - display_width(name)
        told = [Cell(name, Tone.STRONG), Cell(lines.told_of(row, room), Tone.FAINT)]
        if row["writes"] is None:
            told = [Cell(f"Of more than {MOST_PAIRS} pairs only figures are kept, this is one of the further ones")]
        self._title.tell(told)
        measures = lines.transaction_measures(look.clock)
        self._last.show(
            Table(
                [measure.column for measure in measures], len(self._said),
                lambda at: [measure.cell(self._said[at]) for measure in measures],
                lambda at: tuple(self._said[at][name] for name in ("frame", "request_frame", "outcome")),
            )
        )  # fmt: skip
        self._show_whole()

    def _show_whole(self) -> None:
        """Show all that is kept of the transaction under the cursor."""
        one = self._transaction()
        width = max(self.size.width - 1, _NARROWEST)
        self._whole.show([] if one is None else wrap([Cell(lines.what(one))], width))

    def _transaction(self) -> Row | None:
        return self._said[self._last.row] if 0 <= self._last.row < len(self._said) else None

    def on_table_view_moved(self) -> None:
        # Of either table: the one below follows the one above.
        self._show_last()

    def on_table_view_opened(self) -> None:
        self.act("view.open")

    def on_resize(self) -> None:
        self._again()

    def _again(self) -> None:
        if self._look is not None:
            self.show(self._look)

    def act(self, action: str, told: str = "") -> bool:
        table = self._last if self._pane == _SAID else self._pairs
        if table.move(action):
            return True
        if action == "view.open":
            self._open()
        elif action == "view.pane":
            self._pane = _SAID if self._opened and self._pane == _PAIRS else _PAIRS
        elif action == "view.maximise":
            self._alone = not self._alone
        elif action == "program.back" and self._opened:
            self._opened, self._alone, self._pane = False, False, _PAIRS
        elif action == "show.sort":
            return self._sort_by(told)
        elif action == "show.reverse":
            self._reversed = not self._reversed
        else:
            return False
        self._again()
        return True

    def _open(self) -> None:
        """Go from a pair to its transactions, and from one of these to its packets."""
        one = self._transaction()
        if self._pane == _SAID:
            if one is not None:
                self.post_message(self.Asked("view.packets", f"#{one['frame']}"))
        elif self._rows:
            self._opened, self._pane = True, _SAID
            self._last.row = -1

    def _sort_by(self, told: str) -> bool:
        names = list(_SORTS)
        if told and told not in names:
            self.app.notify(f"Sort by one of: {', '.join(filter(None, names))}", severity="warning")
            return True
        self._sort, self._reversed = told or names[(names.index(self._sort) + 1) % len(names)], False
        self.app.notify(f"Sorted by {self._sort or 'what went wrong'}", timeout=2)
        self._again()
        return True

    def hints(self) -> Sequence[str]:
        if self._pane == _SAID:
            return ("view.open", "view.pane", "program.back", "view.maximise")
        return ("view.open", "show.sort", "time.freeze", "view.maximise")

    def copied(self) -> str:
        one = self._transaction()
        return lines.what(one) if self._pane == _SAID and one is not None else self._pairs.text()

    def place(self) -> Any:
        return self._pairs.key

    def go_to(self, place: Any) -> bool:
        found = next((at for at, row in enumerate(self._rows) if pair_of(row) == place), None)
        if found is not None:
            self._pane = _PAIRS
            self._pairs.go_to(found)
        return found is not None


def _address(row: Row) -> Any:
    return row["client"], row["server"], row["port"], row["protocol"]


def _badness(row: Row) -> int:
    return -(lines.severity_of_pair(row) or 0)


def _number(name: str) -> Callable[[Row], float]:
    return lambda row: -1.0 if row[name] is None else row[name]


def _took(row: Row) -> float:
    return row["latency_ns"]["p99"] or -1


def _last(row: Row) -> int:
    return int(row["last_write"]["time_ns"]) if row["last_write"] else -1


_SORTS: Mapping[str, tuple[Callable[[Row], Any], bool]] = {
    "": (_badness, False),  # what is as bad stays in the order of addresses
    "address": (_address, False),
    "rate": (_number("per_s"), True),
    "requests": (_number("requests"), True),
    "took": (_took, True),
    "unanswered": (_number("unanswered"), True),
    "refused": (_number("refused"), True),
    "writes": (_number("writes"), True),
    "last": (_last, True),
}
"""By what to sort, and whether that begins with the largest: that is what somebody looks for."""
