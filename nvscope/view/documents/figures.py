"""Figures as data: absolute times are decimal strings of ns, since JavaScript cannot hold them as numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from operator import attrgetter, itemgetter
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
    Unit,
)
from nvscope.tracker.measured import Measured
from nvscope.view.documents.drawn import Shape

ROUNDED: tuple[Unit, ...] = ("percent", "per second")
"""Units of which a report has three decimals."""

_Reads = Callable[[Measured], Any]
_Columns = Callable[[Sequence[Measured]], list[Sequence[Any]]]


def time_text(time_ns: int | None) -> str | None:
    """Return an absolute time as the report has it."""
    return None if time_ns is None else str(time_ns)


def rounded(number: float) -> float:
    """Return a percentage or a rate as the report has it."""
    return round(number, 3)


class FigureRow:
    """Some figures of one kind of thing, as the part of its JSON object that holds them.

    Keys are in the order given, and nested as the paths of the table are. ``within`` is a path: then they are those of
    the object there. ``reads`` has by key what reads its part of what was measured, ``shape`` by key the keys of the
    object that is there, None where it is a figure.
    """

    def __init__(self, figures: Iterable[Figure], of: Of, within: str = "") -> None:
        by_key: dict[str, list[Figure]] = defaultdict(list)
        for figure in figures:
            path = figure.keys[of]
            assert not within or path.startswith(f"{within}."), f"{figure.name} is not within {within}"
            by_key[path[len(within) + 1 if within else 0 :].partition(".")[0]].append(figure)
        self.reads: dict[str, _Reads] = {}
        self.shape: dict[str, Shape | None] = {}
        self._together: list[_Columns] = []
        alone: list[Figure] = []
        for key, own in by_key.items():
            path = f"{within}.{key}" if within else key
            if own[0].keys[of] == path:
                self.reads[key], self.shape[key] = _reading(own[0]), None
                alone.append(own[0])
                continue
            inner = FigureRow(own, of, path)
            self.reads[key], self.shape[key] = inner.read, inner.shape
            self._together += [*_together(alone), inner.columns]
            alone = []
        self._together += _together(alone)
        part, *others = {figure.held[0] if figure.held else "" for figure in alone} or {""}
        # Of one thing at a time, too, one look is faster than several.
        at_once = part and not others and len(alone) == len(self.shape) > 1
        self._one = _at_once(part, alone) if at_once else None

    def read(self, measured: Measured) -> dict[str, Any]:
        """Return the figures of what was measured; None for what is not known."""
        if self._one is None:
            return {key: read(measured) for key, read in self.reads.items()}
        return dict(zip(self.shape, self._one(measured), strict=True))

    def columns(self, measured: Sequence[Measured]) -> list[Sequence[Any]]:
        """Return the same of many things as columns: one of each figure, in the order of the keys."""
        return [column for read in self._together for column in read(measured)]


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
    if figure.unit in ROUNDED:
        return lambda measured: rounded(value) if isinstance(value := read(measured), float) else value
    return read


def _together(figures: Sequence[Figure]) -> list[_Columns]:
    """Return what reads figures as columns: with one look at each thing where one part of it has several."""
    return [
        _held(part, list(own)) if part else _one_by_one(list(own))
        for part, own in groupby(figures, key=lambda figure: figure.held[0] if figure.held else "")
    ]


def _one_by_one(figures: Sequence[Figure]) -> _Columns:
    reads = [_reading(figure) for figure in figures]
    return lambda measured: [[read(one) for one in measured] for read in reads]


def _at_once(part: str, figures: Sequence[Figure]) -> Callable[[Measured], Sequence[Any]]:
    """Return what reads figures of one thing that one part of it has."""
    assert not any(figure.unit in ROUNDED for figure in figures), "no part has figures that are rounded"
    names = [figure.held[1] for figure in figures if figure.held]
    whole, look = attrgetter(part), itemgetter(*names) if part == "counters" else attrgetter(*names)
    nothing = (None,) * len(names)
    times = [place for place, figure in enumerate(figures) if figure.unit == "time"]
    extremes = [place for place, figure in enumerate(figures) if figure.extreme]

    def read(measured: Measured) -> Sequence[Any]:
        holder = whole(measured)
        if not holder:  # who counts nothing has no counters
            return nothing
        found = look(holder)
        if not times and (measured.extremes or not extremes):
            return found
        found = list(found)
        for place in times:
            found[place] = time_text(found[place])
        if not measured.extremes:
            for place in extremes:
                found[place] = None
        return found

    return read


def _held(part: str, figures: Sequence[Figure]) -> _Columns:
    if len(figures) == 1:
        return _one_by_one(figures)
    read = _at_once(part, figures)
    return lambda measured: list(zip(*map(read, measured), strict=True))


COUNTED_OF_LIST = FigureRow((*DIAGNOSIS, *LIST_COUNTERS), Of.LIST)
TELEGRAMS_OF_STREAM = FigureRow((TELEGRAMS,), Of.STREAM)
REMOTE_OF_STREAM = FigureRow((REMOTE,), Of.STREAM)
COUNTED_OF_STREAM = FigureRow((*STREAM_COUNTERS, *INTERVALS), Of.STREAM)
PACE_OF_LIST, PACE_OF_STREAM = FigureRow(PACE, Of.LIST), FigureRow(PACE, Of.STREAM)
FIGURES_OF_NODE = FigureRow((*DIAGNOSIS, *PACE), Of.NODE)
