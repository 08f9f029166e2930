"""What a report for people says of a CAN bus: a line, tables of identifiers and CANopen nodes, and of its errors.

Takes the buses of the report of schema ``nvscope.report/2``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Sequence

from nvscope import units
from nvscope.view.lines.plant.content import Clock, Report, Row, nanoseconds
from nvscope.view.lines.plant.tables import Measure, count_cell, used
from nvscope.view.lines.table import NO_BREAK, NOTHING, Cell, Column, Tone

MOST_IDENTIFIERS = 8
"""So many identifiers of a bus are shown unless all are wanted: those with the largest share."""

MOST_BUSES = 16
"""So many buses are shown unless all are wanted, the first by name."""

_GAP = " · "


def buses(report: Report, most: int | None = None) -> tuple[Sequence[Row], int]:
    """Return the buses of a report, and how many there are beside these; one without CAN has none."""
    found: Sequence[Row] = report.get("buses", ())
    shown = found[:most]
    return shown, len(found) - len(shown)


def headline(bus: Row, clock: Clock) -> list[Cell]:
    """Return the name of a bus, its bit rate, how many frames it had, and how busy it was."""
    rate, load = bus["bit_rate"], bus["load"]
    cells = [Cell(f"Bus {bus['channel']}", Tone.STRONG), Cell(": ")]
    if rate is None:
        cells.append(Cell("bit rate unknown: --bitrate gives it, and the load", Tone.FAINT))
    else:
        data = f" and {units.bit_rate(rate['data'])}" if rate["data"] else ""
        cells.append(Cell(f"{units.bit_rate(rate['nominal'])}{data} ({rate['source']})".replace(" ", NO_BREAK)))
    cells.append(Cell(_GAP + units.count_of(bus["frames"], "frame")))
    if load is None:
        cells.append(Cell(f"{_GAP}{units.count(bus['bits'] + bus['fast_bits'])} bits"))
        return cells
    least = "at least " if load["partial"] else ""
    peak = f"{_percent(load['peak'])} at {clock.second(nanoseconds(load['peak_ns']) or 0)}"
    cells.append(Cell(f"{_GAP}load: {least}{_percent(load['mean'])} in the mean, at its peak {peak}"))
    cells.append(Cell(f" ({_percent(load['worst'])} with all possible stuff bits)"))
    return cells


def identifiers(bus: Row, most: int | None = MOST_IDENTIFIERS) -> tuple[list[Measure], list[Row]]:
    """Return columns and rows of the table of identifiers, the largest share first; without ``most``, of all."""
    mean = bus["load"]["mean"] if bus["load"] else None
    shown = bus["identifiers"][:most]
    rows: list[Row] = [{**entry, "load": None if mean is None else mean * entry["share"] / 100} for entry in shown]
    left = bus["identifiers"][len(shown) :]
    if left:
        share = sum(entry["share"] for entry in left)
        rest = {name: sum(entry[name] for entry in left) for name in ("frames", "bits", "fast_bits")}
        load = None if mean is None else mean * share / 100
        rows.append(
            {"cob_id": None, "name": None, "canopen": None, "left": len(left), "share": share, "load": load} | rest
        )
    return used(_IDENTIFIERS if most is not None else ALL_OF_IDENTIFIERS, rows), rows


def nodes(bus: Row, clock: Clock) -> tuple[list[Measure], list[Row]]:
    """Return columns and rows of the table of CANopen nodes."""
    rows: list[Row] = [{**node, "clock": clock} for node in bus["canopen_nodes"]]
    return used(NODES, rows), rows


def error_lines(bus: Row, clock: Clock) -> list[list[Cell]]:
    """Return what error frames told, nothing where there are none."""
    errors = bus["errors"]
    if errors is None:
        return []
    told = _counts(errors["classes"])
    lines = [[Cell(units.count_of(errors["frames"], "error frame"), Tone.WARNING), Cell(f": {told}")]]
    off = errors["bus_off"]
    if off["count"]:
        ended = off["restarted"] + off["returned"]
        text = f", for {units.duration(off['total_ns'])}" if ended else ""
        if ended > 1:
            text += f" in all, {units.duration(off['longest_ns'])} at the longest"
        since_ns = nanoseconds(off["since_ns"])
        if since_ns is not None:
            text += f"{', and' if ended else ','} since {clock.moment(since_ns)} to the end"
        lines.append([Cell(f"off the bus {units.count_of(off['count'], 'time')}", Tone.ERROR), Cell(text)])
    states = _counts(errors["states"])
    if states:
        lines.append([Cell(f"controller: {states}")])
    if errors["tx_errors"] is not None:
        counters = f"{errors['tx_errors']} (transmit) and {errors['rx_errors']} (receive)"
        lines.append([Cell(f"error counters up to {counters}")])
    return lines


def _counts(told: Sequence[Row]) -> str:
    return ", ".join(f"{entry['label']}{NO_BREAK}({units.count(entry['frames'])})" for entry in told)


def _percent(percent: float) -> str:
    return units.load(percent).replace(" ", NO_BREAK)


def _faint(text: str | None) -> Cell:
    return Cell(text or NOTHING, Tone.FAINT)


def _identifier(entry: Row) -> Cell:
    if entry["cob_id"] is None:
        return Cell(f"{units.count(entry['left'])} more", Tone.FAINT)
    return Cell(units.cob_id(entry["cob_id"], entry["extended"]), Tone.STRONG)


def _plan(entry: Row) -> str | None:
    """Return what CANopen's predefined set has an identifier for that is not known to be something else."""
    if entry["name"] or entry["canopen"] or entry["cob_id"] is None or entry["extended"]:
        return None
    from dissectors.can.canopen import title_of  # noqa: PLC0415  # it needs numpy, and only details need it

    return title_of(entry["cob_id"]) or None


