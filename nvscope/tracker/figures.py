"""The table of figures: what is counted and measured of a stream, a list, a node on a list, or a CAN bus.

JSON keys, columns, the words of expressions and rules, and ``explain`` are derived from here. A figure of a node is
that of its streams on one list.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum
from operator import attrgetter
from types import MappingProxyType
from typing import Literal

from msgspec import Struct, field

from nvscope.tracker.diagnosis import ERROR_ORDER
from nvscope.tracker.measured import Measured

Unit = Literal[
    "telegrams", "frames", "intervals", "acknowledgements", "counters", "gaps", "events", "bits", "seconds", "percent",
    "per second", "bits per second", "time", "ns", "",
]  # fmt: skip
"""``time`` is an absolute one in ns, ``ns`` a duration; "" are texts."""

Value = int | float | str | None


class Of(Enum):
    """What a figure can be of."""

    STREAM = "stream"
    LIST = "list"
    NODE = "node"
    BUS = "bus"


PLACES = {
    Of.STREAM: "lists[].streams[]", Of.LIST: "lists[]", Of.NODE: "lists[].nodes[]", Of.BUS: "buses[]",
}  # fmt: skip
"""Where a report in JSON has each of them."""


class Joins(Enum):
    """How the figure of a whole follows from those of the windows that it is cut into."""

    SUM = "the sum of theirs"
    LEAST = "the least of theirs"
    MAX = "the greatest of theirs"
    LAST = "that of the last window that has one"
    HISTOGRAM = "read from the histograms of all, added up"
    DERIVED = "computed anew from other figures of the whole"


class Provided(Enum):
    """What has to be alike in all windows, or their figures do not join: it is learned as telegrams come."""

    COUNTING = "what a sender counts was taken alike in all"
    READING = "the same nodes read in all"
    SENT = "what is asked for had been sent before"


class Figure(Struct, frozen=True):
    """One figure: its name, its unit, what it tells, of what, how windows join, and how it is read.

    ``keys`` say where a report has it in JSON, as a path within ``PLACES``; what is not there is in no report.
    ``width_bits`` is how wide a controller keeps it, 0 where it keeps none. ``provided`` is what windows have to have
    in common to join, None where they always do. ``held`` names the part of ``Measured`` that has it and its name
    there (of counters, its key), where several figures are read of that part at once. ``texts`` are the only ones that
    it is, where it is a text.
    """

    name: str
    unit: Unit
    help: str
    of: tuple[Of, ...]
    joins: Joins
    reads: Callable[[Measured], Value]
    keys: Mapping[Of, str] = field(default_factory=lambda: MappingProxyType({}))
    width_bits: int = 0
    provided: Provided | None = None
    held: tuple[str, str] | None = None
    texts: tuple[str, ...] = ()

    @property
    def extreme(self) -> bool:
        """Whether it is one that somebody has to keep for a window."""
        return self.joins in (Joins.LEAST, Joins.MAX)

    def read(self, row: Measured) -> Value:
        """Return the figure of what was measured; extremes of a window are None where nobody kept them for it."""
        return self.reads(row) if row.extremes or not self.extreme else None


_LISTS_AND_NODES = Of.LIST, Of.NODE
_TRAFFIC = Of.STREAM, Of.LIST, Of.NODE


def _diagnosis(
    name: str,
    unit: Unit,
    joins: Joins,
    text: str,
    width_bits: int = 0,
    provided: Provided | None = None,
    *,
    texts: tuple[str, ...] = (),
) -> Figure:
    keys = {Of.LIST: f"diag.{name}", Of.NODE: f"diag.{name}"}
    held = "diagnosis", name
    return Figure(name, unit, text, _LISTS_AND_NODES, joins, _read_of(*held), keys, width_bits, provided, held, texts)


def _read_of(part: str, name: str) -> Callable[[Measured], Value]:
    whole = attrgetter(part)

    def read(row: Measured) -> Value:
        holder = whole(row)
        value: Value = None if holder is None else getattr(holder, name)
        return value

    return read


def _counter(name: str, unit: Unit, text: str, of: tuple[Of, ...] = (Of.LIST,), joins: Joins = Joins.SUM) -> Figure:
    keys = {Of.LIST: f"counters.{name}"}
    if name in _STREAM_KEYS:
        keys[Of.STREAM] = name
    provided = Provided.COUNTING if name in (*BY_SCOPE, "lost_claimed") else None
    held = "counters", name
    return Figure(name, unit, text, of, joins, lambda row: row.counters.get(name), keys, provided=provided, held=held)


def _interval(
    key: str, attribute: str, joins: Joins, text: str, unit: Unit = "ns", of: tuple[Of, ...] = _TRAFFIC
) -> Figure:
    held = "intervals", attribute
    keys = {Of.STREAM: f"interval_ns.{key}"}
    return Figure(f"interval_{key}", unit, text, of, joins, _read_of(*held), keys, held=held)


def _latency(key: str, attribute: str, joins: Joins, text: str, unit: Unit = "ns") -> Figure:
    held = "latency", attribute
    keys = dict.fromkeys(_TRAFFIC, f"latency_ns.{key}")
    return Figure(f"latency_{key}", unit, text, _TRAFFIC, joins, _read_of(*held), keys, held=held)


def _bus(
    name: str, unit: Unit, joins: Joins, text: str, path: str, key: str = "", *, otherwise: Value = None
) -> Figure:
    """Return a figure of buses, read from ``CanBusSummary`` along a path; ``otherwise`` is what it is without it."""

    def read(row: Measured) -> Value:
        value: object = row.bus
        for part in path.split("."):
            if value is None:
                return otherwise
            value = getattr(value, part)
        assert value is None or isinstance(value, int | float | str)
        return value

    return Figure(name, unit, text, (Of.BUS,), joins, read, {Of.BUS: key or name})


BY_SCOPE = ("lost", "gaps", "longest_gap", "duplicates", "overtaken", "restarts")
"""The counters that depend on what a sender's Counter counts; kept once for each scope."""

