"""What is told of a stream's intervals: extremes, mean and deviation, percentiles, and the nominal interval."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace

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


@dataclass(frozen=True, slots=True)
class IntervalFigures:
    """Intervals of a stream in ns; None where there is none. Percentiles are within 0.5 %, the rest is exact.

    ``nominal`` is what the list should be sent at; where nobody says how it is sent, the median of a cyclic stream.
    """

    count: int
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
        self._rows = _rows(self._histograms.percentiles(_PERCENTS))

    def of(self, stream: int, nominal: int | None = None) -> IntervalFigures:
        """Return those of a stream; ``nominal`` is what it is defined to have, 0 for none, None where nobody says."""
        row = self._rows.get(stream)
        if row is None:
            return IntervalFigures(0, nominal=nominal or None)
        timing, known = self._timing, _figures(row, nominal)
        return replace(known, mean=timing.mean_ns(stream), deviation=timing.deviation_ns(stream))

    def together(self, group_of: I64, nominal: Mapping[int, int | None]) -> dict[int, IntervalFigures]:
        """Return those of streams taken together, by group; of a deviation nothing is said.

        ``group_of`` has the group of each stream, -1 for none, ``nominal`` is as for ``of``, by group. Groups
        without intervals are not there.
        """
        grouped = np.flatnonzero(group_of >= 0)
        alone = np.bincount(group_of[grouped])[group_of[grouped]] == 1
        found = {
            group: replace(self.of(stream, nominal.get(group)), deviation=None)
            for stream, group in zip(grouped[alone].tolist(), group_of[grouped[alone]].tolist(), strict=True)
            if stream in self._rows
        }
        if alone.all():
            return found
        several = group_of.copy()
        several[grouped[alone]] = -1
        total_ns: dict[int, int] = defaultdict(int)
        for group, own_ns in zip(several.tolist(), self._timing.columns.column("total_ns").tolist(), strict=False):
            total_ns[group] += own_ns
        for group, row in _rows(self._histograms.percentiles(_PERCENTS, several)).items():
            found[group] = replace(_figures(row, nominal.get(group)), mean=divide(total_ns[group], row[0]))
        return found


_PERCENTS = (5, 50, 95, 99)
_Row = tuple[int, ...]
"""Count, least, most, and the percentiles, of a stream."""


def _rows(known: StreamPercentiles) -> dict[int, _Row]:
    columns = known.count, known.least_ns, known.most_ns, *(known.at_ns[percent] for percent in _PERCENTS)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return dict(zip(known.stream.tolist(), rows, strict=True))


def _figures(row: _Row, nominal: int | None) -> IntervalFigures:
    count, least, most, p5, p50, p95, p99 = row
    cyclic = count >= CYCLIC_FROM_INTERVALS and p50 > 0 and 100 * (p95 - p5) <= CYCLIC_SPREAD_PERCENT * p50
    return IntervalFigures(
        count,
        known_extreme(least),
        None,
        known_extreme(most),
        None,
        p50,
        p95,
        p99,
        (p50 if cyclic else None) if nominal is None else nominal or None,
    )
