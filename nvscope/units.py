"""Quantities as people read them: durations, times, counts, bytes, shares, COB-IDs. Integer arithmetic, no locale.

Halves are rounded to even. A regular space separates thousands, or nothing does, where programs read them
(``thousands``); ``view.lines.table.wrap`` keeps such a number on one line.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

_MS_NS = 1_000_000
_S_NS = 1_000_000_000
_SMALL_UNITS = ((1_000, "µs"), (_MS_NS, "ms"), (_S_NS, "s"))
_PAIRED_UNITS = ((1, "min", "s", 60, 60), (60, "h", "min", 60, 24), (3_600, "d", "h", 24, None))


_separator = " "


@contextmanager
def thousands(*, separated: bool) -> Iterator[None]:
    """Have all numbers, in all threads, told as ``1 234 567`` meanwhile, or as ``1234567``."""
    global _separator  # noqa: PLW0603  # who tells a number does not know who is going to read it
    before, _separator = _separator, " " if separated else ""
    try:
        yield
    finally:
        _separator = before


def separator() -> str:
    """Return what stands between thousands: for what is kept of numbers that were told."""
    return _separator


def count(number: int) -> str:
    """Return ``1 234 567`` for 1234567, or ``1234567`` where ``thousands`` says so."""
    return f"{number:,}".replace(",", _separator)


def count_of(number: int, noun: str, plural: str = "") -> str:
    """Return ``1 frame`` or ``1 234 frames``; ``plural`` where the noun does not simply take an s."""
    return f"{count(number)} {noun if number == 1 else plural or noun + 's'}"


def parameter(index: int, subindex: int) -> str:
    """Return ``0x2000:1``, which a parameter is called where nobody has named it."""
    return f"0x{index:04x}:{subindex}"


def endpoint(address: str, port: int) -> str:
    """Return ``192.168.1.20:1202``, or ``[fe80::1]:1202``."""
    return f"[{address}]:{port}" if ":" in address else f"{address}:{port}"


def cob_id(number: int, extended: bool = False) -> str:
    """Return ``0x181``, or ``0x18FF0201`` for an identifier of 29 bits."""
    return f"0x{number:08X}" if extended else f"0x{number:03X}"


def list_key(key: str) -> str:
    """Return the key of a list, as documents have it, as people read it: can/can0/272 is ``can/can0/0x110``.

    Other keys stay as they are; an x behind a number marks identifiers of 29 bits.
    """
    head, _, number = key.rpartition("/")
    digits = number.removesuffix("x")
    if not head.startswith("can/") or not digits.isascii() or not digits.isdigit():
        return key
    return f"{head}/{cob_id(int(digits), extended=number != digits)}"


def short_list_keys(keys: Iterable[str]) -> dict[str, str]:
    """Return by key what people call lists: ``7`` or ``0x110``; ``1203/7``, ``can1/0x110`` where several have that."""
    told = {key: list_key(key) for key in keys}
    short = {key: text.rpartition("/")[2] for key, text in told.items()}
    known = Counter(short.values())
    return {key: text if known[text] == 1 else told[key].partition("/")[2] for key, text in short.items()}


def cob_id_range(first: int, last: int) -> str:
    """Return ``0x181``, or ``0x181 to 0x183``."""
    return cob_id(first) if first == last else f"{cob_id(first)} to {cob_id(last)}"


def ranges(numbers: Iterable[int], told: Callable[[int], str] = str) -> list[str]:
    """Return ``1 to 40`` and ``42`` for these numbers, in order; ``told`` writes one. From three on it is a range."""
    runs: list[list[int]] = []
    for number in sorted(set(numbers)):
        if runs and runs[-1][1] == number - 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return [
        part
        for first, last in runs
        for part in ([f"{told(first)} to {told(last)}"] if last - first > 1 else map(told, range(first, last + 1)))
    ]


def data_size(size_bytes: int) -> str:
    """Return ``512 B``, ``1.2 kB``, ``177.3 MB``: decimal multiples."""
    if size_bytes < 1_000:
        return f"{size_bytes} B"
    divisor = 1_000
    for unit in ("kB", "MB", "GB"):
        tenths = divide(size_bytes * 10, divisor)
        if tenths < 10_000:
            return f"{_with_tenth(tenths)} {unit}"
        divisor *= 1_000
    return f"{_with_tenth(divide(size_bytes * 10, divisor))} TB"


def bit_rate(bits_per_s: int) -> str:
    """Return ``250 kbit/s``, ``33.3 kbit/s``, ``1 Mbit/s``: with a decimal where it is not whole."""
    for unit, factor in (("Mbit/s", 1_000_000), ("kbit/s", 1_000)):
        if bits_per_s >= factor:
            tenths = divide(bits_per_s * 10, factor)
            return f"{_with_tenth(tenths) if tenths % 10 else count(tenths // 10)} {unit}"
    return f"{bits_per_s} bit/s"


def percent(numerator: int, denominator: int) -> str:
    """Return the share as ``0.3 %``, ``12 %``; from 10 % on without a decimal, and ``<0.1 %`` for little but not none.

    A denominator of zero or less has no share: ``-``.
    """
    if denominator <= 0:
        return "-"
    permille = divide(numerator * 1_000, denominator)
    if permille == 0 and numerator > 0:
        return "<0.1 %"
    if abs(permille) < 100:
        return f"{_with_tenth(permille)} %"
    return f"{count(divide(numerator * 100, denominator))} %"


def load(percent_: float) -> str:
    """Return a load or a share that is measured in percent as ``23.1 %``: always with a decimal."""
    return f"{_with_tenth(round(percent_ * 10))} %"


def duration(duration_ns: int) -> str:
    """Return ``850 ns``, ``12.3 ms``, ``1.0 s``, ``2 min 03 s``, ``5 h 07 min`` or ``3 d 04 h``."""
    if duration_ns < 0:
        return f"-{duration(-duration_ns)}"
    if duration_ns < 1_000:
        return f"{duration_ns} ns"
    for unit_ns, unit in _SMALL_UNITS:
        tenths = divide(duration_ns * 10, unit_ns)
        if tenths < (600 if unit == "s" else 10_000):
            return f"{_with_tenth(tenths)} {unit}"
    for part_s, unit, part, per_unit, limit in _PAIRED_UNITS:
        whole, rest = divmod(divide(duration_ns, part_s * _S_NS), per_unit)
        if limit is None or whole < limit:
            return f"{count(whole)} {unit} {rest:02} {part}"
    raise AssertionError("days have no limit")


def rate(per_s: float) -> str:
    """Return how often something comes in a second: ``44/s``, below ten with a decimal, below one as a pause."""
    if per_s >= 9.95:
        return f"{count(round(per_s))}/s"
    return f"{per_s:.1f}/s" if per_s else "0/s"


def iec_time(duration_ns: int) -> str:
    """Return an IEC 61131-3 TIME literal such as ``T#1m2s345ms``, whole milliseconds, the rest cut off."""
    return _iec_duration("T", duration_ns, _MS_NS)