_STREAM_KEYS = ("lost", "lost_claimed", "duplicates", "overtaken", "restarts")

DIAGNOSIS = (
    _diagnosis("nSendCount", "telegrams", Joins.SUM, "data telegrams sent, malformed ones included", 32),
    _diagnosis("tLastSend", "time", Joins.LAST, "time of the last of them"),
    _diagnosis(
        "nReceiveCount", "telegrams", Joins.SUM, "telegrams received, of any service and malformed ones included", 32,
        Provided.READING,
    ),
    _diagnosis("tLastReceive", "time", Joins.LAST, "time of the last of them", provided=Provided.READING),
    _diagnosis(
        "nWriteCount", "telegrams", Joins.SUM, "data telegrams that a reader would write into its variables", 32,
        Provided.READING,
    ),
    _diagnosis(
        "sLastError", "", Joins.LAST, "name of the last error", texts=tuple(error.name for error in ERROR_ORDER)
    ),
    _diagnosis("tLastError", "time", Joins.LAST, "time of the last error"),
    _diagnosis("nErrorCount", "events", Joins.SUM, "errors of any kind", 16),
    _diagnosis("nAcknowledges", "telegrams", Joins.SUM, "acknowledgements sent, negative ones included", 16),
)  # fmt: skip
"""NetVarUDPDiagStruct (Network Functionality in CoDeSys V2.3, 3.4), in the order of its components."""

