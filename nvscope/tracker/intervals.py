"""What is told of a stream's intervals: extremes, mean and deviation, percentiles, and the nominal interval."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.histograms import Histograms, StreamPercentiles, known_extreme
from nvscope.tracker.jitter import Jitter
from nvscope.tracker.timing import Timing
from nvscope.units import divide

CYCLIC_SPREAD_PERCENT = 50
"""A stream is cyclic where its p5 and p95 are no further apart than this share of the median."""

CYCLIC_FROM_INTERVALS = 5
"""So many intervals it takes to say so: two answers that follow each other are no cycle."""


class IntervalFigures(NamedTuple):
    """Intervals of a stream in ns; None where there is none. Percentiles are within 0.5 %, the rest is exact.

    ``nominal`` is what the list should be sent at; where nobody says how it is sent, the median of a cyclic stream.
    """

    count: int  # type: ignore[assignment]  # tuples have a method of this name, which nobody needs
    minimum: int | None = None
    mean: int | None = None
    maximum: int | None = None
    deviation: int | None = None
    p50: int | None = None
    p95: int | None = None
    p99: int | None = None
    nominal: int | None = None

    @property
    def jitter(self) -> Jitter | None:
        """That of the stream, None where it has no nominal interval."""
        return Jitter.of(self.p50, self.p99, self.nominal)


NO_INTERVALS = IntervalFigures(0)


class StreamIntervals:
    """The intervals of all streams over the whole run, from one look at them."""

    def __init__(self, timing: Timing) -> None:
        self._timing = timing
        self._histograms = Histograms(timing)
        known = self._histograms.percentiles(_PERCENTS)
        self._rows = _rows(known)
        self._means, self._deviations = timing.means_ns(known.stream), timing.deviations_ns(known.stream)
        self._places = dict(zip(known.stream.tolist(), range(len(self._rows)), strict=True))

    def of(self, stream: int, nominal: int | None = None) -> IntervalFigures:
        """Return those of a stream; ``nominal`` is what it is defined to have, 0 for none, None where nobody says."""
        place = self._places.get(stream)
        if place is None:
            return IntervalFigures(0, nominal=nominal) if nominal else NO_INTERVALS
        return _figures(self._rows[place], nominal, self._means[place], self._deviations[place])

    def together(self, group_of: I64, nominal: Mapping[int, int | None]) -> dict[int, IntervalFigures]:
        """Return those of streams taken together, by group; of a deviation nothing is said.

        ``group_of`` has the group of each stream, -1 for none, ``nominal`` is as for ``of``, by group. Groups
        without intervals are not there.
        """
        grouped = np.flatnonzero(group_of >= 0)
        alone = np.bincount(group_of[grouped])[group_of[grouped]] == 1
        found = {}
        for stream, group in zip(grouped[alone].tolist(), group_of[grouped[alone]].tolist(), strict=True):
            place = self._places.get(stream)
            if place is not None:
                found[group] = _figures(self._rows[place], nominal.get(group), self._means[place])
        if alone.all():
            return found
        several = group_of.copy()
        several[grouped[alone]] = -1
        total_ns: dict[int, int] = defaultdict(int)
        for group, own_ns in zip(several.tolist(), self._timing.columns.column("total_ns").tolist(), strict=False):
            total_ns[group] += own_ns
        told = self._histograms.percentiles(_PERCENTS, several)
        for group, row in zip(told.stream.tolist(), _rows(told), strict=True):
            found[group] = _figures(row, nominal.get(group), divide(total_ns[group], row[0]))
        return found


_PERCENTS = (5, 50, 95, 99)
_Row = tuple[int, ...]
"""Count, least, most, and the percentiles, of a stream."""


def _rows(known: StreamPercentiles) -> list[_Row]:
    columns = known.count, known.least_ns, known.most_ns, *(known.at_ns[percent] for percent in _PERCENTS)
    return list(zip(*(column.tolist() for column in columns), strict=True))


def _figures(
    row: _Row, nominal: int | None, mean: int | None = None, deviation: int | None = None
) -> IntervalFigures:  # fmt: skip
    count, least, most, p5, p50, p95, p99 = row
    cyclic = count >= CYCLIC_FROM_INTERVALS and p50 > 0 and 100 * (p95 - p5) <= CYCLIC_SPREAD_PERCENT * p50
    return IntervalFigures(
        count,
        known_extreme(least),
        mean,
        known_extreme(most),
        deviation,
        p50,
        p95,
        p99,
        (p50 if cyclic else None) if nominal is None else nominal or None,
    )
