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
# The time of day: hour, minute, second, fraction (of ``.trc`` in two parts), half of the day.
_CLOCK = (
    r"(?P<H>\d{1,2}):(?P<M>\d\d):(?P<S>\d\d)(?:[.,](?P<f>\d{1,9})(?:\.(?P<g>\d{1,3}))?)?(?:\s*(?P<half>[ap])\.?m\b\.?)?"
)
_FORMS = tuple(
    re.compile(form.replace("CLOCK", _CLOCK), re.IGNORECASE)
    for form in (
        r"(?P<name>[^\W\d_]{3,})\.?\s+(?P<d>\d{1,2})[.,]?\s+CLOCK\s+(?P<y>\d{4})\b",
        r"(?P<name>[^\W\d_]{3,})\.?\s+(?P<d>\d{1,2}),?\s+(?P<y>\d{4}),?\s+CLOCK",
        r"\b(?P<d>\d{1,2})\.?[ -](?P<name>[^\W\d_]{3,})\.?,?[ -](?P<y>\d{4}),?\s+CLOCK",
        r"\b(?P<d>\d{1,2})\.(?P<m>\d{1,2})\.(?P<y>\d{4}),?\s+CLOCK",
        r"\b(?P<y>\d{4})[-/](?P<m>\d\d)[-/](?P<d>\d\d)(?:T|,?\s+)CLOCK\s?(?P<zone>Z|[+-]\d\d:?\d\d)?",
        r"\b(?P<m>\d{1,2})/(?P<d>\d{1,2})/(?P<y>\d{4}),?\s+CLOCK",
    )
)
_S_NS = 1_000_000_000
_DAY_NS = 86_400 * _S_NS
_MOST_DAYS = 100_000


def epoch_ns(fields: tuple[int, int, int, int, int, int], fraction_ns: int, *, utc: bool = False) -> int | None:
    """Return a date and time of day, of the local time zone unless it is of UTC; None where there is no such date."""
    try:
        return int(datetime(*fields, tzinfo=UTC if utc else None).timestamp()) * _S_NS + fraction_ns
    except (ValueError, OverflowError, OSError):
        return None


def written_ns(text: str, *, utc: bool = False) -> int | None:
    """Return the time of a date and time of day in one of the forms that programs write; None where it is none.

    ::

        Sat Sep 30 10:06:13.191 PM 2017    with English or German names; Sep 30, 2017 …; 30 Sep 2017 …
        18.12.2021 14:28:07.062.1          the fraction of ``.trc``
        2021-12-18 14:28:07.0621           with T or a blank, and a time zone or none
        9/30/2017 3:06:13 PM               month first, where there is AM or PM; else the part above 12 is the day
    """
    match = next((found for form in _FORMS if (found := form.search(text))), None)
    if match is None:
        return None
    told = match.groupdict()
    month = _MONTHS.get(told["name"][:3].lower()) if "name" in told else int(told["m"])
    day, hour = int(told["d"]), int(told["H"])
    if month is None or (told["half"] and not 1 <= hour <= 12):
        return None
    if "/" in match[0] and "zone" not in told and not told["half"]:
        if month <= 12 and day <= 12 and month != day:
            return None
        if month > 12:
            month, day = day, month
    if told["half"]:
        hour = hour % 12 + (12 if told["half"] in "pP" else 0)
    fraction = told["f"] or "0"
    if told["g"]:
        fraction = fraction.ljust(3, "0") + told["g"]
    zone = told.get("zone")
    at_ns = epoch_ns(
        (int(told["y"]), month, day, hour, int(told["M"]), int(told["S"])),
        int(fraction.ljust(9, "0")[:9]),
        utc=utc or bool(zone),
    )
    return at_ns if at_ns is None or not zone else at_ns - _zone_ns(zone)


def _zone_ns(zone: str) -> int:
    if zone in "zZ":
        return 0
    ahead = int(zone[1:3]) * 60 + int(zone[-2:])
    return (-ahead if zone[0] == "-" else ahead) * 60 * _S_NS


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