LIST_COUNTERS = (
    _counter(
        "lost", "counters", "telegrams that the counters say were sent and that never came; unknown where NV207",
        _TRAFFIC,
    ),
    _counter(
        "lost_claimed", "counters", "telegrams that the counters claim were sent and never came, believed or not",
        _TRAFFIC,
    ),
    _counter("gaps", "gaps", "places where telegrams are missing", _TRAFFIC),
    _counter("longest_gap", "counters", "most telegrams missing in one place", _TRAFFIC, Joins.MAX),
    _counter("duplicates", "telegrams", "telegrams that came again", _TRAFFIC),
    _counter("overtaken", "telegrams", "telegrams that came after a later one", _TRAFFIC),
    _counter("restarts", "events", "counters that began anew", _TRAFFIC),
    _counter("malformed", "telegrams", "telegrams too short, of a wrong Length or of an unknown service"),
    _counter("truncated", "telegrams", "telegrams of which the capture holds only the beginning"),
    _counter("missing_acknowledgements", "events", "data telegrams that nobody acknowledged in time"),
    _counter("negative_acknowledgements", "events", "acknowledgements that say: checksum invalid"),
    _counter("checksum_mismatches", "events", "data telegrams with another checksum than the list's"),
    _counter("bootup_requests", "telegrams", "requests of readers for current values"),
    _counter("bootup_unanswered", "events", "requests that no data telegram answered in time"),
    _counter("send_rejected", "events", "telegrams that came back as undeliverable (ICMP)"),
)  # fmt: skip
"""The counters of a list, in the order of reports."""

STREAM_COUNTERS = tuple(one for one in LIST_COUNTERS if Of.STREAM in one.keys)
"""Those that reports have of a stream, too."""

TELEGRAMS = Figure(
    "telegrams", "telegrams", "well-formed data telegrams (on CAN data frames)", _TRAFFIC, Joins.SUM,
    attrgetter("telegrams"), {Of.STREAM: "telegrams"},
)  # fmt: skip

REMOTE = Figure(
    "remote", "frames", "remote frames that asked for it, on CAN", (Of.STREAM,), Joins.SUM, attrgetter("remote"),
    {Of.STREAM: "remote"}, provided=Provided.SENT,
)  # fmt: skip

RATE = Figure(
    "rate", "per second", "well-formed data telegrams (on CAN frames) in a second, over the time that was watched",
    (*_TRAFFIC, Of.BUS), Joins.DERIVED, attrgetter("per_second"), dict.fromkeys((*_TRAFFIC, Of.BUS), "rate"),
)  # fmt: skip

INTERVALS = (
    _interval("count", "count", Joins.SUM, "intervals between telegrams of one stream", "intervals"),
    _interval("min", "minimum", Joins.LEAST, "shortest interval"),
    _interval("mean", "mean", Joins.DERIVED, "mean interval"),
    _interval("max", "maximum", Joins.MAX, "longest interval"),
    _interval("stddev", "deviation", Joins.DERIVED, "standard deviation of the intervals", of=(Of.STREAM,)),
    _interval("p50", "p50", Joins.HISTOGRAM, "median interval, within 0.5 %"),
    _interval("p95", "p95", Joins.HISTOGRAM, "interval that 95 of 100 do not exceed, within 0.5 %"),
    _interval("p99", "p99", Joins.HISTOGRAM, "interval that 99 of 100 do not exceed, within 0.5 %"),
    _interval(
        "nominal", "nominal", Joins.DERIVED, "interval of the definition; without a definition the median, if cyclic"
    ),
)
"""The intervals between telegrams, in the order of reports."""

JITTER = Figure(
    "jitter", "percent", "how far p99 lies from p50, in percent of the nominal interval; the worst stream's", _TRAFFIC,
    Joins.DERIVED, attrgetter("jitter_percent"), dict.fromkeys(_TRAFFIC, "jitter"),
)  # fmt: skip

LATENCIES = (
    _latency("count", "count", Joins.SUM, "data telegrams that were acknowledged in time", "acknowledgements"),
    _latency("p50", "p50", Joins.HISTOGRAM, "median time from a data telegram to its acknowledgement, within 0.5 %"),
    _latency("p99", "p99", Joins.HISTOGRAM, "time to the acknowledgement that 99 of 100 do not exceed, within 0.5 %"),
    _latency("max", "maximum", Joins.MAX, "longest time from a data telegram to its acknowledgement"),
)

