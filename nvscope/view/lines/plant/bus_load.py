"""How busy CAN buses are, second by second, as bars; a headline a bus; and the table of one's identifiers.

Figures come from the summary, texts from outside from the report (schema ``nvscope.report/2``), which is visible.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from nvscope import units
from nvscope.tracker.can.bus import CanBusSummary
from nvscope.tracker.can.summary import CanStreamSummary, CanSummary
from nvscope.tracker.jitter import Jitter
from nvscope.tracker.pace import PaceSeen
from nvscope.view.lines.plant import buses
from nvscope.view.lines.plant.content import Clock, Row, nanoseconds
from nvscope.view.lines.plant.tables import cells
from nvscope.view.lines.table import NOTHING, Cell, Column, Line, Tone, align, wrap

_S_NS = 1_000_000_000
_BARS = "▁▂▃▄▅▆▇█"
_PLAIN_BARS = "_.:-=+*#"
_SCALES = (1, 2, 5, 10, 20, 40, 60, 80, 100)
_LONGEST = 600
"""Strips show so many seconds at most."""

NOTHING_YET = "Nothing was read yet."
NO_CAN = (
    "No CAN here. A channel joins as one more source: can:socketcan:can0, or a log of one "
    "(candump, .asc, .blf, .trc, .mf4, .csv)."
)


class Strip(NamedTuple):
    """What came in each of the last seconds, the oldest first, None before the first; and what the unit is."""

    values: Sequence[float | None]
    is_load: bool


def strip_of(bus: CanBusSummary, pace: PaceSeen, numbers: Sequence[int], at_ns: int, seconds: int) -> Strip:
    """Return the load of the last whole seconds up to a time; without a bit rate, the frames of each.

    ``numbers`` are those of the bus's lists.
    """
    seconds = min(seconds, _LONGEST)
    stop_s = at_ns // _S_NS  # that second is not over
    if bus.load is None:
        known = [number for number in numbers if number < pace.counts.shape[1]]
        whole = pace.counts[:-1, known].sum(axis=1)[-seconds:]
        since = max(min(len(whole), pace.last_s - pace.first_s), 0)
        frames = whole[len(whole) - since :].tolist()
        return Strip([*[None] * (seconds - len(frames)), *map(float, frames)], False)
    began_s = bus.load.second_ns // _S_NS
    values = np.zeros(seconds)
    own = (began_s >= stop_s - seconds) & (began_s < stop_s)
    values[began_s[own] - (stop_s - seconds)] = bus.load.second[own]
    first = int(began_s.min()) - (stop_s - seconds) if len(began_s) else seconds
    return Strip([None if place < first else value for place, value in enumerate(values.tolist())], True)


def strip_lines(strip: Strip, limit: float, height: int, *, plain: bool = False) -> list[Line]:
    """Return a line that says what the bars are, and the bars, so many lines high.

    A second with more than ``limit`` percent of load is marked: below the bars, in a line of its own.
    """
    known = [value for value in strip.values if value is not None]
    most = max(known, default=0.0)
    if not known:
        return [[Cell("not a second of it is over", Tone.FAINT)]]
    # Another scale for every peak would make small things look large.
    top = next((one for one in _SCALES if one >= most), most) if strip.is_load else max(most, 1.0)
    full = f"{top:g} %" if strip.is_load else f"{units.count(round(top))}/s"
    what = "load" if strip.is_load else "frames (bit rate unknown: --bitrate gives it, and the load)"
    sign = (_PLAIN_BARS if plain else _BARS)[-1]
    head = [Cell(f"{what}, the last {units.count_of(len(known), 'second')}, {sign} {full}", Tone.FAINT)]
    over = [value is not None and strip.is_load and value > limit for value in strip.values]
    if any(over):
        told = f"   {units.count_of(sum(over), 'second')} above {limit:g} % (^)"
        head.append(Cell(told, Tone.WARNING))
    lines: list[Line] = [head]
    bars = _PLAIN_BARS if plain else _BARS
    for row in range(height - 1, -1, -1):
        text = "".join(_bar(value, top, row, height, bars) for value in strip.values)
        lines.append([Cell(text, Tone.NOTE)])
    if any(over):
        lines.append([Cell("".join("^" if one else " " for one in over), Tone.WARNING)])
    return lines


def _bar(value: float | None, top: float, row: int, height: int, bars: str) -> str:
    if not value:
        return " " if value is None or row else bars[0]
    # What is there is seen, however little it is.
    eighths = max(round(value / top * height * len(bars)), 1) - row * len(bars)
    return " " if eighths <= 0 else bars[min(eighths, len(bars)) - 1]


_HEADLINES = (
    Column(""), Column("bus", shortest=6, identifier=True), Column("bit rate", importance=7),
    Column("load", right=True), Column("mean", right=True, importance=5), Column("peak", right=True, importance=6),
    Column("at", importance=2), Column("frames", right=True, importance=4), Column("errors", right=True, importance=8),
    Column("controller", importance=9),
)  # fmt: skip


def headlines(rows: Sequence[Row], known: Sequence[CanBusSummary], at_ns: int, clock: Clock, chosen: int,
              width: int) -> list[Line]:  # fmt: skip
    """Return a table of all buses, a row each; ``rows`` are those of the report."""
    table = [
        _headline(row, bus, at_ns, clock, chosen=place == chosen)
        for place, (row, bus) in enumerate(zip(rows, known, strict=True))
    ]
    return align(_HEADLINES, table, width)[: len(table) + 1]


def _headline(row: Row, bus: CanBusSummary, at_ns: int, clock: Clock, *, chosen: bool) -> list[Cell]:
    rate, load, errors = row["bit_rate"], row["load"], row["errors"]
    now = now_percent(bus, at_ns)
    told = NOTHING if rate is None else f"{units.bit_rate(rate['nominal'])} {rate['source']}"
    if rate is not None and rate["data"]:
        told = f"{units.bit_rate(rate['nominal'])}/{units.bit_rate(rate['data'])} {rate['source']}"
    least = "≥ " if load and load["partial"] else ""
    return [
        Cell("▸" if chosen else " ", Tone.STRONG),
        Cell(row["channel"], Tone.STRONG if chosen else Tone.PLAIN),
        Cell(told, Tone.FAINT if rate is None else Tone.PLAIN),
        Cell(NOTHING if now is None else f"{least}{units.load(now)}"),
        Cell(f"{least}{units.load(load['mean'])}" if load else NOTHING),
        Cell(f"{least}{units.load(load['peak'])}" if load else NOTHING),
        Cell(clock.second(nanoseconds(load["peak_ns"]) or 0) if load else NOTHING, Tone.FAINT),
        Cell(units.count(row["frames"])),
        Cell(units.count(errors["frames"]), Tone.WARNING) if errors else Cell("0", Tone.FAINT),
        _controller(errors, clock),
    ]


def now_percent(bus: CanBusSummary, at_ns: int) -> float | None:
    """Return the load of the last second that is over; None where no bit rate is known, or none is over."""
    if bus.load is None:
        return None
    began_s, stop_s = bus.load.second_ns // _S_NS, at_ns // _S_NS
    if not len(began_s) or int(began_s.min()) >= stop_s:
        return None
    return float(bus.load.second[began_s == stop_s - 1].sum())


def _controller(errors: Mapping[str, Any] | None, clock: Clock) -> Cell:
    """Return how the controller is: off the bus, or what it told of itself at some time."""
    if errors is None:
        return Cell("no errors", Tone.FAINT)
    since_ns = nanoseconds(errors["bus_off"]["since_ns"])
    if since_ns is not None:
        return Cell(f"✗ off the bus since {clock.moment(since_ns)}", Tone.ERROR)
    told = []
    if errors["bus_off"]["count"]:
        told.append(f"was off the bus {units.count_of(errors['bus_off']['count'], 'time')}")
    if any(state["name"].endswith("passive") for state in errors["states"]):
        told.append("was error passive")
    elif errors["states"]:
        told.append("warned")
    return Cell(f"! {', '.join(told)}", Tone.WARNING) if told else Cell("on the bus", Tone.FAINT)


class Identifier(NamedTuple):
    """A row of the table of identifiers: its place among the bus's, and its stream, None where no frame had data."""

    place: int
    cob_id: int
    extended: bool
    frames: int
    share: float
    load: float | None
    last_ns: int
    length: int | None
    interval_ns: int | None
    jitter: Jitter | None


