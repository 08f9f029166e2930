"""Scales: round numbers and round times between two others, few enough to be written beside a plot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from math import ceil, floor, isfinite, log10
from typing import NamedTuple

_MS_NS = 1_000_000
_S_NS = 1_000_000_000
_MIN_NS = 60 * _S_NS
_HOUR_NS = 60 * _MIN_NS
_DAY_NS = 24 * _HOUR_NS
_TIME_STEPS = (
    *(step * 10**power for power in range(9) for step in (1, 2, 5)),
    *(step * _S_NS for step in (1, 2, 5, 10, 15, 30)),
    *(step * _MIN_NS for step in (1, 2, 5, 10, 15, 30)),
    *(step * _HOUR_NS for step in (1, 2, 3, 6, 12)),
    *(step * _DAY_NS for step in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1_000, 5_000)),
)
_STEPS = (1, 2, 5)
_MOST_STEPS = 30
_FIXED_FROM, _FIXED_TO = 1e-5, 1e9
_MOST_DIGITS = 9
_GAP = 3


class Tick(NamedTuple):
    """A value at a scale, and how it is written."""

    value: float
    text: str


def nice_ticks(
    low: float, high: float, most: int, *, whole: bool = False, text: Callable[[float], str] | None = None
) -> list[Tick]:  # fmt: skip
    """Return at most ``most`` (at least 1) round values between two, in rising order; there may be none.

    ``whole``: whole numbers only. ``text`` writes a value, where it is not a plain number.
    """
    apart = high / most - low / most
    if not (isfinite(apart) and apart > 0):
        return []
    for step in _number_steps(apart, whole=whole):
        first, last = ceil(low / step), floor(high / step)
        if last - first < most:
            values = [one for number in range(first, last + 1) if low <= (one := number * step) <= high]
            greatest = max(abs(low), abs(high))
            return [Tick(one, text(one) if text else _number(one, step, greatest)) for one in values]
    return []


def _number_steps(apart: float, *, whole: bool) -> Iterator[float]:
    """Yield round steps, from about as far apart on as asked for; none at the ends of what numbers there are."""
    power = floor(log10(apart))
    for one in range(_MOST_STEPS):
        with suppress(OverflowError, ZeroDivisionError):
            step = _STEPS[one % len(_STEPS)] * 10.0 ** (power + one // len(_STEPS))
            if isfinite(step) and step >= apart * (1 - 1e-9) and (not whole or step >= 1):
                yield step


def _number(value: float, step: float, greatest: float) -> str:
    """Return a value with as many digits as tell it from the next one."""
    if not value:
        return "0"
    if step >= _FIXED_FROM and greatest < _FIXED_TO:
        return f"{value:.{max(-floor(log10(step) + 1e-9), 0)}f}"
    digits = floor(log10(greatest)) - floor(log10(step) + 1e-9) + 1
    return f"{value:.{min(max(digits, 1), 17)}g}"


def time_ticks(start_ns: int, end_ns: int, cells: int, text: Callable[[int, int], str]) -> list[Tick]:
    """Return round times between two, so far apart that their texts have room in ``cells`` columns.

    ``text`` writes a time with so many digits of the second.
    """
    length_ns = max(end_ns - start_ns, 1)
    for step_ns in _TIME_STEPS:
        digits = _digits(step_ns)
        wanted = len(text(start_ns, digits)) + _GAP
        if step_ns * cells >= wanted * length_ns:
            return [
                Tick(time_ns, text(time_ns, digits))
                for time_ns in range(-(-start_ns // step_ns) * step_ns, end_ns + 1, step_ns)
            ]
    return []


def _digits(step_ns: int) -> int:
    """Return how many digits of the second a multiple of a step has."""
    return next((digits for digits in range(_MOST_DIGITS) if step_ns % 10 ** (_MOST_DIGITS - digits) == 0), 9)
