"""The tables of a report for people: which columns there are, and what stands in them for a list, a stream, a node.

Takes parts of the report of schema ``nvscope.report/2``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from nvscope import units
from nvscope.findings.kind import Severity
from nvscope.tracker.counters import SCOPE_UNUSED
from nvscope.tracker.figures import BY_NAME, LIST_COUNTERS, Of
from nvscope.tracker.jitter import Jitter
from nvscope.view.documents.figures import lookup
from nvscope.view.lines.plant.content import Report, Row, node_names, severity_of, status
from nvscope.view.lines.table import NOTHING, Cell, Column, Tone


class Measure(Struct, frozen=True):
    """A column of a table and what stands in it for one row."""

    column: Column
    cell: Callable[[Any], Cell]


MOST_LISTS = 500
"""So many lists are shown unless all are wanted, those of which something was found before the others."""


class Overview(NamedTuple):
    """The table of lists: its columns, a row of cells for each list shown, and how many lists are not shown.

    ``left_worst`` is the worst that was found of one of those, None where nothing was.
    """

    measures: list[Measure]
    rows: list[list[Cell]]
    left: int
    left_worst: Severity | None


def overview(report: Report, *, details: bool = False, most: int | None = None) -> Overview:
    """Return the table of lists; each row is looked at once, and not kept.

    ``details`` adds what is of the diagnosis structure of a list, and no count of what was found. Of more than ``most``
    lists, those are shown of which the worst was found, in the order of all.
    """
    measures = [*OVERVIEW[:-1], ERRORS, *OVERVIEW[-1:]] if details else OVERVIEW
    names = node_names(report)
    lists: Sequence[Row] = report["lists"]
    left_worst = None
    if most is not None and len(lists) > most:
        found = [severity_of(entry["status"]) for entry in lists]
        order = sorted(range(len(lists)), key=lambda place: -(found[place] or 0))
        left_worst = found[order[most]]
        lists = [lists[place] for place in sorted(order[:most])]
    rows = [cells(measures, looked_at(entry, names)) for entry in lists]
    places = [place for place in range(len(measures)) if any(row[place].text != NOTHING for row in rows)]
    if len(places) < len(measures):
        rows = [[row[place] for place in places] for row in rows]
    return Overview([measures[place] for place in places], rows, len(report["lists"]) - len(lists), left_worst)


def looked_at(entry: Row, names: Mapping[str, str]) -> Row:
    """Return the row of a list with what the measures of ``OVERVIEW`` take beside; ``names`` are those of nodes."""
    return _With(
        entry,
        {
            "from": _first_of(entry["senders"], names),
            "to": _first_of(entry["readers"], names),
            "timed": [_Timed.of(stream) for stream in entry["streams"]],
        },
    )


class _With(Mapping[str, Any]):
    """A row of a report, and more under further keys."""

    __slots__ = ("_known", "_row")

    def __init__(self, row: Row, more: dict[str, Any]) -> None:
        self._row, self._known = row, more

    def __getitem__(self, key: str) -> Any:
        return self._known[key] if key in self._known else self._row[key]

    def __contains__(self, key: object) -> bool:
        return key in self._known or key in self._row

    def get(self, key: str, default: Any = None) -> Any:
        return self._known[key] if key in self._known else self._row.get(key, default)

    def __iter__(self) -> Iterator[str]:
        return iter({**self._row, **self._known})

    def __len__(self) -> int:
        return len({**self._row, **self._known})


def streams(entry: Row) -> tuple[list[Measure], list[Row]]:
    """Return columns and rows of the table of a list's streams: what was counted."""
    return used(STREAMS, entry["streams"]), entry["streams"]


def intervals(entry: Row) -> tuple[list[Measure], list[Row]]:
    """Return columns and rows of the table of a list's streams: how regularly they were sent."""
    rows: list[Row] = [stream for stream in entry["streams"] if _count(stream)]
    return used(INTERVALS, rows), rows


def cells(measures: Sequence[Measure], row: Row) -> list[Cell]:
    """Return one row of a table."""
    return [measure.cell(row) for measure in measures]


def used(measures: Sequence[Measure], rows: Sequence[Row]) -> list[Measure]:
    """Return the columns in which at least one row has something to say."""
    return [measure for measure in measures if any(measure.cell(row).text != NOTHING for row in rows)]


def told_apart(measures: Sequence[Measure], rows: Sequence[Row], title: str, names: Collection[str]) -> bool:
    """Tell whether rows are alike in some columns, and a further one is all that tells them apart."""
    (further,) = (measure for measure in measures if measure.column.title == title)
    others = [measure for measure in measures if measure.column.title in names]
    seen: dict[tuple[str, ...], str] = {}
    return any(
        seen.setdefault(tuple(measure.cell(row).text for measure in others), text) != text
        for row in rows if (text := further.cell(row).text)
    )  # fmt: skip


