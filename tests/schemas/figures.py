"""The figures of the program as parts of schemas: keys and units are those of the table of figures."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable

from nvscope.tracker.diagnosis import DiagError
from nvscope.tracker.figures import BY_SCOPE, DIAGNOSIS, INTERVALS, LATENCIES, LIST_COUNTERS, Figure, Of
from tests.schemas.shapes import Properties, Schema, duration, maybe, number, record, time, unknown, whole, word

_MAY_BE_UNKNOWN = {
    "lost",  # NV207
    "rate",  # no time has passed
    "jitter",  # without a nominal interval
    "data_bit_rate",
    "tx_errors", "rx_errors",
    *(one.name for one in (*INTERVALS, *LATENCIES) if one.unit == "ns"),
    *(one.name for one in DIAGNOSIS if one.unit == "time"),
}  # fmt: skip
"""The figures that can be null where all the others are numbers."""

Shape = Callable[[Figure], Schema]


def figure(one: Figure) -> Schema:
    """Return what a figure is, by its unit."""
    told = f"{one.help}; unit: {one.unit}" if one.unit not in ("", "time", "ns") else one.help
    if one.unit == "time":
        found = time(told)
    elif one.unit == "ns":
        found = duration(told, None)  # clocks are set back
    elif one.unit in ("percent", "per second"):
        found = number(told, 0)
    elif one.unit == "":
        assert one.name == "sLastError"
        found = word([error.name for error in DiagError], told)
    else:
        # Who counts across streams may lose on one and take back on another: less than nothing is missing there.
        found = whole(told, None if one.name in ("lost", "lost_claimed") else 0)
    return maybe(found) if one.name in _MAY_BE_UNKNOWN else found


_LEFT_OUT = {
    "missing_acknowledgements", "checksum_mismatches", "bootup_unanswered", "sLastError", "nErrorCount",
    "latency_count", "lost_claimed", *BY_SCOPE,
}  # fmt: skip
"""The figures that can be null besides where the limit of streams has left out what they hang on (NV906)."""


def limited(one: Figure) -> Schema:
    """Return what a figure is in a report, of which a limit may leave out something."""
    found = figure(one)
    return maybe(found) if one.name in _LEFT_OUT - _MAY_BE_UNKNOWN else found


def known_to_none(one: Figure) -> Schema:
    """Return the same where nobody can know it, as on CAN."""
    return unknown(one.help)


def figures(
    wanted: Iterable[Figure], of: Of, within: str = "", shape: Shape = figure, leave_out: Collection[str] = ()
) -> Properties:
    """Return figures under the keys that reports have for them, nested as their paths are."""
    tree: dict[str, list[Figure]] = {}
    for one in wanted:
        path = one.keys[of].removeprefix(f"{within}." if within else "")
        if one.name not in leave_out:
            tree.setdefault(path.partition(".")[0], []).append(one)
    found = {}
    for key, own in tree.items():
        path = f"{within}.{key}" if within else key
        nested = own[0].keys[of] != path
        found[key] = record(figures(own, of, path, shape)) if nested else shape(own[0])
    return found


COUNTERS = figures(LIST_COUNTERS, Of.LIST)
