"""The lists: who sends what, a strip of the last minutes, how often, what is lost; below, what happened."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from textual.app import ComposeResult

from nvscope import units
from nvscope.capture.source import any_live
from nvscope.findings.kind import Severity
from nvscope.tracker.summary import ListSummary
from nvscope.tui.lines_view import LinesView
from nvscope.tui.look import Look
from nvscope.tui.table_view import Table, TableView
from nvscope.tui.views.view import View
from nvscope.view.lines.plant import causes, content
from nvscope.view.lines.plant.happenings import headline, severity_of, symbol
from nvscope.view.lines.plant.strips import MARKS, scale
from nvscope.view.lines.plant.tables import OVERVIEW, looked_at
from nvscope.view.lines.table import NOTHING, Cell, Column, Line, Tone, wrap

_BARS = " ▁▂▃▄▅▆▇█"
_SPARK_SECONDS = 20
_S_NS = 1_000_000_000
_STRIP_AT = 3
_OF = {measure.column.title: measure.cell for measure in OVERVIEW}

COLUMNS: Sequence[Column] = (
    Column(""),
    Column("list", shortest=8, identifier=True),
    Column("sender", shortest=9, importance=5, identifier=True),
    Column("rate", right=True, importance=7),
    Column("20 s", importance=1, verbatim=True),
    Column("interval", right=True, importance=6),
    Column("jitter", right=True, importance=3),
    Column("lost", right=True, importance=8),
    Column("age", right=True, importance=9),
    Column("", shortest=8, importance=2),
)
_NO_NUMBER = -1.0
_NARROWEST = 18


class ListsView(View):
    """The lists, those that causes concern first unless they are sorted otherwise."""

    title = "Lists"
    action = "view.lists"
    DEFAULT_CSS = """
    ListsView TableView { height: auto; max-height: 60%; }
    ListsView #happened { height: 1fr; border-top: solid $foreground 20%; }
    ListsView.-well TableView { max-height: 100%; height: 1fr; }
    """

    def __init__(self) -> None:
        super().__init__(id="lists")
        self._look: Look | None = None
        self._order: list[int] = []
        self._sort = ""
        self._reversed = False
        self._alone = False

    def compose(self) -> ComposeResult:
        self._table = TableView()
        self._happened = LinesView(id="happened")
        yield self._table
        yield self._happened

    def show(self, look: Look) -> None:
        self._look = look
        entries, keys = look.entries, self._keys(look)
        self._order = self._ordered(look, keys)
        chronicle = look.chronicle

        def cells(row: int) -> Sequence[Cell]:
            place = self._order[row]
            return list(_cells(look, look.report["lists"][place], entries[place].number, keys[place]))

        def strips(rows: Sequence[int], room: int) -> Sequence[Cell]:
            if chronicle is None:
                return [Cell("")] * len(rows)
            drawn = chronicle.strips([str(entries[self._order[row]].key) for row in rows], room)
            return [Cell("".join(MARKS[mark][0] for mark in one)) for one in drawn]

        def title(room: int) -> str:
            if chronicle is None:
                return ""
            length_ns = max(chronicle.end_ns - chronicle.start_ns, 1)
            return f"last {units.duration(length_ns)}"[:room] if look.live else scale(length_ns, room)

        self._table.show(
            Table(COLUMNS, len(self._order), cells, lambda row: keys[self._order[row]], _STRIP_AT, strips, title)
        )
        self._tell_what_happened()

    def _keys(self, look: Look) -> list[str]:
        return [str(entry.key) for entry in look.entries]

    def _ordered(self, look: Look, keys: Sequence[str]) -> list[int]:
        shown = list(range(len(keys)))
        choice = look.choice
        if choice is not None and not choice.suspended and choice.lists is not None:
            shown = [place for place in shown if keys[place] in choice.lists]
        if self._sort:
            value = _SORTS[self._sort]
            shown.sort(key=lambda place: value(look, place), reverse=self._reversed)
        else:
            first = {key: number for number, key in enumerate(look.concerns)}
            shown.sort(key=lambda place: first.get(keys[place], len(first)), reverse=self._reversed)
        return shown

    def _tell_what_happened(self) -> None:
        """Show the causes below: those of the list under the cursor in front."""
        look = self._look
        assert look is not None
        if not look.entries:
            self._happened.display = True
            self._happened.show(_nothing_yet(look, max(self.size.width - 1, _NARROWEST)))
            return
        every: Sequence[Mapping[str, Any]] = list(look.report["causes"])
        number_of = {id(one): number for number, one in enumerate(every, 1)}
        told = [one for one in every if severity_of(one) > Severity.NOTE]
        if (choice := look.choice) is not None and not choice.suspended and choice.lists is not None:
            told = [one for one in told if not one["lists"] or set(one["lists"]) & set(choice.lists)]
        key = self._table.key
        own = [one for one in told if key in one["lists"]] if self._table.row > 0 else []
        others = [one for one in told if one not in own]
        shown, width = [*own, *others], max(self.size.width - 1, _NARROWEST)
        # They keep the numbers that they have in the view of causes, and in reports.
        lines = list(causes.lines(shown, width, numbers=[number_of[id(one)] for one in shown]))[1:] if told else []
        self._happened.display = bool(lines) and not self._alone
        self.set_class(not self._happened.display, "-well")
        self._happened.show(lines)

    def on_table_view_moved(self) -> None:
        self._tell_what_happened()

    def on_table_view_opened(self) -> None:
        self.act("view.open")

    def on_resize(self) -> None:
        if self._look is not None:
            self._tell_what_happened()

    def act(self, action: str, told: str = "") -> bool:
        if self._table.move(action):
            return True
        if action == "show.sort":
            names = ["", *_SORTS]
            if told and told not in _SORTS:
                self.app.notify(f"Sort by one of: {', '.join(_SORTS)}", severity="warning")
                return True
            self._sort = told or names[(names.index(self._sort) + 1) % len(names)]
            # Numbers begin with the largest: that is what somebody looks for.
            self._reversed = self._sort not in ("", "list", "sender")
            self.app.notify(f"Sorted by {self._sort or 'what happened'}")
        elif action == "show.reverse":
            self._reversed = not self._reversed
        elif action == "view.open":
            key = self._table.key
            if isinstance(key, str) and self._look is not None:
                # A list that no definition knows has telegrams, and no variables.
                has_variables = any(str(one.list) == key for one in self._look.scene.variables)
                self.post_message(self.Asked("view.variables" if has_variables else "view.packets", key))
        elif action == "view.maximise":
            self._alone = not self._alone
        else:
            return False
        if self._look is not None:
            self.show(self._look)
        return True

    def hints(self) -> Sequence[str]:
        return ("time.freeze", "find.filter", "show.sort", "view.open")

    def copied(self) -> str:
        return self._table.text()

    def place(self) -> Any:
        return self._table.key

    def go_to(self, place: Any) -> bool:
        if self._look is None:
            return False
        keys = self._keys(self._look)
        found = next((row for row, at in enumerate(self._order) if keys[at] == place), None)
        if found is not None:
            self._table.go_to(found)
        return found is not None


def _cells(look: Look, row: Mapping[str, Any], number: int, key: str) -> Iterator[Cell]:
    concern = look.concerns.get(row["key"])
    yield symbol(concern.severity if concern else None)
    yield Cell(_name(row), Tone.STRONG)
    looked = looked_at(row, look.nodes)
    yield _OF["sender"](looked)
    pace = look.scene.pace
    rate = pace.per_second(number)
    yield Cell(NOTHING, Tone.FAINT) if not rate else Cell(units.rate(rate))
    yield Cell(sparkline(pace.seconds(number, _SPARK_SECONDS)), Tone.FAINT)
    yield _OF["interval"](looked)
    yield _OF["jitter"](looked)
    lost = _OF["lost"](looked)
    yield Cell("0", Tone.FAINT) if lost.text == NOTHING else lost
    yield _age(look, pace.last_of(number))
    yield Cell(concern.words, symbol(concern.severity).tone) if concern else Cell("")


def _nothing_yet(look: Look, width: int) -> list[Line]:
    """Return what is said as long as there is no list, and what to check."""
    mark, told = headline(look.report)
    goes_on = look.live and any_live(look.scene.snapshot.infos)
    if look.live and not look.report["capture"]["telegrams"]:
        told = "No telegram of network variables came yet"
    lines = wrap([Cell(f"{mark.text} ", mark.tone), Cell(told, Tone.STRONG)], width, hanging=2)
    for step in content.advice(look.report) if not goes_on else _LIVE_ADVICE:
        lines += [[], *wrap([Cell(f"- {step}")], width, 2, 4)]
    return lines


_LIVE_ADVICE = (
    "Does a sender run? A list sent on change says nothing while nothing changes.",
    "Can its telegrams get here? Broadcasts stay within their VLAN; what goes to one node, only a mirror port shows.",
    "`nvscope doctor` looks for what is in the way: addresses, ports, permissions, firewalls.",
)


def _name(row: Mapping[str, Any]) -> str:
    """Return the identifier of a list, and its name where it has one."""
    short = row["key"].rpartition("/")[2] if row["transport"] == "udp" else units.list_key(row["key"])
    return f"{short} {row['name']}" if row["name"] else short


def _age(look: Look, last_ns: int | None) -> Cell:
    """Return how long ago the last telegram came, in whole seconds."""
    if last_ns is None:
        return Cell(NOTHING, Tone.FAINT)
    passed_ns = max(look.now_ns - last_ns, 0)
    if passed_ns < _S_NS:
        return Cell("0 s", Tone.FAINT)
    if passed_ns < 60 * _S_NS:
        return Cell(f"{passed_ns // _S_NS} s")
    return Cell(units.duration(passed_ns))


def sparkline(counts: Sequence[int]) -> str:
    """Return numbers as bars, the highest of them as a full one."""
    most = max(counts, default=0)
    if not most:
        return ""
    return "".join(_BARS[-(-count * (len(_BARS) - 1) // most)] for count in counts).rjust(_SPARK_SECONDS)


def _lost(look: Look, place: int) -> float:
    entry = look.entries[place]
    lost = entry.counters["lost"] if isinstance(entry, ListSummary) else None
    return _NO_NUMBER if lost is None else lost


def _rate(look: Look, place: int) -> float:
    rate = look.scene.pace.per_second(look.entries[place].number)
    return _NO_NUMBER if rate is None else rate


def _last(look: Look, place: int) -> float:
    last_ns = look.scene.pace.last_of(look.entries[place].number)
    return _NO_NUMBER if last_ns is None else float(look.now_ns - last_ns)


def _interval(look: Look, place: int) -> float:
    known = [stream.intervals.p50 for stream in look.entries[place].streams if stream.intervals.p50 is not None]
    return float(max(known)) if known else _NO_NUMBER


def _jitter(look: Look, place: int) -> float:
    row = looked_at(look.report["lists"][place], look.nodes)
    digits = "".join(one for one in _OF["jitter"](row).text if one.isdigit() or one == ".")
    return float(digits) if digits else _NO_NUMBER


_SORTS: Mapping[str, Callable[[Look, int], Any]] = {
    "list": lambda look, place: look.entries[place].key,
    "sender": lambda look, place: look.report["lists"][place]["senders"],
    "rate": _rate,
    "interval": _interval,
    "jitter": _jitter,
    "lost": _lost,
    "age": _last,
}
