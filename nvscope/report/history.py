"""The changes of variables, written as they are found: lines for people, or one JSON document.

Each face is used so: ``begin``, then ``line`` for each change, then ``end``. None keeps what it has written.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import IO, Any

from msgspec.structs import replace

from nvscope import units
from nvscope.report.ansi import paint
from nvscope.report.variables import (
    VALUE_WIDTH,
    filter_lines,
    has_read_rows,
    is_of_pages,
    never_told,
    read_rows_by_list,
)
from nvscope.tracker.readings.form import UNKNOWN_TEXT
from nvscope.version import head
from nvscope.view.documents.history import HISTORY_SCHEMA
from nvscope.view.documents.read_variables import NOT_IN_REPLIES
from nvscope.view.escape import json_ascii, visible, visible_document
from nvscope.view.lines.plant.content import nanoseconds
from nvscope.view.lines.short_names import short_names
from nvscope.view.lines.table import NO_BREAK, Cell, Column, Line, Tone, align, hidden, wrap
from nvscope.view.lines.text_width import display_width, shorten

MIN_WIDTH = 40

Row = Mapping[str, Any]

_CLOCK_WIDTH, _FRAME_WIDTH, _SENDER_WIDTH = 12, 7, 15
_ARROW = " → "
_FIRST = " (first)"
_FIRST_FROM_WIDTH = 20
_LIST_WIDTH = 16
_PAGE_LIST_WIDTH = len("visu/192.168.100.100")
_PAGE_NAME_WIDTH = 32
_SUBINDEX = "SubIndex"
_S_NS = 1_000_000_000
_MOST_COLUMNS = 1024
_KEPT_CHARACTERS = 1 << 22
_LEAST_REST = 33
"""Columns that variable and values keep: what else there is in a line has to fit beside them."""
_WIDE = 1 << 30
"""Columns of a line that is as wide as it needs: more than any value has."""

_SUMMARY = (
    Column("Variable", shortest=12, identifier=True),
    Column("List", importance=1, identifier=True),
    Column("Sender", shortest=11, importance=2, identifier=True),
    Column("Telegrams", right=True, importance=0),
    Column("Changes", right=True),
    Column("Shortest", right=True),
    Column("Longest", right=True),
)


class Text:
    """A line a change: time of day, frame, list, sender, variable, old and new value.

    Lines have at most ``width`` columns, or as many as they need (``wide``). ``names`` of variables and ``lists``
    (their keys and names) are all that can occur: columns that would say the same in each line are left out.
    ``subindexes``: a name alone does not say which telegram has it. ``read_alone``: only variables
    whose values come one by one can occur, of which nothing is known beforehand.
    """

    def __init__(
        self,
        names: Collection[str],
        lists: Collection[tuple[str, str]],
        *,
        subindexes: bool = False,
        read_alone: bool = False,
        width: int = 80,
        wide: bool = False,
        colour: bool = False,
        utc: bool = False,
    ) -> None:
        self._width = max(width, MIN_WIDTH)
        self._wide = wide
        self._colour = colour
        self._utc = utc
        self._read_alone = read_alone
        self._day = ""
        self._second: int | None = None
        # They come again in each telegram of a stream.
        self._columns = lru_cache(_MOST_COLUMNS)(self._told_columns)
        shown = [visible(name) for name in set(names)]
        keys, labels = {key for key, _ in lists}, {name for _, name in lists}
        # Lists of one name are told apart by their keys.
        self._label = "list_name" if len(set(lists)) == len(labels) else "list"
        room = (_WIDE if wide else self._width) - _CLOCK_WIDTH - 2
        self._list = 0
        self._short_lists: Mapping[str, str] = {}
        if len(keys) > 1:
            told = [visible(name) for name in labels] if self._label == "list_name" else [*keys]
            longest = max(map(display_width, [*told, "List"]))
            self._list = longest if wide else min(longest, _LIST_WIDTH, max(room // 4, 4))
            self._short_lists = short_names(told, self._list)
            room -= self._list + 2
        if read_alone:
            self._list = _PAGE_LIST_WIDTH if wide else min(_PAGE_LIST_WIDTH, max(room // 4, 4))
            room -= self._list + 2
        self._subindex = len(_SUBINDEX) if subindexes else 0
        room -= self._subindex + 2 if subindexes else 0
        # Of pages, what stands for the list has the address.
        self._sender = _SENDER_WIDTH if room - _SENDER_WIDTH - 2 >= _LEAST_REST and not read_alone else 0
        room -= self._sender + 2 if self._sender else 0
        self._frame = room - _FRAME_WIDTH - 2 >= _LEAST_REST
        room -= _FRAME_WIDTH + 2 if self._frame else 0
        longest = max(map(display_width, [*shown, "Variable"]))
        self._name = min(longest, max(room // 2, 8)) if len(shown) > 1 else 0
        if read_alone:
            self._name = max(min(_PAGE_NAME_WIDTH, room // 2), 8)
        self._short_names = short_names(shown, self._name) if shown and self._name else {}
        self._change = room - (self._name + 2 if self._name else 0)

    def begin(self) -> str:
        return ""

    def _headings(self) -> Line:
        frame = f"{'Frame':>{_FRAME_WIDTH}}  " if self._frame else ""
        columns = (
            (self._list, "List"),
            (self._sender, "Sender"),
            (self._subindex, _SUBINDEX),
            (self._name, "Variable"),
        )
        told = "".join(title.ljust(width + 2) for width, title in columns if width)
        return [Cell(f"{'Time':<{_CLOCK_WIDTH}}  {frame}{told}Value", Tone.FAINT)]

    def line(self, row: Row) -> str:
        time_ns = int(row["time_ns"])
        lines: list[Line] = []
        if time_ns // _S_NS != self._second:
            self._second = time_ns // _S_NS
            day = units.date(time_ns, utc=self._utc)
            if day != self._day:
                if not self._day:
                    lines.append(self._headings())
                self._day = day
                lines.append([Cell(f"{day} ({'UTC' if self._utc else units.zone(time_ns, utc=False)})", Tone.FAINT)])
        clock = Cell(units.clock_time(time_ns, utc=self._utc).ljust(_CLOCK_WIDTH))
        cells = [clock, Cell("  ")]
        if self._frame:
            cells.append(Cell(f"{row['frame']:>{_FRAME_WIDTH}}  ", Tone.FAINT))
        label, sender = row.get(self._label), row.get("sender", "")
        if is_single(row):  # it is of no list, but of a controller or a database
            label, sender = row["list"], sender if self._list else row["list"]
        cells.append(self._columns(label, sender, row.get("subindex"), row["name"]))
        lines.append([*cells, *self._values(row)])
        return paint(lines, colour=self._colour)

    def _told_columns(self, label: str, sender: str, subindex: int | None, name: str) -> Cell:
        """Return what a line says of where a variable is, in the columns that are shown."""
        label, sender, name = visible(label), visible(sender), visible(name)
        columns = (
            (self._list, self._short_lists.get(label) or (label if self._wide else shorten(label, self._list or 1))),
            (self._sender, sender if self._wide else shorten(sender, self._sender or 1)),
            (self._subindex, ("" if subindex is None else str(subindex)).rjust(self._subindex)),
            (self._name, self._short_names.get(name) or (name if self._wide else shorten(name, self._name or 1))),
        )
        told = [(width, text) for width, text in columns if width]
        return Cell("".join(text + " " * max(width - display_width(text) + 2, 1) for width, text in told))

    def _values(self, row: Row) -> list[Cell]:
        new = visible(row["new_text"])
        if row["old_text"] is None:
            # Where there is room for one of the two only, it is the value.
            is_room = self._change >= _FIRST_FROM_WIDTH
            is_room &= display_width(new) + len(_FIRST) <= self._change or not _is_number(row["new"])
            first = _FIRST if is_room else ""
            return [Cell(shorten(new, max(self._change - len(first), 1)), Tone.STRONG), Cell(first, Tone.FAINT)]
        if not row["changed"] and UNKNOWN_TEXT not in (row["old_text"], new):
            return [Cell(shorten(new, max(self._change, 1)))]
        room = max(self._change - len(_ARROW), 2)
        half = max(room - display_width(new), room // 2)
        if is_single(row) and half < display_width(row["old_text"]) and row["old_text"] == new:
            # Two values that are hidden: that it changed is all that can be told.
            return [Cell(_ARROW.lstrip(), Tone.FAINT), Cell(shorten(new, room), Tone.STRONG)]
        old = visible(row["old_text"])
        if display_width(old) + display_width(new) > room and (_is_number(row["old"]) or _is_number(row["new"])):
            # A number that is cut looks like another one; the old one stands in a line before.
            return [Cell(_ARROW.lstrip(), Tone.FAINT), Cell(shorten(new, self._change - 2), Tone.STRONG)]
        old = shorten(old, max(half, 1))
        return [
            Cell(old, Tone.FAINT), Cell(_ARROW), Cell(shorten(new, max(room - display_width(old), 1)), Tone.STRONG)
        ]  # fmt: skip

    def end(self, summary: Sequence[Row], chosen: Row | None = None, *, some_came: bool = False) -> Iterator[str]:
        """Yield how often each variable changed, and what the filter chose.

        ``some_came``: telegrams of the lists came, of whatever shape.
        """
        rows = visible_document(summary)
        told_filter = None if chosen is None else visible_document(chosen)
        there = ("Frame", self._frame), ("Sender", self._sender or self._read_alone)
        gone = [title for title, is_there in there if not is_there]
        lines: list[Line] = [*hidden(gone if self._day else [], self._width), *filter_lines(told_filter, self._width)]
        if not rows and self._read_alone:
            lines += wrap([Cell("No value of this variable came that could be read.", Tone.WARNING)], self._width)
        elif not rows and told_filter is None and not some_came:
            text = (
                "No telegram with this variable was found: compare the identifiers and ports of the definition files "
                "with `nvscope report`."
            )
            lines += wrap([Cell(text, Tone.WARNING)], self._width)
        elif not rows:
            lines += wrap([Cell(_no_history(told_filter), Tone.WARNING)], self._width)
        else:
            lines[:0] = [[]] if lines else []
            lines += [[], *align(*_summary(rows), None if self._wide else self._width)]
            steps = sum(row["changes"] for row in rows)
            told = f"{units.count_of(steps, 'change')}; shortest and longest are times between two changes."
            lines += [[], *wrap([Cell(told.replace("\u00a0", NO_BREAK), Tone.FAINT)], self._width)]
        yield paint(lines, colour=self._colour)


def _summary(rows: Sequence[Row]) -> tuple[Sequence[Column], list[list[Cell]]]:
    """Return the columns of a summary, without a sender where nobody sent anything, and their cells."""
    columns, cells = _SUMMARY, [_figures(row) for row in rows]
    if any("sender" in row for row in rows):
        return columns, cells
    titled = [replace(one, title="Rows") if one.title == "Telegrams" else one for one in columns]
    return titled[:2] + titled[3:], [line[:2] + line[3:] for line in cells]


def _figures(row: Row) -> list[Cell]:
    between = [None if row[key] is None else units.duration(row[key]) for key in ("shortest_ns", "longest_ns")]
    return [
        Cell(row["name"], Tone.STRONG),
        Cell(units.list_key(row["list"])),
        Cell(row.get("sender", "-")),
        Cell(units.count(row["rows"] if "rows" in row else row["telegrams"])),
        Cell(units.count(row["changes"])),
        *(Cell(text or "-") for text in between),
    ]


def _no_history(chosen: Row | None) -> str:
    if chosen is None:
        return "Telegrams of this list came, but none with this variable that could be decoded."
    if not chosen["telegrams"]:
        return "No value: the filter chooses no telegram."
    return "No value: no telegram that the filter chooses has this variable."


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_single(row: Row) -> bool:
    """Tell whether a row is of a variable whose values come one by one."""
    return "list_name" not in row


class Json:
    """One document of schema ``nvscope.history/1``, each change on a line of its own; in constant memory.

    Plain printable ASCII, as the other documents. Changes of variables of pages and databases stand behind those of
    lists: until then they are kept in files, but those that come first where there can be none of lists
    (``read_alone``).
    """

    def __init__(self, *, read_alone: bool = False) -> None:
        self._any: set[str] = set()
        self._now = "" if read_alone else "changes"
        self._kept: dict[str, IO[str]] = {}

    def begin(self) -> str:
        return f'{_ascii(head(HISTORY_SCHEMA))[:-1]}, "changes": ['

    def line(self, row: Row) -> str:
        key = "changes" if not is_single(row) else "page_changes" if is_of_pages(row) else "logged_changes"
        begin = ""
        if not self._now:
            self._now, begin = key, f'], "{key}": ['
        separator = ",\n" if key in self._any else "\n"
        self._any.add(key)
        if key == self._now:
            return begin + separator + _ascii(row)
        if key not in self._kept:
            from tempfile import SpooledTemporaryFile  # noqa: PLC0415  # most captures have lists alone

            self._kept[key] = SpooledTemporaryFile(_KEPT_CHARACTERS, "w+", encoding="ascii")  # noqa: SIM115  # as long as this
        self._kept[key].write(separator + _ascii(row))
        return ""

    def end(self, summary: Sequence[Row], chosen: Row | None = None, *, some_came: bool = False) -> Iterator[str]:
        """Yield the rest of the document."""
        for key, kept in sorted(self._kept.items(), reverse=True):
            yield f'\n], "{key}": ['
            kept.seek(0)
            while piece := kept.read(_KEPT_CHARACTERS):
                yield piece
            kept.close()
        parts: dict[str, list[Row]] = {"variables": [], "page_variables": [], "logged_variables": []}
        for row in summary:
            parts[
                "variables" if not is_single(row) else "page_variables" if is_of_pages(row) else "logged_variables"
            ].append(row)
        rows, *others = (
            f'"{key}": [\n{told}\n]'
            for key, told in (
                (key, ",\n".join(map(_ascii, part))) for key, part in parts.items() if part or key == "variables"
            )
        )
        yield f'\n], {", ".join([rows, *others])}, "filter": {_ascii(chosen)}}}\n'


def _ascii(value: Any) -> str:
    return json_ascii(json.dumps(value, ensure_ascii=True, allow_nan=False))


_NEVER = {
    "not sent": "nobody sends it in this capture",
    "not chosen": "sent, but the filter chooses none of its telegrams",
    "not decoded": "sent, but no telegram that could be decoded",
}
_NO_VALUE = ("not readable", "no value", NOT_IN_REPLIES)
"""Why there is no value of a variable that is read in single values, at no time at all."""

_AT = (
    Column("Variable", shortest=12, identifier=True),
    Column("Value", shortest=VALUE_WIDTH),
    Column("Type", importance=1, shortest=12),
    Column("Age", right=True),
)


def render_at(
    document: Row, *, colour: bool = False, width: int = 80, wide: bool = False, utc: bool = False
) -> str:  # fmt: skip
    """Return variables at a time (schema ``nvscope.at/1``) as text of at most ``width`` columns."""
    width = max(width, MIN_WIDTH)
    shown = visible_document(document)
    lines = [*wrap(_moment(shown, utc), width), *filter_lines(shown["filter"], width)]
    groups: dict[tuple[str, str, str | None], list[Row]] = {}
    for row in shown["variables"]:
        groups.setdefault((row["list"], row["list_name"], row["sender"]), []).append(row)
    for (key, name, sender), rows in groups.items():
        lines.append([])
        title = [Cell(f"{units.list_key(key)} {name}", Tone.STRONG)]
        if sender is None:
            lines += wrap([*title, Cell(f": {_NEVER[rows[0]['missing']]}", Tone.WARNING)], width)
            continue
        # On CAN, the key has the channel, and nobody knows the sender.
        whence = Cell(", packed as assumed", Tone.FAINT) if key.startswith("can/") else Cell(f" from {sender}")
        lines += wrap([*title, whence], width)
        unseen = "not yet seen" if shown["filter"] is None else "not yet chosen"
        lines += align(_AT, [_at_cells(row, unseen) for row in rows], None if wide else width, 2)
    for key, of_page in read_rows_by_list(shown).items():
        of_pages = is_of_pages(of_page[0])
        what = ", web visualization" if of_pages else ", logged"
        lines += [[], *wrap([Cell(key, Tone.STRONG), Cell(what)], width)]
        known = [row for row in of_page if row["missing"] not in _NO_VALUE]
        lines += align(_AT, [_at_cells(row, "not yet seen") for row in known], None if wide else width, 2)
        absent = [row["name"] for row in of_page if row["missing"] == NOT_IN_REPLIES]
        never = [row["name"] for row in of_page if row["missing"] in _NO_VALUE and row["missing"] != NOT_IN_REPLIES]
        lines += never_told(never, absent, width, of_pages=of_pages, filtered=shown["filter"] is not None)
    if not groups and not has_read_rows(shown):
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


def _at_cells(row: Row, unseen: str) -> list[Cell]:
    if row["text"] is None:
        return [Cell(row["name"]), Cell(unseen, Tone.WARNING), Cell(row["type"], Tone.FAINT), Cell("-")]
    return [
        Cell(row["name"]),
        Cell(row["text"], Tone.STRONG),
        Cell(row["type"], Tone.FAINT),
        Cell(units.duration(row["age_ns"])),
    ]
