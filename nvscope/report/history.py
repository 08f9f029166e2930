"""The changes of variables, written as they are found: lines for people, or one JSON document.

Each face is used so: ``begin``, then ``line`` for each change, then ``end``. None keeps what it has written.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from nvscope import units
from nvscope.report.ansi import paint
from nvscope.report.content import nanoseconds
from nvscope.view.escape import visible, visible_document
from nvscope.view.history import HISTORY_SCHEMA, TOOL
from nvscope.view.table import NO_BREAK, Cell, Column, Line, Tone, align, display_width, shorten, wrap

MIN_WIDTH = 40

Row = Mapping[str, Any]

_CLOCK_WIDTH, _FRAME_WIDTH, _SENDER_WIDTH = 12, 7, 15
_ARROW = " → "
_FIRST = " (first)"
_FRAMES_FROM_WIDTH = 60
_SUMMARY = (
    Column("Variable", shortest=12),
    Column("List", importance=1),
    Column("Sender", shortest=11, importance=2),
    Column("Telegrams", right=True, importance=0),
    Column("Changes", right=True),
    Column("Shortest", right=True),
    Column("Longest", right=True),
)


class Text:
    """A line a change, of at most ``width`` columns: time of day, frame, sender, variable, old and new value.

    ``names`` and ``lists`` are all that can occur: columns that would say the same in each line are left out.
    """

    def __init__(
        self, names: Sequence[str], lists: Sequence[str], *, width: int = 80, colour: bool = False, utc: bool = False
    ) -> None:
        self._width = max(width, MIN_WIDTH)
        self._colour = colour
        self._utc = utc
        self._day = ""
        shown = [visible(name) for name in set(names)]
        self._frame = self._width >= _FRAMES_FROM_WIDTH
        room = self._width - _CLOCK_WIDTH - 2 - (_FRAME_WIDTH + 2 if self._frame else 0)
        self._sender = _SENDER_WIDTH if room >= 50 else 0
        room -= self._sender + 2 if self._sender else 0
        self._list = max(map(len, lists)) if len(set(lists)) > 1 and room >= 50 else 0
        room -= self._list + 2 if self._list else 0
        longest = max(map(display_width, shown), default=0)
        self._name = min(longest, max(room // 2, 12)) if len(shown) > 1 else 0
        self._change = room - (self._name + 2 if self._name else 0)

    def begin(self) -> str:
        return ""

    def line(self, row: Row) -> str:
        time_ns = int(row["time_ns"])
        lines: list[Line] = []
        day = units.date(time_ns, utc=self._utc)
        if day != self._day:
            self._day = day
            lines.append([Cell(f"{day} ({'UTC' if self._utc else units.zone(time_ns, utc=False)})", Tone.FAINT)])
        clock = Cell(units.clock_time(time_ns, utc=self._utc).ljust(_CLOCK_WIDTH))
        cells = [clock, Cell("  ")]
        if self._frame:
            cells.append(Cell(f"{row['frame']:>{_FRAME_WIDTH}}  ", Tone.FAINT))
        for width, key in ((self._sender, "sender"), (self._list, "list"), (self._name, "name")):
            if width:
                text = shorten(visible(row[key]), width)
                cells.append(Cell(text + " " * (width - display_width(text) + 2)))
        lines.append([*cells, *self._values(row)])
        return paint(lines, colour=self._colour)

    def _values(self, row: Row) -> list[Cell]:
        new = visible(row["new_text"])
        if row["old_text"] is None:
            return [Cell(shorten(new, max(self._change - len(_FIRST), 1)), Tone.STRONG), Cell(_FIRST, Tone.FAINT)]
        if not row["changed"]:
            return [Cell(shorten(new, max(self._change, 1)))]
        room = max(self._change - len(_ARROW), 2)
        half = max(room - display_width(new), room // 2)
        old = shorten(visible(row["old_text"]), max(half, 1))
        return [
            Cell(old, Tone.FAINT), Cell(_ARROW), Cell(shorten(new, max(room - display_width(old), 1)), Tone.STRONG)
        ]  # fmt: skip

    def end(self, summary: Sequence[Row]) -> str:
        """Return how often each variable changed."""
        rows = visible_document(summary)
        lines: list[Line] = []
        if not rows:
            text = (
                "No telegram with this variable was found: compare the identifiers and ports of the definition files "
                "with `nvscope report`."
            )
            lines += wrap([Cell(text, Tone.WARNING)], self._width)
        else:
            lines += [[], *align(_SUMMARY, [_figures(row) for row in rows], self._width)]
            steps = sum(row["changes"] for row in rows)
            told = f"{units.count_of(steps, 'change')}; shortest and longest are times between two changes."
            lines += [[], *wrap([Cell(told.replace("\u00a0", NO_BREAK), Tone.FAINT)], self._width)]
        return paint(lines, colour=self._colour)


def _figures(row: Row) -> list[Cell]:
    between = [None if row[key] is None else units.duration(row[key]) for key in ("shortest_ns", "longest_ns")]
    return [
        Cell(row["name"], Tone.STRONG),
        Cell(row["list"]),
        Cell(row["sender"]),
        Cell(units.count(row["telegrams"])),
        Cell(units.count(row["changes"])),
        *(Cell(text or "-") for text in between),
    ]


class Json:
    """One document of schema ``nvscope.history/1``, each change on a line of its own; in constant memory.

    Plain printable ASCII, as the other documents.
    """

    def __init__(self) -> None:
        self._any = False

    def begin(self) -> str:
        head = f'"schema": {_ascii(HISTORY_SCHEMA)}, "tool": {_ascii(TOOL)}'
        return f'{{{head}, "changes": ['

    def line(self, row: Row) -> str:
        separator = ",\n" if self._any else "\n"
        self._any = True
        return separator + _ascii(row)

    def end(self, summary: Sequence[Row]) -> str:
        rows = ",\n".join(_ascii(row) for row in summary)
        return f'\n], "variables": [\n{rows}\n]}}\n'


def _ascii(value: Any) -> str:
    return json.dumps(value, ensure_ascii=True, allow_nan=False).replace("\x7f", "\\u007f")


_AT = (
    Column("Variable", shortest=12),
    Column("Value", shortest=8),
    Column("Type", importance=1),
    Column("Age", right=True),
)


def render_at(document: Row, *, colour: bool = False, width: int = 80, utc: bool = False) -> str:
    """Return variables at a time (schema ``nvscope.at/1``) as text of at most ``width`` columns."""
    width = max(width, MIN_WIDTH)
    shown = visible_document(document)
    lines = [*wrap(_moment(shown, utc), width)]
    groups: dict[tuple[str, str, str | None], list[Row]] = {}
    for row in shown["variables"]:
        groups.setdefault((row["list"], row["list_name"], row["sender"]), []).append(row)
    for (key, name, sender), rows in groups.items():
        lines.append([])
        title = [Cell(f"{key} {name}", Tone.STRONG)]
        if sender is None:
            lines += wrap([*title, Cell(": nobody sends it in this capture", Tone.WARNING)], width)
            continue
        lines += wrap([*title, Cell(f" from {sender}")], width)
        lines += align(_AT, [_at_cells(row) for row in rows], width, 2)
    if not groups:
        lines += wrap([Cell("The definition files have no list that can be decoded.", Tone.WARNING)], width)
    return paint(lines, colour=colour)


def _moment(document: Row, utc: bool) -> list[Cell]:
    time_ns = int(document["time_ns"])
    cells = [Cell(units.absolute_time(time_ns, utc=utc), Tone.STRONG)]
    cells.append(Cell(f" ({'UTC' if utc else units.zone(time_ns, utc=False)})"))
    start_ns, end_ns = (nanoseconds(document["capture"][key]) for key in ("start_ns", "end_ns"))
    if start_ns is None or end_ns is None:
        return [*cells, Cell(": the capture holds no frames", Tone.WARNING)]
    if document["last_frame"] is None:
        return [*cells, Cell(", before the first frame of the capture", Tone.WARNING)]
    cells.append(Cell(f", {units.duration(time_ns - start_ns)} after the first frame, up to frame "))
    cells.append(Cell(units.count(document["last_frame"])))
    if time_ns > end_ns:
        told = f"; the capture ends {units.duration(time_ns - end_ns)} before that".replace(" ms", f"{NO_BREAK}ms")
        cells.append(Cell(told, Tone.WARNING))
    return cells


def _at_cells(row: Row) -> list[Cell]:
    if row["text"] is None:
        return [Cell(row["name"]), Cell("not yet seen", Tone.WARNING), Cell(row["type"], Tone.FAINT), Cell("-")]
    return [
        Cell(row["name"]),
        Cell(row["text"], Tone.STRONG),
        Cell(row["type"], Tone.FAINT),
        Cell(units.duration(row["age_ns"])),
    ]
