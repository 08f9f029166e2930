"""The dates that logs begin with, as nanoseconds since 1970: most are in the local time of who recorded."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from decimal import Decimal, InvalidOperation

_MONTHS = {
    name: number
    for number, names in enumerate(
        ("jan", "feb", "mar mär mrz", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov", "dec dez"), 1
    )
    for name in names.split()
}
_NAMED = re.compile(
    r"(\w{3,})\.?\s+(\d{1,2})[.,]?\s+(\d{1,2}):(\d\d):(\d\d)(?:[.,](\d{1,9}))?(?:\s+([ap])m)?\s+(\d{4})\b",
    re.IGNORECASE,
)
_DOTTED = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})\s+(\d{1,2}):(\d\d):(\d\d)(?:\.(\d{3})(?:\.(\d{1,3}))?)?", re.ASCII)
_ISO = re.compile(r"(\d{4})-(\d\d)-(\d\d)[ T](\d\d):(\d\d):(\d\d)(?:\.(\d{1,9}))?", re.ASCII)
_S_NS = 1_000_000_000
_DAY_NS = 86_400 * _S_NS
_MOST_DAYS = 100_000


def epoch_ns(fields: tuple[int, int, int, int, int, int], fraction_ns: int, *, utc: bool = False) -> int | None:
    """Return a date and time of day, of the local time zone unless it is of UTC; None where there is no such date."""
    try:
        return int(datetime(*fields, tzinfo=UTC if utc else None).timestamp()) * _S_NS + fraction_ns
    except (ValueError, OverflowError, OSError):
        return None


def named_ns(text: str) -> int | None:
    """Return the time of ``Sat Sep 30 10:06:13.191 PM 2017``, with English or German months; None where it is none."""
    match = _NAMED.search(text)
    month = match and _MONTHS.get(match[1][:3].lower())
    if not match or not month:
        return None
    hour = int(match[3])
    if match[7]:
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + (12 if match[7] in "pP" else 0)
    fields = int(match[8]), month, int(match[2]), hour, int(match[4]), int(match[5])
    return epoch_ns(fields, _fraction_ns(match[6]))


def numbered_ns(text: str, *, utc: bool = False) -> int | None:
    """Return the time of ``18.12.2021 14:28:07.062.1`` or ``2021-12-18 14:28:07.0621``; None where it is none."""
    if match := _DOTTED.search(text):
        day, month, year, hour, minute, second = (int(match[place]) for place in range(1, 7))
        fraction_ns = int((match[7] or "0").ljust(3, "0")) * 1_000_000 + int((match[8] or "0").ljust(3, "0")) * 1_000
        return epoch_ns((year, month, day, hour, minute, second), fraction_ns, utc=utc)
    if match := _ISO.search(text):
        year, month, day, hour, minute, second = (int(match[place]) for place in range(1, 7))
        return epoch_ns((year, month, day, hour, minute, second), _fraction_ns(match[7]), utc=utc)
    return None


def days_ns(text: str, *, utc: bool = False) -> int | None:
    """Return the time that a number of days since 30 December 1899 is, as spreadsheets have it; None where none is."""
    try:
        days = Decimal(text)
        if not 0 <= days <= _MOST_DAYS:
            return None
        since_ns = round(days * _DAY_NS)
    except (InvalidOperation, ValueError):
        return None
    whole, within_ns = divmod(since_ns, _S_NS)
    told = datetime.fromtimestamp(whole - 25_569 * 86_400, UTC)
    fields = told.year, told.month, told.day, told.hour, told.minute, told.second
    return epoch_ns(fields, within_ns, utc=utc)


def _fraction_ns(digits: str | None) -> int:
    return int((digits or "0").ljust(9, "0")[:9])