IDENTIFIER_COLUMNS: Sequence[Column] = (
    Column("identifier"), Column("name", shortest=8, importance=7, identifier=True),
    Column("share", right=True, importance=9), Column("load", right=True, importance=5),
    Column("DLC", right=True, importance=4), Column("interval", right=True, importance=8),
    Column("jitter", right=True, importance=6), Column("frames", right=True, importance=3),
    Column("age", right=True),
)  # fmt: skip


def identifiers(summary: CanSummary, bus: CanBusSummary) -> list[Identifier]:
    """Return the identifiers of a bus, the largest share first."""
    streams: dict[tuple[int, bool], CanStreamSummary] = {
        (stream.cob_id, stream.extended): stream
        for entry in summary.lists if entry.key.port == bus.channel for stream in entry.streams
    }  # fmt: skip
    mean = bus.load.mean if bus.load else None
    found = []
    for place, one in enumerate(bus.identifiers):
        stream = streams.get((one.cob_id, one.extended))
        timed = stream.intervals if stream else None
        found.append(
            Identifier(
                place, one.cob_id, one.extended, one.frames, one.share,
                None if mean is None else mean * one.share / 100, one.last_ns,
                stream.length if stream and stream.telegrams else None, timed.p50 if timed else None,
                Jitter.of(timed.p50, timed.p99, timed.nominal) if timed else None,
            )
        )  # fmt: skip
    return found


