"""The causes: what happened, what is not over first, each with what was checked; its explanation in place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from textual.app import ComposeResult

from nvscope.tui.lines_view import LinesView
from nvscope.tui.look import Look
from nvscope.tui.views.view import View
from nvscope.view.lines.plant import causes
from nvscope.view.lines.plant.explain_cause import cause_called, cause_lines
from nvscope.view.lines.plant.happenings import headline, is_now
from nvscope.view.lines.table import Cell, Line, Tone, wrap

_INDENT = 5
_NARROWEST = 18
_Identity = tuple[str, str, tuple[str, ...], tuple[str, ...]]


class CausesView(View):
    """The causes, grouped by whether they are over; an entry opens to what its kind means."""

    title = "Causes"
    action = "view.causes"

    def __init__(self) -> None:
        super().__init__(id="causes")
        self._look: Look | None = None
        self._opened: set[_Identity] = set()
        self._identities: list[_Identity] = []
        self._current: _Identity | None = None
        self._rows: Sequence[Mapping[str, Any]] = ()

    def compose(self) -> ComposeResult:
        self._lines = LinesView()
        yield self._lines

    def show(self, look: Look) -> None:
        self._look = look
        width = max(self.size.width - 1, _NARROWEST)
        rows: Sequence[Mapping[str, Any]] = look.report["causes"]
        choice = look.choice
        if choice is not None and not choice.suspended and choice.lists is not None:
            rows = [row for row in rows if not row["lists"] or set(row["lists"]) & set(choice.lists)]
        self._rows = rows
        lines: list[Line] = []
        starts: list[int] = []
        identities: list[_Identity] = []
        group = None
        for number, row in enumerate(rows, 1):
            if is_now(row) is not group:
                group = is_now(row)
                lines += [[Cell("Now" if group else "Over", Tone.FAINT)], []] if not lines else [
                    [], [Cell("Now" if group else "Over", Tone.FAINT)], [],
                ]  # fmt: skip
            elif lines:
                lines.append([])
            identity = _identity(row)
            identities.append(identity)
            starts.append(len(lines))
            lines += causes.lines_of(number, row, width, every=identity in self._opened)
            lines.append(_when(look, row))
            if identity in self._opened:
                lines += _explained(row["kind"], width)
        if not rows:
            mark, told = headline(look.report)
            lines = wrap([Cell(f"{mark.text} ", mark.tone), Cell(told)], width, hanging=2)
        entry = identities.index(self._current) if self._current in identities else None
        self._identities = identities
        self._lines.show(lines, starts, entry if entry is not None and entry != self._lines.entry else None)
        self._note()

    def _note(self) -> None:
        at = self._lines.entry
        self._current = self._identities[at] if 0 <= at < len(self._identities) else None

    def on_resize(self) -> None:
        if self._look is not None:
            self.show(self._look)

    def act(self, action: str, told: str = "") -> bool:
        if self._lines.move(action):
            self._note()
            return True
        row = self.row
        if action in ("view.open", "show.explain") and not told:
            if self._current is not None:
                self._opened ^= {self._current}
        elif action == "time.go" and row is not None and not told and row["since_ns"]:
            self.post_message(self.Asked("time.go-to-ns", row["since_ns"]))
        elif action == "view.packets" and row is not None and row["frames"]:
            self.post_message(self.Asked("view.packets", f"#{row['frames'][0]}"))
        else:
            return False
        if self._look is not None:
            self.show(self._look)
        return True

    @property
    def row(self) -> Mapping[str, Any] | None:
        """The cause under the cursor, as the report has it."""
        return self._rows[self._lines.entry] if 0 <= self._lines.entry < len(self._rows) else None

    def hints(self) -> Sequence[str]:
        return ("view.open", "view.packets", "time.previous-finding", "time.next-finding")

    def copied(self) -> str:
        row = self.row
        if row is None:
            return ""
        return "\n".join([row["title"], *(f"- {fact}" for fact in row["checked"]), f"Next: {row['next']}"])

    def place(self) -> Any:
        return self._current

    def go_to(self, place: Any) -> bool:
        if place not in self._identities:
            return False
        self._current = place
        if self._look is not None:
            self.show(self._look)
        return True


def _identity(row: Mapping[str, Any]) -> _Identity:
    return row["kind"], row["since_ns"] or "", tuple(row["nodes"]), () if row["nodes"] else tuple(row["lists"])


def _when(look: Look, row: Mapping[str, Any]) -> Line:
    """Return since when, until when, and in which frames."""
    since, until = (None if row[name] is None else int(row[name]) for name in ("since_ns", "until_ns"))
    parts = []
    if since is not None:
        parts.append(f"since {look.clock.moment(since)}")
    if until is not None:
        parts.append(f"until {look.clock.moment(until)}")
    if row["frames"]:
        more = " …" if len(row["frames"]) > 3 or row["frames_cut"] else ""
        parts.append(f"frames {', '.join(map(str, row['frames'][:3]))}{more}")
    return [Cell(" " * _INDENT + ", ".join(parts), Tone.FAINT)]


def _explained(kind: str, width: int) -> list[Line]:
    """Return what a kind of cause means, further in."""
    known = cause_called(kind)
    if known is None:
        return []
    return [[], *([Cell(" " * _INDENT), *line] for line in cause_lines(known, width - _INDENT))]
