"""Two definitions compared, for people: what differs, and where the values of A land in B."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from nvscope.report.ansi import paint
from nvscope.units import count, count_of, duration, ranges
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

Row = Mapping[str, Any]


def render(document: Row, *, colour: bool = False, width: int = 80, wide: bool = False) -> str:
    """Return a comparison (schema ``nvscope.diff/1``) as text of at most ``width`` columns."""
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
    if document["same_on_wire"]:
        yield from wrap([Cell("Same on the wire", Tone.GOOD), Cell(f": {_lists(document)}.")], width)
    else:
        bad = sum(not entry["same_on_wire"] for entry in document["lists"])
        alone = len(document["only_a"]) + len(document["only_b"])
        parts = [f"{bad} of {_lists(document)}"] * bool(bad)
        parts += [f"{count_of(alone, 'list')} on one side only"] * bool(alone)
        yield from wrap([Cell("Different on the wire", Tone.ERROR), Cell(f": {', '.join(parts)}.")], width)


def _lists(document: Row) -> str:
    return f"{count_of(len(document['lists']), 'list')} that both sides have"


def _title(entry: Row) -> str:
    identifier = "list without identifier" if entry["id"] is None else f"list {entry['id']}"
    return f"{entry['name']} ({identifier} on {entry['protocol']} port {entry['port']})"


def _list_lines(entry: Row, width: int, wide: bool) -> Iterator[Line]:
    verdict = Cell("same on the wire", Tone.GOOD) if entry["same_on_wire"] else Cell("different", Tone.ERROR)
    identical = Cell(", nothing differs." if entry["identical"] else ".")
    yield from wrap([Cell(_title(entry["a"]), Tone.STRONG), Cell(": "), verdict, identical], width, 0, 2)
    for side in ("A", "B"):
        own = entry[side.lower()]
        yield from wrap([Cell(f"{side}: {own['name']} in {own['file']}, line {own['line']}", Tone.FAINT)], width, 2, 5)
    for setting in entry["settings"]:
        name = _SETTINGS.get(setting["setting"], setting["setting"])
        values = [_setting(setting["setting"], setting[side]) for side in ("a", "b")]
        yield from wrap([Cell(f"{name}: A {values[0]}, B {values[1]}")], width, 2, 4)
    if _OF_ADDRESS & {setting["setting"] for setting in entry["settings"] if None not in (setting["a"], setting["b"])}:
        text = "A reader of B gets none of A's telegrams; what follows is how it would read them."
        yield from wrap([Cell(text, Tone.ERROR)], width, 2, 4)
    changes = entry["variables"]
    for change in changes[:_MOST_CHANGES]:
        yield from wrap([Cell(_change(change))], width, 2, 4)
    if len(changes) > _MOST_CHANGES:
        yield [Cell(f"  and {count_of(len(changes) - _MOST_CHANGES, 'more variable')}", Tone.FAINT)]
    if not entry["identical"]:
        yield from _telegram_lines(entry["telegrams"], width, wide)


def _setting(name: str, value: Any) -> str:
    if value is None:
        return "not said"
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


def _telegram_lines(telegrams: list[Row], width: int, wide: bool) -> Iterator[Line]:
    """Yield the telegrams; those that are the same as one line."""
    same = [telegram["subindex"] for telegram in telegrams if _plain(telegram)]
    if same:
        yield from wrap(
            [Cell(f"SubIndex {', '.join(ranges(same))}: every byte is the same on both sides.")], width, 2, 4
        )
    for telegram in telegrams:
        if not _plain(telegram):
            yield []
            yield from wrap([Cell(f"SubIndex {telegram['subindex']}: ", Tone.STRONG), *_verdict(telegram)], width, 2, 4)
            yield from _map_lines(telegram, width, wide)


def _plain(telegram: Row) -> bool:
    return telegram["same"] and all(run["relation"] == "same" for run in telegram["bytes"])


def _verdict(telegram: Row) -> list[Cell]:
    a, b = telegram["a"], telegram["b"]
    if b is None:
        return [Cell("B does not have it", Tone.ERROR), Cell(f"; A sends {_shape(a)}. A reader of B drops it.")]
    if a is None:
        return [
            Cell("A does not send it", Tone.ERROR),
            Cell(f"; B waits for {_shape(b)}, and its values never change."),
        ]
    for side, own in (("A", a), ("B", b)):
        if own["unknown"]:
            text = f"nobody knows how many bytes {own['unknown']} has in {side}."
            return [Cell(text, Tone.WARNING), Cell(" What lies behind it cannot be compared.")]
    if not telegram["accepted"]:
        text = f": A sends {_shape(a)}, B expects {_shape(b)}."
        return [Cell("not accepted", Tone.ERROR), Cell(text)]
    if telegram["same"]:
        return [Cell("accepted", Tone.GOOD), Cell(f" ({_shape(a)}), every value is right; only names differ.")]
    return [Cell("accepted, and misread", Tone.ERROR), Cell(f": both have {_shape(a)}, but not the same variables.")]


def _shape(side: Row) -> str:
    length = "?" if side["length"] is None else side["length"]
    return f"Items {side['items']}, Length {length}"


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
