"""Questions about variables: their values in the end, at a time, and one after the other."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from nvscope.errors import ExitCode
from tests.fuzz.asked import READ, Asked

TIMES = ("0s", "5s", "-2s", "#1", "#7", "-0.001s", "00:00:01", "2026-01-31 08:00:01.5Z", "100000h", "#999999999")

Key = tuple[str, str, int]
"""List, sender and SubIndex."""


def ask_variables(asked: Asked, report: Any) -> list[dict[str, Any]] | None:
    """Return the rows of ``vars``, those of earlier shapes behind them; None where no list is defined."""
    rng = asked.rng
    asked.on_capture("vars")
    ran = asked.on_capture("vars", "--json")
    if ran.code not in READ:
        assert ran.code == ExitCode.USAGE, ran
        return None
    document = ran.document()
    rows: list[dict[str, Any]] = document["variables"]
    earlier: list[dict[str, Any]] = document.get("earlier", [])
    streams = {
        (entry["key"], stream["node"], stream["subindex"]): stream["telegrams"]
        for entry in report["lists"]
        for stream in entry["streams"]
    }
    for row in rows:
        if row["sender"] is not None:
            assert row["telegrams"] <= streams[row["list"], row["sender"], row["subindex"]]
            assert row["changes"] <= max(row["telegrams"] - 1, 0)
    asked.answered.decoded = sum(telegrams_of(rows + earlier).values())
    inside = [row for entry in report["lists"] for row in entry.get("values") or ()]
    assert (
        [{name: row[name] for name in inside[0]} for row in rows if row["sender"] is not None]
        == [row for row in inside if row["sender"] is not None]
        if inside
        else True
    )
    _ask_moment(asked, rows, report)
    if rows:
        _ask_history(asked, rng.choice(rows), rows)
    return rows + earlier


def telegrams_of(rows: Sequence[Mapping[str, Any]]) -> dict[Key, int]:
    """Return how many telegrams were decoded, of each shape that many for each variable in them."""
    shapes: dict[tuple[Key, str], int] = {}
    for row in rows:
        if row["sender"] is not None:
            key = row["list"], row["sender"], row["subindex"]
            assert shapes.setdefault((key, row["last_ns"]), row["telegrams"]) == row["telegrams"]
    found: dict[Key, int] = defaultdict(int)
    for (key, _), telegrams in shapes.items():
        found[key] += telegrams
    return found


def values_of(rows: Sequence[Mapping[str, Any]]) -> dict[Key, int]:
    """Return how many values the telegrams had that were decoded."""
    found: dict[Key, int] = defaultdict(int)
    for row in rows:
        if row["sender"] is not None and row["telegrams"]:
            found[row["list"], row["sender"], row["subindex"]] += row["telegrams"]
    return found


def _ask_moment(asked: Asked, rows: Sequence[Mapping[str, Any]], report: Any) -> None:
    asked.on_capture("vars", "--at", asked.rng.choice(TIMES), *asked.rng.choice(((), ("--json",), ("--utc",))))
    frames = report["capture"]["frames"]
    if not frames:
        return
    last = asked.on_capture("vars", "--at", f"#{frames}", "--json")
    assert last.code in READ, last
    # A variable that nobody has sent has no frame, in ``vars`` no row.
    sent = [row for row in last.document()["variables"] if row["frame"] is not None]
    assert _values_of(sent) == _values_of(rows)


def _values_of(rows: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str, str], Any]:
    return {(row["list"], row["sender"], row["name"]): (row["value"], row["text"]) for row in rows}


def _ask_history(asked: Asked, row: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> None:
    name, key = row["name"], row["list"]
    listed = ("--list", row["list_name"])
    asked.on_capture("vars", "--history", name, *listed)
    ran = asked.on_capture("vars", "--history", name, "--all", "--json", *listed)
    if ran.code not in READ:
        return  # the name of a list may be another's identifier, or none that can be typed
    told = Counter((one["list"], one["sender"], one["name"]) for one in ran.document()["changes"] if one["list"] == key)
    # What nobody has described has one name in all telegrams of its list.
    wanted: Counter[tuple[str, str, str]] = Counter()
    for one in rows:
        if one["list"] == key and one["name"] == name:
            wanted[one["list"], one["sender"], one["name"]] += one["telegrams"]
    assert +wanted <= told, (wanted, told)
