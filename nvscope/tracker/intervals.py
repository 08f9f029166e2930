"""What is told of a stream's intervals: extremes, mean and deviation, percentiles, and the nominal interval."""

from __future__ import annotations

from dataclasses import dataclass, replace

from nvscope.tracker.recent import Recent
from nvscope.tracker.timing import Histogram, Timing

CYCLIC_SPREAD_PERCENT = 50
"""A stream is cyclic where its p5 and p95 are no further apart than this share of the median."""


@dataclass(frozen=True, slots=True)
class Intervals:
    """Intervals of a stream in ns; None where there is none. Percentiles are within 1 %, the rest is exact.

    ``nominal`` is what the list should be sent at, else, of a cyclic stream, the median.
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
    def jitter_percent(self) -> float | None:
        """How far p99 lies from p50, of the nominal interval."""
        if not self.nominal or self.p99 is None or self.p50 is None:
            return None
        return 100 * (self.p99 - self.p50) / self.nominal


class StreamIntervals:
    """The intervals of any stream of a state, of the whole run and of the last minute, from one look at both."""

    def __init__(self, timing: Timing, recent: Recent) -> None:
        self._timing = timing
        self._histograms = timing.histograms()
        self._recent = recent.histograms()

    def of(self, stream: int, nominal: int | None) -> tuple[Intervals, Intervals]:
        """Return the intervals of both; ``nominal`` is what is told of a stream that should have an interval."""
        whole = intervals_of(self._timing, stream, self._histograms.of(stream), nominal)
        last = self._recent.get(stream)
        return whole, Intervals(0, nominal=nominal) if last is None else percentiles_of(last, nominal)


def intervals_of(timing: Timing, stream: int, histogram: Histogram, nominal: int | None = None) -> Intervals:
    """Return the intervals of a whole run; ``nominal`` is what is told of a stream that should have an interval."""
    count = int(timing.columns.count[stream])
    if count <= 0:
        return Intervals(0, nominal=nominal)
    known = percentiles_of(histogram, nominal)
    return replace(known, count=count, mean=timing.mean_ns(stream), deviation=timing.deviation_ns(stream))


def percentiles_of(histogram: Histogram, nominal: int | None = None) -> Intervals:
    """Return what a histogram alone tells."""
    p5, p50, p95, p99 = (histogram.percentile_ns(percent) for percent in (5, 50, 95, 99))
    assert p5 is not None
    assert p50 is not None
    assert p95 is not None
    cyclic = p50 > 0 and 100 * (p95 - p5) <= CYCLIC_SPREAD_PERCENT * p50
    return Intervals(
        int(histogram.count.sum()), histogram.least_ns, None, histogram.most_ns, None,
        p50, p95, p99, nominal or (p50 if cyclic else None),
    )  # fmt: skip
