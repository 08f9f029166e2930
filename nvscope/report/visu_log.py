"""Requests that a WebVisu answered, a line each, and all of them in a sentence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from nvscope import units
from nvscope.report.ansi import paint
from nvscope.tracker.readings.form import HIDDEN
from nvscope.units import clock_time, count_of, duration
from nvscope.view.escape import visible_document
from nvscope.view.lines.table import Cell, Line, Tone

_LONGEST = 120


def render(row: Mapping[str, Any], *, colour: bool = False, utc: bool = False) -> str:
    """Return a request as a line, ending with a line break."""
    return paint([_line(visible_document(row), utc)], colour=colour)


def _line(row: Mapping[str, Any], utc: bool) -> Line:
    return [
        Cell(f"{clock_time(row['time_ns'], utc=utc)}  ", Tone.FAINT),
        Cell(f"{units.endpoint(row['address'], row['port'])}  "),
        *_outcome(row),
        *([Cell(f"  {duration(row['delay_ns'])} later", Tone.FAINT)] if row["delay_ns"] else ()),
    ]


def _outcome(row: Mapping[str, Any]) -> Iterator[Cell]:
    result = row["result"]
    if not row["touched"]:
        target = f"{row['method']} {_short(row['target'])}  ".lstrip()
        yield Cell(target if target.strip() else "")
        told = {"file": f"{row['status']}", "not_found": "✗ 404 not found"}.get(
            result, f"✗ {row['status']} malformed: {_short(row['why'])}"
        )  # fmt: skip
        yield Cell(told, Tone.PLAIN if result == "file" else Tone.ERROR)
        return
    yield Cell("write " if row["writes"] else "read  ")
    for place, one in enumerate(row["variables"]):
        if place:
            yield Cell(", ")
        yield from _variable(one, row)
    if (more := row["touched"] - len(row["variables"])) > 0:
        yield Cell(f" and {units.count(more)} more", Tone.FAINT)
    if row["declared"] != row["touched"]:
        yield Cell(f"  ! declares {row['declared']}", Tone.WARNING)
    if result in ("silent", "dropped"):
        yield Cell("  ! not answered" if result == "silent" else "  ! connection ended", Tone.WARNING)
    elif result == "refused":
        yield Cell(f"  ✗ {row['status']} refused" if row["status"] != 200 else "  ✗ refused", Tone.ERROR)


def _variable(one: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[Cell]:
    yield Cell(_short(one["name"]))
    if row["writes"]:
        yield from _written(one, row)
    elif row["result"] == "answered":
        yield Cell(" = ")
        yield Cell(_value(one, "before"), Tone.STRONG if one["is_read"] else Tone.WARNING)


def _written(one: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[Cell]:
    if row["result"] != "answered":
        wanted = _value(one, "wanted") if one["secret"] or one["wanted"] is not None else ""
        yield Cell(f" := {wanted}" if wanted else "", Tone.FAINT)
        return
    yield Cell(f"  {_value(one, 'before')} → ")
    yield Cell(_value(one, "after"), Tone.STRONG)
    if one["is_stuck"]:
        yield Cell(f"  ! stuck: {_value(one, 'wanted')} was to be written", Tone.WARNING)


def _value(one: Mapping[str, Any], key: str) -> str:
    if one["secret"]:
        return HIDDEN
    return "???" if one[key] is None else _short(one[key])


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


def summary(counts: Mapping[str, int], ignored: Mapping[str, int]) -> str:
    """Return how many requests there were and what became of them, in a sentence without its full stop."""
    told = [count_of(counts["requests"], "request")]
    told += [f"{units.count(counts[result])} {word}" for result, word in _RESULTS.items() if counts[result]]
    text = ", ".join(told)
    if ignored:
        parts = ", ".join(f"{units.count(number)} {reason}" for reason, number in sorted(ignored.items()))
        text += f"; connections ignored: {parts}"
    return text


_RESULTS = {
    "answered": "answered", "file": "for files", "refused": "refused", "not_found": "not found",
    "malformed": "malformed", "silent": "not answered", "dropped": "dropped",
}  # fmt: skip