def _load(entry: Row) -> Cell:
    return _faint(None) if entry["load"] is None else Cell(units.load(entry["load"]))


def _state(node: Row) -> Cell:
    if node["state"] is None:
        return _faint(None)
    tone = Tone.PLAIN if node["state"] == "operational" else Tone.WARNING
    return Cell(f"{node['state']} (commanded)" if node["told_by"] == "command" else node["state"], tone)


def _moment(node: Row, time: str | None) -> Cell:
    time_ns = nanoseconds(time)
    return _faint(None) if time_ns is None else Cell(node["clock"].moment(time_ns))


def _emergency(node: Row) -> Cell:
    last = node["last_emergency"]
    if last is None:
        return _faint(None)
    return Cell(f"0x{last['code']:04X} {last['text']}".rstrip())


def _register(node: Row) -> Cell:
    last = node["last_emergency"]
    return Cell(", ".join(last["register"])) if last and last["register"] else _faint(None)


_IDENTIFIERS = (
    Measure(Column("identifier"), _identifier),
    Measure(
        Column("name", importance=7, shortest=12, identifier=True),
        lambda row: Cell(row["name"]) if row["name"] else _faint(row["canopen"]),
    ),
    Measure(Column("frames", right=True, importance=8), lambda row: count_cell(row["frames"])),
    Measure(Column("bits", right=True, importance=5), lambda row: count_cell(row["bits"] + row["fast_bits"])),
    Measure(Column("share", right=True), lambda row: Cell(units.load(row["share"]))),
    Measure(Column("load", right=True, importance=9), _load),
)

ALL_OF_IDENTIFIERS = (
    *_IDENTIFIERS,
    Measure(Column("CANopen's plan", importance=2), lambda row: _faint(_plan(row))),
)
"""With what CANopen would use an identifier for, whether there is any CANopen or not."""

NODES = (
    Measure(Column("CANopen"), lambda row: Cell(f"node {row['node']}", Tone.STRONG)),
    Measure(Column("state"), _state),
    Measure(Column("since", importance=6), lambda row: _moment(row, row["since_ns"])),
    Measure(Column("last heard", importance=7), lambda row: _moment(row, row["last_ns"])),
    Measure(Column("heartbeats", right=True, importance=3), lambda row: count_cell(row["heartbeats"])),
    Measure(Column("changes", right=True, importance=2), lambda row: count_cell(row["changes"])),
    Measure(Column("boot-ups", right=True, importance=5), lambda row: count_cell(row["boot_ups"], Tone.WARNING)),
    Measure(Column("EMCY", right=True, importance=9), lambda row: count_cell(row["emergencies"], Tone.WARNING)),
    Measure(Column("last EMCY", importance=8, shortest=20), _emergency),
    Measure(Column("register", importance=1, shortest=12), _register),
    Measure(
        Column("at", importance=4),
        lambda row: _moment(row, row["last_emergency"]["time_ns"]) if row["last_emergency"] else _faint(None),
    ),
)