PACE = (RATE, JITTER, *LATENCIES)
"""How often and how regularly something is sent and answered, in the order of reports."""

BUS_COUNTERS = (
    _bus("frames", "frames", Joins.SUM, "frames of any kind", "frames"),
    _bus("seconds", "seconds", Joins.DERIVED, "seconds with frames", "seconds"),
    _bus("bits", "bits", Joins.SUM, "bits on the wire, with stuff bits", "bits"),
    _bus("fast_bits", "bits", Joins.SUM, "those at the data bit rate of CAN FD", "fast_bits"),
    _bus("peak_bits", "bits", Joins.DERIVED, "bits of the busiest second", "peak_bits"),
    _bus("worst_bits", "bits", Joins.DERIVED, "bits that it could have had with most stuff bits", "worst_bits"),
)
"""What is counted of a bus, in the order of reports."""

BIT_RATES = (
    _bus(
        "bit_rate", "bits per second", Joins.DERIVED, "bit rate, as given or found", "bit_rate.nominal",
        "bit_rate.nominal",
    ),
    _bus(
        "data_bit_rate", "bits per second", Joins.DERIVED, "bit rate of the data phase of CAN FD", "bit_rate.data",
        "bit_rate.data",
    ),
)  # fmt: skip

LOADS = (
    _bus("load", "percent", Joins.DERIVED, "busy part of the time from the first frame on", "load.mean", "load.mean"),
    _bus("load_peak", "percent", Joins.DERIVED, "busy part of the busiest second", "load.peak", "load.peak"),
    _bus(
        "load_worst", "percent", Joins.DERIVED, "what that could have been with most stuff bits", "load.worst",
        "load.worst",
    ),
)  # fmt: skip
"""Where the bit rate is known."""

BUS_ERRORS = (
    _bus("error_frames", "frames", Joins.SUM, "error frames", "errors.count", "errors.frames", otherwise=0),
    _bus(
        "bus_off", "events", Joins.SUM, "times that a controller left the bus", "errors.bus_offs",
        "errors.bus_off.count", otherwise=0,
    ),
    _bus(
        "bus_off_restarted", "events", Joins.SUM, "times that a frame told of its return", "errors.restarts",
        "errors.bus_off.restarted", otherwise=0,
    ),
    _bus(
        "bus_off_returned", "events", Joins.SUM, "times that it was seen to be back", "errors.returns",
        "errors.bus_off.returned", otherwise=0,
    ),
    _bus(
        "bus_off_total", "ns", Joins.SUM, "how long it was off the bus in all, as far as it came back",
        "errors.off_ns", "errors.bus_off.total_ns", otherwise=0,
    ),
    _bus(
        "bus_off_longest", "ns", Joins.MAX, "how long it was off the bus at the longest", "errors.longest_off_ns",
        "errors.bus_off.longest_ns", otherwise=0,
    ),
    _bus(
        "tx_errors", "events", Joins.MAX, "highest transmit error counter told", "errors.tx_errors", "errors.tx_errors"
    ),
    _bus(
        "rx_errors", "events", Joins.MAX, "highest receive error counter told", "errors.rx_errors", "errors.rx_errors"
    ),
)  # fmt: skip

FIGURES = (
    *DIAGNOSIS, *LIST_COUNTERS, TELEGRAMS, REMOTE, RATE, *INTERVALS, JITTER, *LATENCIES, *BUS_COUNTERS, *BIT_RATES,
    *LOADS, *BUS_ERRORS,
)  # fmt: skip
"""All of them."""

BY_NAME: Mapping[str, Figure] = MappingProxyType({one.name: one for one in FIGURES})
"""Each of them, by its name."""


def figures_of(of: Of) -> tuple[Figure, ...]:
    """Return the figures that there are of a kind of thing, in the order of the table."""
    return tuple(one for one in FIGURES if of in one.of)
