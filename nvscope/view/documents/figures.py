"""Figures as data: absolute times are decimal strings of ns, since JavaScript cannot hold them as numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import attrgetter
from typing import Any

from nvscope.tracker.figures import (
    DIAGNOSIS,
    INTERVALS,
    LIST_COUNTERS,
    PACE,
    REMOTE,
    STREAM_COUNTERS,
    TELEGRAMS,
    Figure,
    Of,
)
from nvscope.tracker.measured import Measured

_Reads = Callable[[Measured], Any]


def time_text(time_ns: int | None) -> str | None:
    """Return an absolute time as the report has it."""
    return None if time_ns is None else str(time_ns)


def rounded(number: float) -> float:
    """Return a percentage or a rate as the report has it."""
    return round(number, 3)


class FigureRow:
    """Some figures of one kind of thing, as the part of its JSON object that holds them.

    Keys are in the order given, and nested as the paths of the table are. ``within`` is a path: then they are those of
    the object there.
    """

    def __init__(self, figures: Iterable[Figure], of: Of, within: str = "") -> None:
        by_key: dict[str, list[Figure]] = defaultdict(list)
        for figure in figures:
            rest = figure.keys[of]
            if within:
                assert rest.startswith(f"{within}."), f"{figure.name} is not within {within}"
                rest = rest[len(within) + 1 :]
            by_key[rest.partition(".")[0]].append(figure)
        self._reads: list[tuple[str, _Reads]] = []
        for key, own in by_key.items():
            path = f"{within}.{key}" if within else key
            nested = own[0].keys[of] != path
            self._reads.append((key, _read_at_once(own, of, path) if nested else _reading(own[0])))

    @property
    def reads(self) -> Mapping[str, _Reads]:
        """By key, what reads its part of what was measured."""
        return dict(self._reads)

    def read(self, measured: Measured) -> dict[str, Any]:
        """Return the figures of what was measured; None for what is not known."""
        return {key: read(measured) for key, read in self._reads}


def lookup(figure: Figure, of: Of) -> Callable[[Mapping[str, Any]], Any]:
    """Return what looks a figure up in the JSON object of a stream, list, node or bus; None without what holds it."""
    first, *others = figure.keys[of].split(".")

    def look(row: Mapping[str, Any]) -> Any:
        value = row.get(first)  # what is only of CAN has no key elsewhere
        for key in others:
            if value is None:
                return None
            value = value[key]
        return value

    return look


def _reading(figure: Figure) -> _Reads:
    # Of thousands of streams, the way past what matters to extremes alone is seen.
    read: _Reads = figure.read if figure.extreme else figure.reads
    if figure.unit == "time":
        return lambda measured: time_text(read(measured))
    if figure.unit in ("percent", "per second"):
        return lambda measured: rounded(value) if isinstance(value := read(measured), float) else value
    return read


def _read_at_once(figures: Sequence[Figure], of: Of, path: str) -> _Reads:
    """Return what reads the object of figures that is at a path: with one look, where one part has all of them."""
    parts = {figure.held[0] if figure.held else "" for figure in figures}
    (part, *others) = parts
    keys = [figure.keys[of][len(path) + 1 :] for figure in figures]
    if not part or others or len(figures) < 2 or any("." in key for key in keys):
        return FigureRow(figures, of, path).read
    look = attrgetter(*(figure.held[1] for figure in figures if figure.held))
    whole = attrgetter(part)
    nothing = dict.fromkeys(keys)
    times = [key for key, figure in zip(keys, figures, strict=True) if figure.unit == "time"]
    rates = any(figure.unit in ("percent", "per second") for figure in figures)
    extremes = [key for key, figure in zip(keys, figures, strict=True) if figure.extreme]
    assert not rates, "no part has figures that are rounded"

    def read(measured: Measured) -> dict[str, Any]:
        holder = whole(measured)
        if holder is None:
            return nothing.copy()
        found = dict(zip(keys, look(holder), strict=True))
        for key in times:
            found[key] = time_text(found[key])
        if extremes and not measured.extremes:
            found.update(dict.fromkeys(extremes))
        return found

    return read


COUNTED_OF_LIST = FigureRow((*DIAGNOSIS, *LIST_COUNTERS), Of.LIST)
TELEGRAMS_OF_STREAM = FigureRow((TELEGRAMS,), Of.STREAM)
REMOTE_OF_STREAM = FigureRow((REMOTE,), Of.STREAM)
COUNTED_OF_STREAM = FigureRow((*STREAM_COUNTERS, *INTERVALS), Of.STREAM)
PACE_OF_LIST, PACE_OF_STREAM = FigureRow(PACE, Of.LIST), FigureRow(PACE, Of.STREAM)
FIGURES_OF_NODE = FigureRow((*DIAGNOSIS, *PACE), Of.NODE)