def since(time_ns: int, start_ns: int) -> str:
    """Return the time from one instant to another as an IEC literal, ``T#7s``, with the milliseconds that both show.

    Clock times cut off what is less than a millisecond: so does this, of both, before it subtracts. Else 07.000 would
    be T#6s999ms after 00.000.
    """
    return iec_time((time_ns // _MS_NS - start_ns // _MS_NS) * _MS_NS)


def iec_ltime(duration_ns: int) -> str:
    """Return an IEC 61131-3 LTIME literal such as ``LTIME#1s5us2ns``."""
    return _iec_duration("LTIME", duration_ns, 1)


_IEC_UNITS = (
    (86_400 * _S_NS, "d"),
    (3_600 * _S_NS, "h"),
    (60 * _S_NS, "m"),
    (_S_NS, "s"),
    (_MS_NS, "ms"),
    (1_000, "us"),
    (1, "ns"),
)


def _iec_duration(prefix: str, duration_ns: int, least_ns: int) -> str:
    """Return a duration in units down to ``least_ns``, the rest cut off."""
    rest = abs(duration_ns) // least_ns * least_ns
    sign = "-" if duration_ns < 0 and rest else ""
    parts: list[str] = []
    unit = ""
    for unit_ns, unit in _IEC_UNITS:
        number, rest = divmod(rest, unit_ns)
        if number:
            parts.append(f"{number}{unit}")
        if unit_ns == least_ns:
            break
    return f"{prefix}#{sign}{''.join(parts) or f'0{unit}'}"


def clock_time(time_ns: int, *, utc: bool, digits: int = 3) -> str:
    """Return the time of day of an absolute time: ``14:03:07.123``; ``digits`` of the second, 0 to 9, are cut off."""
    part = _calendar(time_ns, utc)
    fraction = f".{time_ns % _S_NS:09}"[: digits + 1] if digits else ""
    return f"{part.tm_hour:02}:{part.tm_min:02}:{part.tm_sec:02}{fraction}"


def date(time_ns: int, *, utc: bool) -> str:
    """Return the day of an absolute time: ``2024-05-02``."""
    part = _calendar(time_ns, utc)
    return f"{part.tm_year:04}-{part.tm_mon:02}-{part.tm_mday:02}"


def zone(time_ns: int, *, utc: bool) -> str:
    """Return what local time differs from UTC at an absolute time: ``+02:00``, or ``Z`` where UTC is shown."""
    if utc:
        return "Z"
    minutes = _calendar(time_ns, utc).tm_gmtoff // 60
    return f"{'-' if minutes < 0 else '+'}{abs(minutes) // 60:02}:{abs(minutes) % 60:02}"


def absolute_time(time_ns: int, *, utc: bool, digits: int = 3) -> str:
    """Return date and time of day: ``2024-05-02 14:03:07.123``."""
    return f"{date(time_ns, utc=utc)} {clock_time(time_ns, utc=utc, digits=digits)}"


def divide(numerator: int, denominator: int) -> int:
    """Return the quotient rounded to the nearest integer, halves to even; the denominator is positive."""
    quotient, rest = divmod(numerator, denominator)
    return quotient + (2 * rest > denominator or (2 * rest == denominator and quotient % 2 == 1))


def _with_tenth(tenths: int) -> str:
    sign = "-" if tenths < 0 else ""
    return f"{sign}{count(abs(tenths) // 10)}.{abs(tenths) % 10}"


def _calendar(time_ns: int, utc: bool) -> time.struct_time:
    seconds = time_ns // _S_NS
    return time.gmtime(seconds) if utc else time.localtime(seconds)