def with_port(measures: Sequence[Measure], rows: Sequence[Row], names: Collection[str]) -> Sequence[Measure]:
    """Return columns of pairs, of which ``port`` stays however little room there is, if all else names them alike."""
    if not told_apart(measures, rows, "port", names):
        return measures
    return [
        replace(measure, column=replace(measure.column, importance=None)) if measure.column.title == "port" else measure
        for measure in measures
    ]  # fmt: skip


def without_idle_port(measures: Sequence[Measure], rows: Sequence[Row], names: Collection[str]) -> Sequence[Measure]:
    """Return columns without ``port``, but where it is all that tells rows apart."""
    if told_apart(measures, rows, "port", names):
        return measures
    return [measure for measure in measures if measure.column.title != "port"]


UNKNOWN = Cell("?", Tone.FAINT)
"""What stands for a figure that there is, and that nobody knows."""

_COUNTED = {"nErrorCount", *(one.name for one in LIST_COUNTERS)}


def _first_of(addresses: Sequence[str], names: Mapping[str, str]) -> str:
    if not addresses:
        return NOTHING
    first = names.get(addresses[0], addresses[0])
    return first if len(addresses) == 1 else f"{first} +{len(addresses) - 1}"


def _text(value: object, tone: Tone = Tone.PLAIN) -> Cell:
    return Cell(NOTHING, Tone.FAINT) if value is None or value in ("", NOTHING) else Cell(str(value), tone)


def count_cell(number: int | None, tone: Tone = Tone.PLAIN) -> Cell:
    """Return a counter: zero is faint, more has the tone given (less is not bad: it evens out elsewhere)."""
    return _count_cell(number, tone, units.separator())


@lru_cache(4096)
def _count_cell(number: int | None, tone: Tone, _separator: str) -> Cell:
    if number is None:
        return Cell(NOTHING, Tone.FAINT)
    return Cell(units.count(number), tone if number > 0 else Tone.PLAIN if number else Tone.FAINT)


def rare_cell(number: int | None, tone: Tone = Tone.PLAIN) -> Cell:
    """Return a counter of what hardly ever happens: where it never did, nothing stands there."""
    return count_cell(number, tone) if number else Cell(NOTHING, Tone.FAINT)


def duration_cell(duration_ns: int | None, tone: Tone = Tone.PLAIN) -> Cell:
    """Return a duration as people read it, nothing where there is none."""
    return _duration_cell(duration_ns, tone, units.separator())


@lru_cache(4096)
def _duration_cell(duration_ns: int | None, tone: Tone, _separator: str) -> Cell:
    return Cell(NOTHING, Tone.FAINT) if duration_ns is None else Cell(units.duration(duration_ns), tone)


def error_name(name: object) -> Cell:
    """Return the name of an error as controllers have it."""
    return _text(name, Tone.FAINT if name == "NOERROR" else Tone.ERROR)


def _last_error(entry: Row) -> Cell:
    if _error_count(entry) is None:
        return UNKNOWN
    return error_name(_last_error_of(entry) if _error_count(entry) else None)


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


def _lost(of: Of) -> Callable[[Row], Cell]:
    """Return what tells the loss of a list or a stream; nobody knows it of a sender that does not count."""
    lost = lookup(BY_NAME["lost"], of)

    def cell(row: Row) -> Cell:
        if (lost(row) is None and _is_on_udp(row)) or (not lost(row) and counts_nothing(row)):
            return UNKNOWN
        return count_cell(lost(row), Tone.ERROR)

    return cell


def _is_on_udp(row: Row) -> bool:
    return bool(row["transport"] == "udp" if "transport" in row else row["node"] is not None)


def counts_nothing(row: Row) -> bool:
    """Tell whether a stream, or all of a list, leave Counter as it is: nothing that is lost shows there."""
    streams = row.get("streams", (row,))
    return bool(streams) and all(stream.get("counter_scope") == SCOPE_UNUSED for stream in streams)


_count, _p50, _p99, _nominal = (
    lookup(BY_NAME[f"interval_{name}"], Of.STREAM) for name in ("count", "p50", "p99", "nominal")
)
_error_count, _last_error_of = (lookup(BY_NAME[name], Of.LIST) for name in ("nErrorCount", "sLastError"))


class _Timed(NamedTuple):
    """What the overview tells of the intervals of a stream."""

    intervals: int
    p50: int | None
    p99: int | None
    nominal: int | None

    @classmethod
    def of(cls, stream: Row) -> _Timed:
        return cls(_count(stream), _p50(stream), _p99(stream), _nominal(stream))

    @property
    def departs(self) -> bool:
        """Whether the median is further from the nominal interval than a tenth of it: then a definition gave that."""
        if not self.nominal or self.p50 is None:
            return False
        return bool(10 * abs(self.p50 - self.nominal) > self.nominal)


def _interval(entry: Row) -> Cell:
    """Return at which interval a list is sent, measured; marked where a definition says otherwise."""
    known = [stream for stream in entry["timed"] if stream.intervals]
    regular = [stream for stream in known if stream.nominal is not None]
    if known and not regular:
        return Cell("on change", Tone.FAINT)
    # Where a clock stepped back far, nobody knows how long it took.
    shown = _spread([stream.p50 for stream in regular if stream.p50 is not None and stream.p50 >= 0])
    return Cell(shown.text, Tone.WARNING) if any(stream.departs for stream in regular) else shown


