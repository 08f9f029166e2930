"""Durations as people write them, as exact integer nanoseconds: ``50ms``, ``2.5s``, ``T#1m30s``, ``-2s``."""

from __future__ import annotations

import re

UNITS_NS = {
    "d": 86_400_000_000_000,
    "h": 3_600_000_000_000,
    "m": 60_000_000_000,
    "min": 60_000_000_000,
    "s": 1_000_000_000,
    "ms": 1_000_000,
    "us": 1_000,
    "µs": 1_000,
    "ns": 1,
}
_LARGEST_NS = 366 * UNITS_NS["d"]
_PREFIX = re.compile(r"(?:L?TIME|L?T)#", re.IGNORECASE)
_PART = re.compile(r"([0-9]+(?:_[0-9]+)*)(\.[0-9]+)?(min|ms|us|µs|ns|d|h|m|s)_?", re.IGNORECASE)


def parse_duration(text: str) -> int:
    """Return a duration in nanoseconds, exactly.

    One or more numbers with units, the largest unit first; only the last number may have decimals. The prefixes of
    IEC 61131-3 literals (``T#``, ``TIME#``, ``LT#``, ``LTIME#``) and a sign are accepted, letters in any case.
    Raises ValueError where the text is something else, is no whole number of nanoseconds, or is longer than 366 days.
    """
    from fractions import Fraction  # noqa: PLC0415  # start-up: few runs are told a duration

    rest = text.strip().replace("μ", "µ")
    prefix = _PREFIX.match(rest)
    rest = rest[prefix.end() :] if prefix else rest
    negative = rest.startswith("-")
    rest = rest[1:] if rest[:1] in {"-", "+"} else rest
    total, previous_unit_ns, closed = Fraction(0), _LARGEST_NS, False
    if not rest or len(rest) > 100:
        raise ValueError(f"'{text[:60]}' is no duration such as 50ms, 2.5s or T#1m30s")
    while rest:
        part = _PART.match(rest)
        if part is None or closed:
            raise ValueError(f"'{text[:60]}' is no duration such as 50ms, 2.5s or T#1m30s")
        whole, decimals, unit = part.groups()
        unit_ns = UNITS_NS[unit.lower()]
        if unit_ns >= previous_unit_ns:
            raise ValueError(f"'{text}': units of a duration go from large to small")
        previous_unit_ns, closed = unit_ns, decimals is not None
        total += Fraction(whole.replace("_", "") + (decimals or "")) * unit_ns
        rest = rest[part.end() :]
    if total.denominator != 1:
        raise ValueError(f"'{text}' is no whole number of nanoseconds")
    if total > _LARGEST_NS:
        raise ValueError(f"'{text}' is longer than 366 days")
    return -int(total) if negative else int(total)


def format_duration(duration_ns: int) -> str:
    """Return the shortest text that ``parse_duration`` reads back as the same number, in one unit: ``50ms``."""
    for unit in ("s", "ms", "us"):
        if duration_ns and duration_ns % UNITS_NS[unit] == 0:
            return f"{duration_ns // UNITS_NS[unit]}{unit}"
    return f"{duration_ns}ns" if duration_ns else "0s"
