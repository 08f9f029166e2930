"""Intervals of a stream, and what follows from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isqrt
from typing import Any

from tests.oracle.rules.keys import Moment, StreamKey
from tests.oracle.rules.notes import Notes

CYCLIC_INTERVALS = 5


def nearest_rank(ordered: Sequence[int], percent: int) -> int:
    return ordered[(percent * len(ordered) + 99) // 100 - 1]


def round_root(square: Fraction) -> int:
    """Round the square root of a number to an integer, half to even, exactly."""
    root = isqrt(square.numerator // square.denominator)
    half = (Fraction(root) + Fraction(1, 2)) ** 2
    if square == half:
        return root + root % 2
    return root + (square > half)


def within(low: Fraction | int, value: Fraction | int, high: Fraction | int) -> bool:
    return low <= value <= high


@dataclass(frozen=True)
class Timing:
    """What the intervals of a stream amount to."""

    intervals: tuple[int, ...]

    def percentile(self, percent: int) -> int | None:
        return nearest_rank(sorted(self.intervals), percent) if self.intervals else None

    @property
    def spread(self) -> tuple[int, int] | None:
        """p95 − p5 and the median."""
        p5, p50, p95 = self.percentile(5), self.percentile(50), self.percentile(95)
        return None if p5 is None or p50 is None or p95 is None else (p95 - p5, p50)

    @property
    def nominal(self) -> int | None:
        if self.spread is None or len(self.intervals) < CYCLIC_INTERVALS:
            return None
        width, median = self.spread
        return median if median > 0 and 2 * width <= median else None

    @property
    def nominal_uncertain(self) -> bool:
        """Whether percentiles that are a little off could tell otherwise."""
        if self.spread is None or len(self.intervals) < CYCLIC_INTERVALS:
            return False
        width, median = self.spread
        if median == 0:
            return width == 0
        p5, p95 = self.percentile(5) or 0, self.percentile(95) or 0
        slack = Fraction(max(abs(p5), abs(p95), abs(median)), 50) * 2 + 2
        return abs(Fraction(median, 2) - width) <= slack

    @property
    def jitter(self) -> Fraction | None:
        """How far p99 lies from p50, in percent of the nominal interval."""
        p50, p99 = self.percentile(50), self.percentile(99)
        return None if p50 is None or p99 is None or not self.nominal else Fraction(100 * (p99 - p50), self.nominal)

    @property
    def jitter_room(self) -> Fraction:
        """How far off that may be where both percentiles are 1 % off, and all of them a few ns."""
        return Fraction(2 * abs(self.percentile(99) or 0) + 200, self.nominal) if self.nominal else Fraction()

    def report(self) -> dict[str, Any]:
        count = len(self.intervals)
        if not count:
            names = ("min", "mean", "max", "stddev", "p50", "p95", "p99", "nominal")
            return {"count": 0, **dict.fromkeys(names), "_nominal_uncertain": False}
        mean = Fraction(sum(self.intervals), count)
        variance = Fraction(sum(interval**2 for interval in self.intervals), count) - mean**2
        return {
            "count": count,
            "min": min(self.intervals),
            "mean": round(mean),
            "max": max(self.intervals),
            "stddev": round_root(variance),
            "p50": self.percentile(50),
            "p95": self.percentile(95),
            "p99": self.percentile(99),
            "nominal": self.nominal,
            "_nominal_uncertain": self.nominal_uncertain,
        }


def judge_silence(notes: Notes, at: StreamKey, last: Moment, timing: Timing, end: int) -> None:
    """Find out whether a stream stopped long before the end of the run; ``last`` is when its last telegram came."""
    silent = end - last.time
    if timing.nominal and silent > 10 * timing.nominal:
        notes.find("NV504", at.list_key, at.node, at.subindex, last)
    borderline = timing.nominal and within(Fraction(98, 10), Fraction(silent, timing.nominal), Fraction(102, 10))
    if timing.nominal_uncertain or borderline:
        notes.doubt("NV504", at)
