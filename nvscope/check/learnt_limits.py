"""Limits that captures teach: what was seen, some room, and a number that people would write; and how sure they are."""

from __future__ import annotations

import math
from collections.abc import Sequence

from nvscope.units import count, count_of

_TIMES = (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10)
_PERCENTS = (5, 10, 15, 20, 25, 30, 40, 50, 60, 75, 100)
_SMALL_PERCENTS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 20, 30, 40, 50, 75, 100)
_LIKE_PERCENT = 1
"""An interval is written as a round number where that is so near to it."""

THIN = 300
"""Of fewer, more than one in a hundred could be otherwise, and nobody would have seen it."""


def time_with_room(seen_ns: int, times: float) -> int:
    """Return a round time that is so many times as long as what was seen, or a little longer."""
    wanted = max(seen_ns * times, 1)
    power: float = 10.0 ** math.floor(math.log10(wanted))
    return math.ceil(next(step * power for step in _TIMES if step * power >= wanted * (1 - 1e-9)) - 1e-6)


def percent_with_room(share: float, times: float, steps: Sequence[float] = _PERCENTS) -> float | None:
    """Return a round share in percent that is so many times as large, or a little larger; None above 100 %."""
    wanted = 100 * share * times
    return next((step for step in steps if step >= wanted - 1e-9), None)


def share_with_room(count: int, of: int) -> float:
    """Return a round share in percent, above the one of which so many of so many might be a chance sample (95 %)."""
    # The upper bound of the expectation of so few events, by the normal approximation of their root.
    most = (math.sqrt(count + 1) + 1) ** 2
    return percent_with_room(min(most / of, 1.0), 1.0, _SMALL_PERCENTS) or 100


def round_interval(interval_ns: int) -> int:
    """Return the roundest number that is within 1 % of an interval."""
    for digits in range(1, 4):
        step = 10.0 ** max(math.floor(math.log10(max(interval_ns, 1))) - digits + 1, 0)
        near = round(round(interval_ns / step) * step)
        if abs(near - interval_ns) * 100 <= _LIKE_PERCENT * interval_ns:
            return near
    return interval_ns


def how_sure(of: int, unit: str) -> str:
    """Return what can be said where something never was so, of so many: the rule of three."""
    if of < THIN:
        return f"none of {count_of(of, unit)}, which makes it hardly more than a guess"
    return f"none of {count_of(of, unit)}, so fewer than 1 in {count(of // 3)} (95 % sure)"
