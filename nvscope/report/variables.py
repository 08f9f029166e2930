"""The variables of a capture as a table for people."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from nvscope import units
from nvscope.enumeration import first_few
from nvscope.report import missing
from nvscope.report.ansi import paint
from nvscope.view.documents.variables import ASSUMED
from nvscope.view.escape import visible, visible_document
from nvscope.view.lines.plant.content import filter_cells, nanoseconds
from nvscope.view.lines.table import Cell, Column, Line, Tone, align, wrap

MIN_WIDTH = 40
_TEXT_WIDTH = 110  # longer lines of prose are hard to read
_NOTHING_CAME = "No telegram of a defined list was found: compare the identifiers and ports of the definition files."
_NOT_ONE_CAME = "No telegram of this list was found: compare its identifier and port with what `nvscope report` shows."
_MOST_NAMED = 5

VALUE_WIDTH = 40
"""Values up to this width are shown whole: everything else about a variable gives way first."""

_COLUMNS = (
    Column("Variable", shortest=12, identifier=True),
    Column("Value", shortest=VALUE_WIDTH),
    Column("Type", importance=1, shortest=12),
    Column("Changed", importance=4),
    Column("Changes", right=True, importance=5),
    Column("Min", right=True, importance=2),
    Column("Max", right=True, importance=2),
)


def render(
    document: Mapping[str, Any],
    *,
    colour: bool = False,
    width: int = 80,
    wide: bool = False,
    utc: bool = False,
    node_names: Mapping[str, str] = MappingProxyType({}),
    some_came: bool = False,
    of_one_list: bool = False,
) -> str:
    """Return variables (schema ``nvscope.vars/1``) as text of at most ``width`` columns, ending with a line break.

    ``wide`` tables are as wide as they need all the same. Senders are called by ``node_names``, where these have one by
    their address. ``some_came``: if there are none, it is not because no telegram came. ``of_one_list``: others were
    not asked for.
    """
    names = {node: visible(name) for node, name in node_names.items()}
    shown, width = visible_document(document), max(width, MIN_WIDTH)
    parts = [filter_lines(shown["filter"], width)]
    absent = [*missing.lines(shown["missing"], min(width, _TEXT_WIDTH))]
    if shown["variables"] or has_read_rows(shown):
        parts += [absent, [*_lines(shown, width, wide, utc, names)]]
        for rows in read_rows_by_list(shown).values():
            name = names.get(rows[0].get("sender", ""), "")
            parts.append([*_read_lines(rows, width, wide, utc, name, filtered=shown["filter"] is not None)])
    else:
        told = _nothing_told(shown["filter"], some_came, of_one_list)
        parts[0] = [*parts[0], *wrap([Cell(told, Tone.WARNING)], width)]
        parts.append(absent)
    lines = [line for part in parts if part for line in ([], *part)]
    return paint(lines[1:], colour=colour)


def filter_lines(chosen: Mapping[str, Any] | None, width: int) -> list[Line]:
    """Return what is said of a filter in front of what it leaves, nothing where there is none."""
    if chosen is None:
        return []
    return wrap(filter_cells(chosen, chosen["all_telegrams"]), width)


def _nothing_told(chosen: Mapping[str, Any] | None, some_came: bool, of_one_list: bool) -> str:
    """Return why there are no values: what the filter chose, or what else came."""
    if chosen is not None and not chosen["telegrams"]:
        return "No value: the filter chooses no telegram."
    if chosen is not None:
        which = "this" if of_one_list else "a defined"
        return f"No value: no telegram that the filter chooses is one of {which} list that could be decoded."
    if some_came:
        return f"Telegrams of {'this list' if of_one_list else 'defined lists'} came, but none that could be decoded."
    return _NOT_ONE_CAME if of_one_list else _NOTHING_CAME


def _lines(document: Mapping[str, Any], width: int, wide: bool, utc: bool, names: Mapping[str, str]) -> Iterator[Line]:
    # What a layout of before gave stands behind what that of now gives.
    places: dict[tuple[str, str], int] = {}
    groups: dict[tuple[int, bool, str], list[Mapping[str, Any]]] = {}
    for earlier in (False, True):
        for row in document["earlier" if earlier else "variables"]:
            place = places.setdefault((row["list"], row["sender"]), len(places))
            groups.setdefault((place, earlier, row["list_name"]), []).append(row)
    for number, ((_, earlier, name), rows) in enumerate(sorted(groups.items(), key=lambda group: group[0][:2])):
        if number:
            yield []
        key, sender = rows[0]["list"], rows[0]["sender"]
        assumed = rows[0]["packing"] == ASSUMED
        whence = "" if assumed else f" from {names.get(sender, sender)}"
        title = [Cell(f"{units.list_key(key)} {name}", Tone.STRONG), Cell(f"{whence}, {_telegrams(rows)}")]
        if assumed:
            title.append(Cell(", packed as assumed", Tone.FAINT))
        if earlier:
            last_ns = max(nanoseconds(row["last_ns"]) or 0 for row in rows)
            told = f" until {units.clock_time(last_ns, utc=utc)}; later ones have another shape (above)"
            title.append(Cell(told, Tone.WARNING))
        yield from wrap(title, width)
        dated = _are_dated(rows, utc)
        told_rows = [_cells(row, utc, dated=dated) for row in rows]
        yield from align(_COLUMNS, told_rows, None if wide else width, 2)


_READ_KEYS = ("page_variables", "logged_variables")


def has_read_rows(document: Mapping[str, Any]) -> bool:
    """Tell whether there are variables whose values come one by one."""
    return any(document.get(key) for key in _READ_KEYS)


def read_rows_by_list(document: Mapping[str, Any]) -> Mapping[str, Sequence[Mapping[str, Any]]]:
    """Return the rows of variables whose values come one by one, by what stands for the list."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for key in _READ_KEYS:
        for row in document.get(key, ()):
            found.setdefault(row["list"], []).append(row)
    return found


