"""Requests that were answered, a line each, and all of them in a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nvscope import units
from nvscope.report.ansi import paint
from nvscope.report.sdo import value_text
from nvscope.units import clock_time, count_of, duration
from nvscope.view.escape import visible_document
from nvscope.view.lines.table import Cell, Line, Tone

_VERBS = {"ODReadRequest": "read ", "ODWriteRequest": "write"}


def render(row: Mapping[str, Any], *, colour: bool = False, utc: bool = False) -> str:
    """Return a request as a line, ending with a line break."""
    return paint([_line(visible_document(row), utc)], colour=colour)


def _line(row: Mapping[str, Any], utc: bool) -> Line:
    place = units.parameter(row["index"], row["subindex"])
    name = f"{row['name']} ({place})" if row["name"] else place
    return [
        Cell(f"{clock_time(row['time_ns'], utc=utc)}  ", Tone.FAINT),
        Cell(f"{units.endpoint(row['address'], row['port'])}  {_VERBS[row['request']]} {name}  "),
        *_outcome(row),
        *([Cell(f"  {duration(row['delay_ns'])} later", Tone.FAINT)] if row["delay_ns"] else ()),
    ]


def _outcome(row: Mapping[str, Any]) -> Line:
    if row["result"] == "silent":
        return [Cell("! not answered", Tone.WARNING)]
    if row["result"] == "busy":
        return [Cell(f"! {row['answer']}", Tone.WARNING)]
    if row["result"] == "refused":
        wanted = f" {value_text(row['wanted'])}" if row["wanted"] else ""
        return [Cell(f"✗ {row['answer']}", Tone.ERROR), Cell(wanted, Tone.FAINT)]
    if row["request"] == "ODReadRequest":
        return [Cell(value_text(row["after"]), Tone.STRONG)]
    told = [Cell(f"{value_text(row['before'])} → "), Cell(value_text(row["after"]), Tone.STRONG)]
    if row["wanted"] and row["wanted"]["bytes"] != row["after"]["bytes"]:
        told.append(Cell(f"  ! stuck: {value_text(row['wanted'])} was to be written", Tone.WARNING))
    return told


def summary(counts: Mapping[str, int], ignored: Mapping[str, int]) -> str:
    """Return how many requests there were and what became of them, in a sentence without its full stop."""
    told = [count_of(counts["requests"], "request")]
    told += [f"{units.count(counts[result])} {word}" for result, word in _RESULTS.items() if counts[result]]
    text = ", ".join(told)
    if ignored:
        parts = ", ".join(f"{units.count(number)} {reason}" for reason, number in sorted(ignored.items()))
        text += f"; ignored: {parts}"
    return text


_RESULTS = {
    "replied": "answered", "refused": "refused", "busy": "busy", "silent": "not answered",
}  # fmt: skip