def _defined(entry: Row) -> Cell:
    """Return the interval of the definition where the list is sent at another one."""
    return _spread([stream.nominal for stream in entry["timed"] if stream.departs])


def _median(entry: Row) -> Cell:
    """Return the median interval of a list without a nominal one; elsewhere it is the interval."""
    if all(stream.nominal for stream in entry["timed"]):
        return Cell(NOTHING, Tone.FAINT)
    return _spread([stream.p50 for stream in entry["timed"] if stream.p50 is not None])


def _jitter(entry: Row) -> Cell:
    """Return the jitter of the list's worst stream."""
    found = [Jitter.of(stream.p50, stream.p99, stream.nominal) for stream in entry["timed"]]
    worst_of_all = max((one for one in found if one is not None), key=lambda one: one.percent, default=None)
    return Cell(NOTHING, Tone.FAINT) if worst_of_all is None else Cell(worst_of_all.text)


def _figure(
    name: str,
    of: Of,
    title: str,
    importance: int | None = None,
    tone: Tone | Callable[[Row], Tone] = Tone.PLAIN,
) -> Measure:
    """Return the column of a figure; ``tone`` is that of its cells, or tells it of a row."""
    figure = BY_NAME[name]
    look, show = lookup(figure, of), duration_cell if figure.unit == "ns" else count_cell

    def cell(row: Row) -> Cell:
        value = look(row)
        if value is None and name in _COUNTED and _is_on_udp(row):
            return UNKNOWN
        return show(value, tone if isinstance(tone, Tone) else tone(row))

    return Measure(Column(title, right=True, importance=importance), cell)


def _tone_of_median(stream: Row) -> Tone:
    return Tone.WARNING if _Timed.of(stream).departs else Tone.PLAIN


OVERVIEW = (
    Measure(Column("status"), lambda row: status(severity_of(row["status"]))),
    Measure(Column("list", shortest=16, identifier=True), lambda row: _text(units.list_key(row["key"]), Tone.STRONG)),
    Measure(Column("name", importance=7, shortest=12, identifier=True), _name),
    Measure(Column("sender", shortest=16, identifier=True), lambda row: _text(row["from"])),
    Measure(Column("reader", importance=1, shortest=16, identifier=True), lambda row: _text(row["to"])),
    Measure(Column("interval", right=True, importance=9), _interval),
    Measure(Column("defined", right=True, importance=9), _defined),
    Measure(Column("median", right=True, importance=2), _median),
    Measure(Column("jitter", right=True, importance=4), _jitter),
    _figure("nSendCount", Of.LIST, "sent", 10),
    Measure(Column("lost", right=True, importance=10), _lost(Of.LIST)),
    _figure("missing_acknowledgements", Of.LIST, "no ack", 8, Tone.ERROR),
    Measure(Column("last error", importance=3), _last_error),
)

ERRORS = _figure("nErrorCount", Of.LIST, "nErrorCount", 5, Tone.ERROR)
"""What a controller counts as errors: not what is found, so that it is called as there."""

_STREAM = (
    Measure(Column("node", shortest=12, identifier=True), lambda row: _text(row["node"])),
    Measure(Column("sub", right=True), lambda row: Cell(str(row["subindex"]))),
)

STREAMS = (
    *_STREAM,
    _figure("telegrams", Of.STREAM, "telegrams"),
    Measure(Column("lost", right=True), _lost(Of.STREAM)),
    _figure("duplicates", Of.STREAM, "dup", 6, Tone.WARNING),
    _figure("overtaken", Of.STREAM, "overtaken", 5, Tone.WARNING),
    _figure("restarts", Of.STREAM, "restarts", 4, Tone.WARNING),
    Measure(Column("items", right=True, importance=3), lambda row: _text(row["items"])),
    Measure(Column("length", right=True, importance=3), lambda row: _text(row["length"])),
    Measure(Column("checksum", right=True, importance=2), lambda row: _checksum(row["checksum"])),
    Measure(Column("counter", importance=1), lambda row: _text(row["counter_scope"] or "?" * _is_on_udp(row))),
)

INTERVALS = (
    *_STREAM,
    _figure("interval_nominal", Of.STREAM, "nominal", 8),
    _figure("interval_min", Of.STREAM, "min", 6),
    _figure("interval_p50", Of.STREAM, "p50", 9, _tone_of_median),
    _figure("interval_p95", Of.STREAM, "p95", 3),
    _figure("interval_p99", Of.STREAM, "p99", 7),
    _figure("interval_max", Of.STREAM, "max", 9),
    _figure("interval_mean", Of.STREAM, "mean", 5),
    _figure("interval_stddev", Of.STREAM, "stddev", 4),
    _figure("interval_count", Of.STREAM, "count", 2),
)
