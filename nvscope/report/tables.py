"""The tables of a report for people: which columns there are, and what stands in them for a list, a stream, a node.

Takes parts of the report of schema ``nvscope.report/1``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from nvscope import units
from nvscope.report.content import Clock, Report, Row, findings_by_list, nanoseconds, node_names, status, worst
from nvscope.tracker.figures import DIAGNOSIS
from nvscope.tracker.jitter import Jitter
from nvscope.view.lines.table import NO_BREAK, Cell, Column, Tone

NOTHING = "-"


@dataclass(frozen=True, slots=True)
class Measure:
    """A column of a table and what stands in it for one row; ``identifier`` marks addresses, keys and names."""

    column: Column
    cell: Callable[[Any], Cell]
    identifier: bool = False


def overview(report: Report) -> tuple[list[Measure], list[Row]]:
    """Return columns and rows of the table of lists."""
    by_list, names = findings_by_list(report["findings"]), node_names(report)
    rows: list[Row] = [
        {
            **entry,
            "worst": worst(by_list.get(entry["key"], ())),
            "from": _first_of(entry["senders"], names),
            "to": _first_of(entry["readers"], names),
        }
        for entry in report["lists"]
    ]
    return used(_OVERVIEW, rows), rows


def streams(entry: Row) -> tuple[list[Measure], list[Row]]:
    """Return columns and rows of the table of a list's streams: what was counted."""
    return used(_STREAMS, entry["streams"]), entry["streams"]


def intervals(entry: Row) -> tuple[list[Measure], list[Row]]:
    """Return columns and rows of the table of a list's streams: how regularly they were sent."""
    rows: list[Row] = [
        {**stream, **stream["interval_ns"]} for stream in entry["streams"] if stream["interval_ns"]["count"]
    ]
    return used(_INTERVALS, rows), rows


def cells(measures: Sequence[Measure], row: Row) -> list[Cell]:
    """Return one row of a table."""
    return [measure.cell(row) for measure in measures]


def used(measures: Sequence[Measure], rows: Sequence[Row]) -> list[Measure]:
    """Return the columns in which at least one row has something to say."""
    return [measure for measure in measures if any(measure.cell(row).text != NOTHING for row in rows)]


_IEC_TYPE = {16: "UINT", 32: "UDINT"}


def diagnosis_rows(diags: Sequence[Row], clock: Clock) -> list[list[Cell]]:
    """Return a NetVarUDPDiagStruct table: a row for each component, a column for each of ``diags``.

    Below times stand the IEC times since the start, below counters that have wrapped what the controller shows.
    """
    rows = []
    for counter in DIAGNOSIS:
        values = [diag[counter.name] for diag in diags]
        label = Cell(counter.name)
        below: list[Cell] = []
        if counter.unit == "time":
            times = [nanoseconds(value) for value in values]
            rows.append([label, *(_known(time, clock.moment, NOTHING) for time in times)])
            below = [Cell("  since start", Tone.FAINT), *(_known(time, clock.since_start, "") for time in times)]
        elif counter.width_bits:
            rows.append([label, *(count_cell(value) for value in values)])
            below = [Cell(f"  as {_IEC_TYPE[counter.width_bits]}", Tone.FAINT)]
            below += (_wrapped(value, 1 << counter.width_bits) for value in values)
        else:
            rows.append([label, *(_error_name(value) for value in values)])
        if any(cell.text for cell in below[1:]):
            rows.append(below)
    return rows


def counter_parts(entry: Row) -> tuple[list[str], list[str]]:
    """Return the counters of a list that have counted, each with its number, and the names of those that have not."""
    counters = dict(entry["counters"])
    # Where they are believed, what the counters claim is what was lost.
    claimed, unknown = counters.pop("lost_claimed"), counters["lost"] is None and entry["transport"] == "udp"
    told = [f"{name}{NO_BREAK}{units.count(number)}" for name, number in counters.items() if number]
    if unknown:
        told.insert(0, f"lost{NO_BREAK}? ({units.count(claimed)}{NO_BREAK}claimed)")
    return told, [name for name, number in counters.items() if not number and not (unknown and name == "lost")]


