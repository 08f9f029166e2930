"""Two definitions compared, for people: what differs, and where the values of A land in B."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from nvscope.report.ansi import paint
from nvscope.report.list_words import identifier_of, list_and_port
from nvscope.units import cob_id, count, count_of, duration, ranges
from nvscope.view.escape import visible_document
from nvscope.view.lines.table import Cell, Column, Line, Tone, align, wrap

MIN_WIDTH = 40
MOST_RUNS = 12
"""Rows of a byte map that are shown; the others are counted, and JSON has them all."""

_MOST_CHANGES = 20

_COLUMNS = (
    Column("Bytes", right=True),
    Column("A writes", shortest=14, identifier=True),
    Column("B reads", shortest=14, identifier=True),
)
_OF_ADDRESS = {"list_id", "protocol", "port"}
_SETTINGS = {
    "list_id": "list identifier",
    "protocol": "protocol",
    "port": "port",
    "address": "address",
    "pack": "packed",
    "checksum": "checksum",
    "acknowledge": "acknowledgement",
    "cyclic": "sent cyclically",
    "on_change": "sent on change",
    "on_event": "sent on an event",
    "interval_ns": "interval",
    "min_gap_ns": "minimum gap",
}

_UNKNOWN = "not known to be the same"
_VERDICTS = {
    True: Cell("same on the wire", Tone.GOOD),
    False: Cell("different", Tone.ERROR),
    None: Cell(_UNKNOWN, Tone.WARNING),
}

Row = Mapping[str, Any]


def render(document: Row, *, colour: bool = False, width: int = 80, wide: bool = False) -> str:
    """Return a comparison (schema ``nvscope.diff/2``) as text of at most ``width`` columns."""
    return paint(_lines(visible_document(document), max(width, MIN_WIDTH), wide), colour=colour)


def _lines(document: Row, width: int, wide: bool) -> Iterator[Line]:
    for entry in document["lists"]:
        yield from _list_lines(entry, width, wide)
        yield []
    for side, entries in (("A", document["only_a"]), ("B", document["only_b"])):
        for entry in entries:
            text = f": only {side} has it ({entry['file']}, line {entry['line']})."
            yield from wrap([Cell(_title(entry), Tone.STRONG), Cell(text, Tone.WARNING)], width, 0, 2)
        if entries:
            yield []
    same = document["same_on_wire"]
    if same:
        yield from wrap([Cell("Same on the wire", Tone.GOOD), Cell(f": {_lists(document)}.")], width)
        return
    bad, unknown = (sum(entry["same_on_wire"] is answer for entry in document["lists"]) for answer in (False, None))
    alone = len(document["only_a"]) + len(document["only_b"])
    parts = [f"{bad} of {_lists(document)}"] * bool(bad)
    parts += [f"{count_of(alone, 'list')} on one side only"] * bool(alone)
    told = f"{unknown} of {_lists(document)}" if same is None else f"{count_of(unknown, 'list')} {_UNKNOWN}"
    parts += [told] * bool(unknown)
    head = Cell("Different on the wire", Tone.ERROR) if same is False else Cell(_UNKNOWN.capitalize(), Tone.WARNING)
    yield from wrap([head, Cell(f": {', '.join(parts)}.")], width)


def _lists(document: Row) -> str:
    return f"{count_of(len(document['lists']), 'list')} that both sides have"


def _title(entry: Row) -> str:
    return f"{entry['name']} ({list_and_port(entry)})"


def _list_lines(entry: Row, width: int, wide: bool) -> Iterator[Line]:
    verdict = _VERDICTS[entry["same_on_wire"]]
    identical = Cell(", nothing differs." if entry["identical"] else ".")
    yield from wrap([Cell(_title(entry["a"]), Tone.STRONG), Cell(": "), verdict, identical], width, 0, 2)
    for side in ("A", "B"):
        own = entry[side.lower()]
        yield from wrap([Cell(f"{side}: {own['name']} in {own['file']}, line {own['line']}", Tone.FAINT)], width, 2, 5)
    for setting in entry["settings"]:
        name = _SETTINGS.get(setting["setting"], setting["setting"])
        values = [_setting(setting["setting"], setting[side], entry[side]) for side in ("a", "b")]
        yield from wrap([Cell(f"{name}: A {values[0]}, B {values[1]}")], width, 2, 4)
    if _OF_ADDRESS & {setting["setting"] for setting in entry["settings"] if None not in (setting["a"], setting["b"])}:
        text = "A reader of B gets none of A's telegrams"
        text += "; what follows is how it would read them." if entry["telegrams"] else "."
        yield from wrap([Cell(text, Tone.ERROR)], width, 2, 4)
    changes = entry["variables"]
    for change in changes[:_MOST_CHANGES]:
        yield from wrap([Cell(_change(change))], width, 2, 4)
    if len(changes) > _MOST_CHANGES:
        yield [Cell(f"  and {count_of(len(changes) - _MOST_CHANGES, 'more variable')}", Tone.FAINT)]
    if not entry["identical"]:
        on_can = entry["a"]["port"] is None
        yield from _telegram_lines(entry["telegrams"], width, wide, on_can=on_can)


def _setting(name: str, value: Any, side: Row) -> str:
    if value is None:
        return "not said"
    if name == "list_id":
        return identifier_of(side)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return duration(value) if name.endswith("_ns") else str(value)


def _change(change: Row) -> str:
    name, a, b = change["name"], change["a"], change["b"]
    if change["change"] == "added":
        return f"{name} : {b}: only B has it"
    if change["change"] == "removed":
        return f"{name} : {a}: only A has it"
    if change["change"] == "renamed":
        return f"{a}: called {b} in B"
    if change["change"] == "moved":
        return f"{name} has moved: {a} in A, {b} in B"
    return f"{name}: {a or 'nothing more'} in A, {b or 'nothing more'} in B"


def _telegram_lines(telegrams: list[Row], width: int, wide: bool, *, on_can: bool) -> Iterator[Line]:
    """Yield the telegrams; those that are the same as one line."""
    same = [telegram for telegram in telegrams if _plain(telegram)]
    if same:
        text = f"{_places(same, on_can=on_can)}: every byte is the same on both sides."
        yield from wrap([Cell(text)], width, 2, 4)
    for telegram in telegrams:
        if not _plain(telegram):
            yield []
            place = Cell(f"{_places([telegram], on_can=on_can)}: ", Tone.STRONG)
            yield from wrap([place, *_verdict(telegram, on_can=on_can)], width, 2, 4)
            yield from _map_lines(telegram, width, wide)


def _places(telegrams: list[Row], *, on_can: bool) -> str:
    """Return which telegrams these are: by their COB-IDs on CAN, where these are known, else by their SubIndexes."""
    cob_ids = [telegram["cob_id"] for telegram in telegrams if telegram["cob_id"] is not None]
    if cob_ids:
        return f"COB-ID {', '.join(ranges(cob_ids, cob_id))}"
    subindexes = ", ".join(ranges([telegram["subindex"] for telegram in telegrams]))
    return f"Frame {subindexes}, counted from 0" if on_can else f"SubIndex {subindexes}"


def _plain(telegram: Row) -> bool:
    return telegram["same"] is True and all(run["relation"] == "same" for run in telegram["bytes"])


def _verdict(telegram: Row, *, on_can: bool) -> list[Cell]:
    a, b = telegram["a"], telegram["b"]
    shape = _dlc if on_can else _shape
    for side, own in (("A", a), ("B", b)):
        if own is not None and own["unknown"]:
            what = "lies in frames" if on_can else "has"
            text = f"nobody knows how {'' if on_can else 'many bytes '}{own['unknown']} {what} in {side}."
            return [Cell(text, Tone.WARNING), Cell(" From it on, nothing can be compared.")]
    if b is None:
        return [Cell("B does not have it", Tone.ERROR), Cell(f"; A sends {shape(a)}. A reader of B drops it.")]
    if a is None:
        return [
            Cell("A does not send it", Tone.ERROR),
            Cell(f"; B waits for {shape(b)}, and its values never change."),
        ]
    if not telegram["accepted"]:
        text = f": A sends {shape(a)}, B expects {shape(b)}."
        return [Cell("not accepted", Tone.ERROR), Cell(text)]
    if telegram["same"]:
        return [Cell("accepted", Tone.GOOD), Cell(f" ({shape(a)}), every value is right; only names differ.")]
    return [Cell("accepted, and misread", Tone.ERROR), Cell(f": both have {shape(a)}, but not the same variables.")]


def _shape(side: Row) -> str:
    items, length = ("?" if side[key] is None else side[key] for key in ("items", "length"))
    return f"Items {items}, Length {length}"


def _dlc(side: Row) -> str:
    return f"DLC {'?' if side['length'] is None else side['length']}"


def _map_lines(telegram: Row, width: int, wide: bool) -> Iterator[Line]:
    if telegram["a"] is None or telegram["b"] is None:
        return
    runs = telegram["bytes"]
    rows = [_row(run) for run in runs[:MOST_RUNS]]
    if rows:
        yield from align(_COLUMNS, rows, None if wide else width, 4)
    if len(runs) > MOST_RUNS:
        rest = f"{count_of(len(runs) - MOST_RUNS, 'more row')}, up to byte {count(runs[-1]['last'])}"
        yield from wrap([Cell(f"{rest}: --json shows all.", Tone.FAINT)], width, 4)


def _row(run: Row) -> list[Cell]:
    places = str(run["first"]) if run["first"] == run["last"] else f"{run['first']}–{run['last']}"
    if run["relation"] == "same":
        return [Cell(places), Cell(_part(run["a"]), Tone.FAINT), Cell("the same", Tone.FAINT)]
    tone = Tone.PLAIN if run["relation"] == "renamed" else Tone.ERROR
    return [Cell(places), Cell(_part(run["a"])), Cell(_part(run["b"]), tone)]


def _part(part: Row | None) -> str:
    if part is None:
        return "nothing"
    kind = f" : {part['type']}" if part["type"] else ""
    if part["count"] == 1:
        return f"{part['first']}{kind}"
    root, bracket, _ = part["first"].rpartition("[")
    last, _, index = part["last"].rpartition("[")
    if bracket and root == last and index.endswith("]"):
        return f"{part['first']} … [{index}{kind}"
    return f"{part['first']} … {part['last']}{kind} ({part['count']} items)"
