"""The intervals of a stream as data, in ``nvscope.report/1``."""

from __future__ import annotations

from nvscope.tracker.intervals import IntervalFigures


def interval_row(intervals: IntervalFigures) -> dict[str, int | None]:
    """Return count and nanoseconds; None for what is not known."""
    return {
        "count": intervals.count,
        "min": intervals.minimum,
        "mean": intervals.mean,
        "max": intervals.maximum,
        "stddev": intervals.deviation,
        "p50": intervals.p50,
        "p95": intervals.p95,
        "p99": intervals.p99,
        "nominal": intervals.nominal,
    }