def _known(time_ns: int | None, told: Callable[[int], str], otherwise: str) -> Cell:
    return Cell(otherwise, Tone.FAINT) if time_ns is None else Cell(told(time_ns))


def _wrapped(number: int, modulus: int) -> Cell:
    return Cell(units.count(number % modulus) if number >= modulus else "")


def _first_of(addresses: Sequence[str], names: Mapping[str, str]) -> str:
    if not addresses:
        return NOTHING
    first = names.get(addresses[0], addresses[0])
    return first if len(addresses) == 1 else f"{first} +{len(addresses) - 1}"


def _text(value: object, tone: Tone = Tone.PLAIN) -> Cell:
    return Cell(NOTHING, Tone.FAINT) if value is None or value in ("", NOTHING) else Cell(str(value), tone)


def count_cell(number: int | None, tone: Tone = Tone.PLAIN) -> Cell:
    """Return a counter: zero is faint, more has the tone given (less is not bad: it evens out elsewhere)."""
    if number is None:
        return Cell(NOTHING, Tone.FAINT)
    return Cell(units.count(number), tone if number > 0 else Tone.PLAIN if number else Tone.FAINT)


def duration_cell(duration_ns: int | None, tone: Tone = Tone.PLAIN) -> Cell:
    """Return a duration as people read it, nothing where there is none."""
    return Cell(NOTHING, Tone.FAINT) if duration_ns is None else Cell(units.duration(duration_ns), tone)


def _error_name(name: object) -> Cell:
    return _text(name, Tone.FAINT if name == "NOERROR" else Tone.ERROR)


def _last_error(diag: Row) -> Cell:
    return _error_name(diag["sLastError"] if diag["nErrorCount"] else None)


def _checksum(value: object) -> Cell:
    return Cell(f"0x{value:02x}") if isinstance(value, int) else _text(value)


def _name(row: Row) -> Cell:
    """Return the name of a list, or what CANopen uses its identifier for."""
    return _text(row["name"]) if row["name"] else _text(row.get("canopen"), Tone.FAINT)