SORTS: Mapping[str, Callable[[Identifier], Any]] = {
    "share": lambda row: row.share,
    "identifier": lambda row: (row.extended, row.cob_id),
    "frames": lambda row: row.frames,
    "interval": lambda row: -1 if row.interval_ns is None else row.interval_ns,
    "jitter": lambda row: -1.0 if row.jitter is None else row.jitter.percent,
    "age": lambda row: -row.last_ns,
    "DLC": lambda row: -1 if row.length is None else row.length,
}
"""By what identifiers are sorted; the largest comes first, but for identifiers."""


def identifier_cells(row: Identifier, told: Row, at_ns: int) -> list[Cell]:
    """Return the cells of an identifier; ``told`` is its row of the report."""
    name = Cell(told["name"]) if told["name"] else Cell(told["canopen"] or NOTHING, Tone.FAINT)
    return [
        Cell(units.cob_id(row.cob_id, row.extended), Tone.STRONG), name, Cell(units.load(row.share)),
        _maybe(None if row.load is None else units.load(row.load)),
        _maybe(None if row.length is None else str(row.length)),
        _maybe(None if row.interval_ns is None else units.duration(row.interval_ns)),
        _maybe(row.jitter.text if row.jitter else None),
        Cell(units.count(row.frames)), age(at_ns - row.last_ns),
    ]  # fmt: skip


def age(passed_ns: int) -> Cell:
    """Return how long ago something came, in whole seconds."""
    if passed_ns < _S_NS:
        return Cell("0 s", Tone.FAINT)
    return Cell(f"{passed_ns // _S_NS} s" if passed_ns < 60 * _S_NS else units.duration(passed_ns))


def _maybe(text: str | None) -> Cell:
    return Cell(NOTHING, Tone.FAINT) if text is None else Cell(text)


def below(row: Row, clock: Clock, width: int) -> list[Line]:
    """Return what is told of the errors of a bus, and of its CANopen nodes; nothing where there is neither."""
    lines: list[Line] = []
    for place, told in enumerate(buses.error_lines(row, clock)):
        cells_ = list(told)
        errors = row["errors"]
        first_ns, last_ns = nanoseconds(errors["first_ns"]), nanoseconds(errors["last_ns"])
        if not place and first_ns is not None and last_ns is not None:
            when = f"at {clock.moment(first_ns)}" if first_ns == last_ns else (
                f"from {clock.moment(first_ns)} to {clock.moment(last_ns)}"
            )  # fmt: skip
            cells_.append(Cell(f", {when}", Tone.FAINT))
        lines += wrap(cells_, width, hanging=2)
    measures, rows = buses.nodes(row, clock)
    if rows:
        lines += [[]] if lines else []
        table = [cells(measures, one) for one in rows]
        lines += align([measure.column for measure in measures], table, width)[: len(rows) + 1]
    return lines
