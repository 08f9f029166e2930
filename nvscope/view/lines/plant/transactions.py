"""The table of pairs: who asks whom, how often, how long replies take; and what a pair has said of late.

Takes the rows of ``nvscope.watch/1`` and of transactions. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nvscope import units
from nvscope.findings.kind import Severity
from nvscope.view.lines.plant.content import Clock, Row
from nvscope.view.lines.plant.happenings import symbol
from nvscope.view.lines.plant.tables import Measure, count_cell, duration_cell, used, with_port
from nvscope.view.lines.table import NOTHING, Cell, Column, Line, Tone, wrap
from nvscope.view.lines.text_width import display_width

NOTHING_YET = "Nothing was read yet."
NO_TRANSACTIONS = "No Parameter Manager and no WebVisu was heard: nobody asks a controller for anything."
ADVICE = (
    "Parameter Manager: telegrams as of network variables, over UDP. Where they do not begin with 3S-0, "
    "`-d udp.port==PORT,nvl` names their port.",
    "WebVisu: pages that poll over TCP ports 80 and 8080, in clear; `-d tcp.port==PORT,http` names others. HTTPS "
    "(port 443) cannot be read. Of an interface, only `-f ''` or a filter that lets TCP in shows them.",
    "What two others say to each other is heard at a mirror port, or on one of the two.",
)
"""What to check where there are none."""

_TROUBLE = ("refused", "odd")
_MOST_SAID = 20
_S_NS = 1_000_000_000
_TONES = {
    "answered": Tone.FAINT, "confirmed": Tone.GOOD, "refused": Tone.ERROR, "unanswered": Tone.ERROR,
    "status": Tone.ERROR, "open": Tone.PLAIN,
}  # fmt: skip


def severity_of_pair(row: Row) -> Severity | None:
    """Return how bad the worst is that became of requests; None where all is well."""
    if row["unanswered"]:
        return Severity.ERROR
    return Severity.WARNING if any(row[name] for name in _TROUBLE) else None


def pair_measures(now_ns: int, rows: Sequence[Row] = ()) -> Sequence[Measure]:
    """Return the columns of the table of pairs, as of a time; some rows tell whether that of ports has to stay."""
    measures = (
        Measure(Column(""), lambda row: symbol(severity_of_pair(row))),
        Measure(Column("via", importance=9), lambda row: Cell(row["protocol"], Tone.FAINT)),
        Measure(Column("asks", shortest=10, identifier=True), lambda row: Cell(_client(row), Tone.STRONG)),
        Measure(Column("asked", shortest=10, identifier=True), lambda row: Cell(_server(row))),
        Measure(Column("port", right=True, importance=1), lambda row: Cell(str(row["port"]))),
        Measure(Column("rate", right=True, importance=8), _rate),
        Measure(Column("requests", right=True, importance=9), lambda row: count_cell(row["requests"])),
        Measure(Column("p50", right=True, importance=4), lambda row: duration_cell(row["latency_ns"]["p50"])),
        Measure(Column("p99", right=True, importance=6), lambda row: duration_cell(row["latency_ns"]["p99"])),
        Measure(Column("max", right=True, importance=3), lambda row: duration_cell(row["latency_ns"]["max"])),
        Measure(
            Column("unanswered", right=True, importance=11), lambda row: count_cell(row["unanswered"], Tone.ERROR)
        ),
        Measure(Column("refused", right=True, importance=10), lambda row: count_cell(row["refused"], Tone.ERROR)),
        Measure(Column("odd", right=True, importance=2), lambda row: count_cell(row["odd"], Tone.WARNING)),
        Measure(Column("writes", right=True, importance=9), lambda row: count_cell(row["writes"], Tone.NOTE)),
        Measure(Column("last write", shortest=24, importance=7, verbatim=True), _last_write),
        Measure(Column("ago", right=True, importance=5), lambda row: _ago(row, now_ns)),
    )  # fmt: skip
    return with_port(measures, rows, ("via", "asks", "asked"))


def pair_table(rows: Sequence[Row], now_ns: int) -> tuple[list[Measure], Sequence[Row]]:
    """Return the table of pairs where nobody sorts it: the worst first; without the columns that say nothing."""
    return used(pair_measures(now_ns, rows), rows), sorted(rows, key=lambda row: -(severity_of_pair(row) or 0))


def transaction_measures(clock: Clock) -> Sequence[Measure]:
    """Return the columns of the table of the transactions of a pair."""
    return (
        Measure(Column("time", importance=7), lambda row: Cell(clock.moment(int(row["time_ns"])), Tone.FAINT)),
        Measure(Column("", importance=9), _operation),
        Measure(Column("what", shortest=14, verbatim=True), lambda row: Cell(what(row))),
        Measure(Column("outcome", shortest=10, importance=10), _outcome),
        Measure(Column("took", right=True, importance=8), lambda row: duration_cell(row["latency_ns"])),
        Measure(Column("frame", right=True, importance=6), lambda row: Cell(units.count(row["frame"]), Tone.FAINT)),
    )


def _client(row: Row) -> str:
    return str(row["client_name"] or row["client"])


def _server(row: Row) -> str:
    return str(row["server_name"] or row["server"])


def _rate(row: Row) -> Cell:
    return Cell(units.rate(row["per_s"])) if row["per_s"] else Cell(NOTHING, Tone.FAINT)


def _last_write(row: Row) -> Cell:
    last = row["last_write"]
    if last is None:
        return Cell(NOTHING, Tone.FAINT)
    tone = _TONES.get(last["outcome"], Tone.WARNING)
    # In front: a long value is cut at its end.
    became = "" if last["outcome"] == "confirmed" else f"{last['outcome']}: "
    return Cell(f"{became}{what(last)}", tone if tone in (Tone.ERROR, Tone.WARNING) else Tone.PLAIN)


def _ago(row: Row, now_ns: int) -> Cell:
    last = row["last_write"]
    if last is None:
        return Cell(NOTHING, Tone.FAINT)
    passed_s = max(now_ns - int(last["time_ns"]), 0) // _S_NS
    return Cell(f"{passed_s} s" if passed_s < 60 else units.duration(passed_s * _S_NS))


def _operation(row: Row) -> Cell:
    return Cell(row["operation"], Tone.NOTE if row["operation"] == "write" else Tone.FAINT)


def _outcome(row: Row) -> Cell:
    detail = (row["detail"] or "").removeprefix("ODError").removeprefix("Reply").replace("HTTP status", "HTTP")
    tone, outcome = _TONES.get(row["outcome"], Tone.WARNING), row["outcome"]
    if detail and outcome == "status":  # the detail says that
        return Cell(detail, tone)
    return Cell(f"{outcome}: {detail}" if detail else outcome, tone)


def ends(row: Row) -> str:
    """Return who asks whom, and where."""
    return f"{_client(row)} → {units.endpoint(_server(row), row['port'])}"


def told_of(row: Row, room: int) -> str:
    """Return what the replies of a pair come to, in so many columns: figures are left out whole."""
    took, replies = row["latency_ns"], units.count_of(row["replies"], "reply", "replies")
    for names in (("p50", "p99", "max"), ("p50", "max"), ("max",)):
        known = [f"{name} {units.duration(took[name])}" for name in names if took["count"] and took[name] is not None]
        told = "  ".join([replies, ", ".join(known)] if known else [replies])
        if display_width(told) <= room:
            return told
    return replies if display_width(replies) <= room else ""


def what(row: Row) -> str:
    """Return what was asked for and said: ``rSpeed 21.5 → 30``, or ``rSpeed = 30; 4,0,2,1 = ???; … 5 more``."""
    if row["operation"] == "unknown":
        return "never sent whole"
    said: Sequence[Mapping[str, Any]] = row["variables"]
    shown = [_said(one, writes=row["operation"] == "write") for one in said[:_MOST_SAID]]
    if more := len(said) - len(shown) + row["left_out"]:
        shown.append(f"… {units.count(more)} more")
    # What has no name is called by four numbers with commas between.
    return "; ".join(shown)


def _said(one: Mapping[str, Any], *, writes: bool) -> str:
    if one["value"] is None:
        return str(one["name"])
    if not writes:
        return f"{one['name']} = {one['value']}"
    return f"{one['name']} {'' if one['old'] is None else one['old'] + ' '}→ {one['value']}"


def nothing_lines(told: str, width: int) -> list[Line]:
    """Return what is said where there are no pairs, and what to check."""
    lines = wrap([Cell("● ", Tone.FAINT), Cell(told, Tone.STRONG)], width, hanging=2)
    for step in ADVICE:
        lines += [[], *wrap([Cell(f"- {step}")], width, 2, 4)]
    return lines