def _spread(durations_ns: Sequence[int]) -> Cell:
    """Return the lower median, or the extremes where they are more than a tenth apart."""
    if not durations_ns:
        return Cell(NOTHING, Tone.FAINT)
    ordered = sorted(durations_ns)
    if ordered[0] >= 0 and ordered[-1] * 10 <= ordered[0] * 11:
        return duration_cell(ordered[(len(ordered) - 1) // 2])
    return Cell(f"{units.duration(ordered[0])} … {units.duration(ordered[-1])}")


def _lost(row: Row) -> Cell:
    """Return what was lost of a list or a stream; nobody knows it of a sender that does not count."""
    if row["lost"] is None and row["lost_claimed"] is not None:
        return Cell("?", Tone.FAINT)
    return count_cell(row["lost"], Tone.ERROR)


def _interval(entry: Row) -> Cell:
    """Return at which interval a list is sent, measured; marked where a definition says otherwise."""
    known = [stream["interval_ns"] for stream in entry["streams"] if stream["interval_ns"]["count"]]
    regular = [interval for interval in known if interval["nominal"] is not None]
    if known and not regular:
        return Cell("on change", Tone.FAINT)
    told = _spread([interval["p50"] for interval in regular if interval["p50"] is not None])
    return Cell(told.text, Tone.WARNING) if any(map(_departs, regular)) else told


def _defined(entry: Row) -> Cell:
    """Return the interval of the definition where the list is sent at another one."""
    intervals = [stream["interval_ns"] for stream in entry["streams"]]
    return _spread([interval["nominal"] for interval in intervals if _departs(interval)])


def _departs(interval: Row) -> bool:
    """Tell whether the median is further from the nominal interval than a tenth of it: then a definition gave that."""
    if not interval["nominal"] or interval["p50"] is None:
        return False
    return bool(10 * abs(interval["p50"] - interval["nominal"]) > interval["nominal"])


def _median(entry: Row) -> Cell:
    """Return the median interval of a list without a nominal one; elsewhere it is the interval."""
    if all(stream["interval_ns"]["nominal"] for stream in entry["streams"]):
        return Cell(NOTHING, Tone.FAINT)
    medians = [stream["interval_ns"]["p50"] for stream in entry["streams"]]
    return _spread([median for median in medians if median is not None])


def _jitter(entry: Row) -> Cell:
    """Return the jitter of the list's worst stream."""
    intervals = (stream["interval_ns"] for stream in entry["streams"])
    found = [Jitter.of(interval["p50"], interval["p99"], interval["nominal"]) for interval in intervals]
    worst_of_all = max((one for one in found if one is not None), key=lambda one: one.percent, default=None)
    return Cell(NOTHING, Tone.FAINT) if worst_of_all is None else Cell(worst_of_all.text)


_OVERVIEW = (
    Measure(Column("status"), lambda row: status(row["worst"])),
    Measure(Column("list", shortest=16), lambda row: _text(row["key"], Tone.STRONG), identifier=True),
    Measure(Column("name", importance=7, shortest=12), _name, identifier=True),
    Measure(Column("sender", shortest=16), lambda row: _text(row["from"]), identifier=True),
    Measure(Column("reader", importance=1, shortest=16), lambda row: _text(row["to"]), identifier=True),
    Measure(Column("interval", right=True, importance=9), _interval),
    Measure(Column("defined", right=True, importance=9), _defined),
    Measure(Column("median", right=True, importance=2), _median),
    Measure(Column("jitter", right=True, importance=4), _jitter),
    Measure(Column("sent", right=True, importance=10), lambda row: count_cell(row["diag"]["nSendCount"])),
    Measure(Column("lost", right=True, importance=10), lambda entry: _lost(entry["counters"])),
    Measure(
        Column("no ack", right=True, importance=8),
        lambda row: count_cell(row["counters"]["missing_acknowledgements"], Tone.ERROR),
    ),
    Measure(Column("errors", right=True, importance=5), lambda row: count_cell(row["diag"]["nErrorCount"], Tone.ERROR)),
    Measure(Column("last error", importance=3), lambda row: _last_error(row["diag"])),
)

_STREAM = (
    Measure(Column("node", shortest=12), lambda row: _text(row["node"]), identifier=True),
    Measure(Column("sub", right=True), lambda row: Cell(str(row["subindex"]))),
)

_STREAMS = (
    *_STREAM,
    Measure(Column("telegrams", right=True), lambda row: count_cell(row["telegrams"])),
    Measure(Column("lost", right=True), _lost),
    Measure(Column("dup", right=True, importance=6), lambda row: count_cell(row["duplicates"], Tone.WARNING)),
    Measure(Column("overtaken", right=True, importance=5), lambda row: count_cell(row["overtaken"], Tone.WARNING)),
    Measure(Column("restarts", right=True, importance=4), lambda row: count_cell(row["restarts"], Tone.WARNING)),
    Measure(Column("items", right=True, importance=3), lambda row: _text(row["items"])),
    Measure(Column("length", right=True, importance=3), lambda row: _text(row["length"])),
    Measure(Column("checksum", right=True, importance=2), lambda row: _checksum(row["checksum"])),
    Measure(Column("counter", importance=1), lambda row: _text(row["counter_scope"])),
)

_INTERVALS = (
    *_STREAM,
    Measure(Column("nominal", right=True, importance=8), lambda row: duration_cell(row["nominal"])),
    Measure(Column("min", right=True, importance=6), lambda row: duration_cell(row["min"])),
    Measure(
        Column("p50", right=True, importance=9),
        lambda row: duration_cell(row["p50"], Tone.WARNING if _departs(row) else Tone.PLAIN),
    ),
    Measure(Column("p95", right=True, importance=3), lambda row: duration_cell(row["p95"])),
    Measure(Column("p99", right=True, importance=7), lambda row: duration_cell(row["p99"])),
    Measure(Column("max", right=True, importance=9), lambda row: duration_cell(row["max"])),
    Measure(Column("mean", right=True, importance=5), lambda row: duration_cell(row["mean"])),
    Measure(Column("stddev", right=True, importance=4), lambda row: duration_cell(row["stddev"])),
    Measure(Column("count", right=True, importance=2), lambda row: count_cell(row["count"])),
)