def _read_lines(
    rows: Sequence[Mapping[str, Any]], width: int, wide: bool, utc: bool, name: str, *, filtered: bool
) -> Iterator[Line]:  # fmt: skip
    """Yield the variables of one controller or database; those that never had a value by their names."""
    of_pages = is_of_pages(rows[0])
    known = [row for row in rows if row["text"] is not None]
    whose = "of web visualization" if of_pages else "logged"
    told = f"{' ' + name if name else ''}, {units.count_of(len(known), 'variable')} {whose}"
    dated = _are_dated(known, utc)
    # Captures are read when they were made, databases years later.
    days = [] if of_pages or dated else sorted(_days(known, utc))
    day = f", changed on {days[0]}" if days else ""
    yield from wrap([Cell(rows[0]["list"], Tone.STRONG), Cell(told), Cell(day, Tone.FAINT)], width)
    if known:
        yield from align(_COLUMNS, [_cells(row, utc, dated=dated) for row in known], None if wide else width, 2)
    never = [row for row in rows if row["text"] is None]
    absent = [row["name"] for row in never if of_pages and not row["unreadable"]]
    others = [row["name"] for row in never if not of_pages or row["unreadable"]]
    yield from never_told(others, absent, width, of_pages=of_pages, filtered=filtered)


def is_of_pages(row: Mapping[str, Any]) -> bool:
    """Tell whether a variable whose values come one by one is one of pages."""
    return "place" in row


def never_told(
    names: Sequence[str], absent: Sequence[str], width: int, *, of_pages: bool, filtered: bool
) -> Sequence[Line]:  # fmt: skip
    """Return which variables never had a value, though somebody asked for it; nothing where there are none.

    ``absent`` are those that are in no reply. ``filtered``: they may have had a value where a filter has left it out.
    """
    told = "Never readable (???)" if of_pages else "Never a value (NULL in each row)"
    if filtered:
        names, absent, told = [*names, *absent], [], "No value that could be read in what the filter chooses"
    return [*_named(told, names, width), *_named("Asked for, and in no reply (NV804)", absent, width)]


def _named(told: str, names: Sequence[str], width: int) -> Sequence[Line]:
    if not names:
        return []
    return wrap([Cell(f"{told}: {first_few(names, _MOST_NAMED, between='; ')}.", Tone.WARNING)], width, 2, 4)


def _telegrams(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return how many telegrams the values of a list come from, of all its SubIndexes, on CAN COB-IDs, together."""
    telegrams = {row["subindex"]: row["telegrams"] for row in rows}
    told = units.count_of(sum(telegrams.values()), "telegram")
    parts = "COB-IDs" if rows[0]["list"].startswith("can/") else "SubIndexes"
    return told if len(telegrams) == 1 else f"{told} in {len(telegrams)} {parts}"


def _days(rows: Sequence[Mapping[str, Any]], utc: bool) -> Collection[str]:
    """Return the days on which variables changed the last time."""
    changed = (nanoseconds(row["changed_ns"]) or 0 for row in rows if row["changes"])
    return {units.date(time_ns, utc=utc) for time_ns in changed}


def _are_dated(rows: Sequence[Mapping[str, Any]], utc: bool) -> bool:
    """Tell whether a time of day does not say when a variable changed."""
    return len(_days(rows, utc)) > 1


def _cells(row: Mapping[str, Any], utc: bool, *, dated: bool) -> list[Cell]:
    changed = nanoseconds(row["changed_ns"]) or 0
    when = units.absolute_time if dated else units.clock_time
    return [
        Cell(row["name"]),
        Cell(row["text"], Tone.STRONG),
        Cell(row["type"], Tone.FAINT),
        Cell(when(changed, utc=utc) if row["changes"] else "never"),
        Cell(units.count(row["changes"])),
        Cell(row["min_text"] or "-"),
        Cell(row["max_text"] or "-"),
    ]
