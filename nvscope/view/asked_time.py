"""A time in a capture as a person asks for it: absolute, from its start or end, or a frame."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from enum import Enum

from msgspec import Struct

from nvscope.duration import parse_duration
from nvscope.errors import UsageError

_S_NS = 1_000_000_000
_MOST_NS = (1 << 63) - 1
_MOST_FRAME = 10**15
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_TEXT = re.compile(
    r"(?:(?P<date>\d{4}-\d{2}-\d{2})(?:[ T](?P<time>\d{2}:\d{2}(?::\d{2})?))?|(?P<clock>\d{2}:\d{2}(?::\d{2})?))"
    r"(?P<part>\.\d{1,9})?\s*(?P<zone>Z|UTC|[+-]\d{2}:?\d{2})?",
    re.IGNORECASE | re.ASCII,
)

_FROM_ENDS, _ABSOLUTE = "5s after the first frame, -2s before the end", "08:00:01.5, or 2026-01-31 08:00:01.5Z"
_TIMES = f"{_FROM_ENDS}, {_ABSOLUTE}"
_TIMES_OR_FRAMES = f"{_FROM_ENDS}, #1234 for a frame, {_ABSOLUTE}"


class Reference(Enum):
    """What a time counts from."""

    EPOCH = "1970-01-01 UTC"
    DAY = "the day of the first frame"
    START = "the first frame"
    END = "the latest frame"
    FRAME = "frames"


class AskedTime(Struct, frozen=True):
    """``number`` in ns (``FRAME``: the number of the frame), counted from a reference."""

    number: int
    reference: Reference

    def absolute_ns(self, start_ns: int, end_ns: int | None = None, *, utc: bool = False) -> int:
        """Return the time in ns since 1970, of a capture whose first frame is at ``start_ns``; not for ``FRAME``."""
        if self.reference is Reference.START:
            return start_ns + self.number
        if self.reference is Reference.END:
            assert end_ns is not None
            return end_ns + self.number
        if self.reference is Reference.DAY:
            first = datetime.fromtimestamp(start_ns // _S_NS, UTC)
            day = (first if utc else first.astimezone()).replace(hour=0, minute=0, second=0, microsecond=0)
            seconds, rest_ns = divmod(self.number, _S_NS)
            clock = day.replace(hour=seconds // 3_600, minute=seconds // 60 % 60, second=seconds % 60, tzinfo=None)
            return _since_epoch_ns(clock.replace(tzinfo=UTC) if utc else clock.astimezone()) + rest_ns
        return self.number


class AskedRange(Struct, frozen=True):
    """A part of captures, both ends included: times as AskedTime, None for no bound, and how they were asked for."""

    start: AskedTime | None
    end: AskedTime | None
    told_start: str = ""
    told_end: str = ""
    utc: bool = False

    @property
    def told_from_end(self) -> str:
        """How the first time that counts from the end was asked for, '' where none does."""
        asked = ((self.start, self.told_start), (self.end, self.told_end))
        return next((told for one, told in asked if one and one.reference is Reference.END), "")

    @property
    def options(self) -> tuple[str, ...] | None:
        """The words by which they are asked for elsewhere, where times are local; None where there are none."""
        words: list[str] = []
        for one, told in ((self.start, self.told_start), (self.end, self.told_end)):
            if one is not None:
                if one.reference is Reference.DAY and self.utc:
                    return None
                option, text = told.split(" ", 1)
                match = _TEXT.fullmatch(text.strip())
                words += [option, f"{text.strip()}Z" if self.utc and match and not match["zone"] else text]
        return tuple(words)

    @property
    def is_absolute(self) -> bool:
        """Whether it can be told without knowing when captures begin and end."""
        return all(one is None or one.reference is Reference.EPOCH for one in (self.start, self.end))

    def span_ns(self, start_ns: int, end_ns: int | None) -> tuple[int | None, int | None]:
        """Return the bounds in ns since 1970, of captures whose first and latest frame are at these times.

        UsageError where nothing can lie between them.
        """
        begin, end = (
            None if one is None else one.absolute_ns(start_ns, end_ns, utc=self.utc) for one in (self.start, self.end)
        )
        if begin is not None and end is not None and begin > end:
            raise UsageError(f"{self.told_start} lies behind {self.told_end}", next_step="change the one or the other")
        return begin, end


def parse_range(
    start: str | None, end: str | None, *, utc: bool = False, options: tuple[str, str] = ("--from-time", "--to-time")
) -> AskedRange:  # fmt: skip
    """Return what two ``options`` give, None for no bound; as ``parse_time``, but for numbers of frames.

    Frames are counted from the start of what is read: in a range, a number would mean another frame than it says.
    """
    first, second = options
    begin = None if start is None else parse_time(first, start, utc=utc, frames=False)
    last = None if end is None else parse_time(second, end, utc=utc, frames=False)
    return AskedRange(begin, last, f"{first} {start}", f"{second} {end}", utc)


def parse_time(option: str, text: str, *, utc: bool = False, frames: bool = True) -> AskedTime:
    """Return the time that an option gives; without a zone it is local time, or UTC with ``utc``.

    ``2024-05-06 08:00:01.5`` (with Z, UTC or +02:00 behind it if wanted), ``08:00:01.5`` on the day of the first frame,
    ``5s`` or ``+5s`` after the first frame, ``-2s`` before the latest, with ``frames`` also ``#1234`` for a frame.
    UsageError for others.
    """
    wanted = text.strip()
    if wanted.startswith("#") and not frames:
        raise UsageError(f"{option} {text[:60]}: a frame, expected a time", next_step=f"write {_TIMES}")
    if wanted.startswith("#"):
        digits = wanted[1:]
        if digits.isascii() and digits.isdecimal() and len(digits) <= 15 and 1 <= int(digits) <= _MOST_FRAME:
            return AskedTime(int(digits), Reference.FRAME)
    elif match := _TEXT.fullmatch(wanted):
        return _absolute(option, text, match, utc, frames)
    else:
        try:
            number = parse_duration(wanted)
        except ValueError:
            pass
        else:
            return AskedTime(number, Reference.END if "-" in wanted else Reference.START)
    raise _error(option, text, frames)


def _absolute(option: str, text: str, match: re.Match[str], utc: bool, frames: bool) -> AskedTime:
    part = match["part"] or ""
    rest_ns = int(part[1:].ljust(9, "0")) if part else 0
    clock = match["time"] or match["clock"] or "00:00"
    if part and clock.count(":") != 2:
        raise _error(option, text, frames)
    zone = (match["zone"] or "").upper()
    if match["clock"]:
        if zone:
            raise UsageError(f"{option} {text}: a time of day has no zone here", next_step="write the date too")
        hours, minutes, seconds = (int(number) for number in f"{clock}:00".split(":")[:3])
        if hours > 23 or minutes > 59 or seconds > 59:
            raise _error(option, text, frames)
        return AskedTime((hours * 3_600 + minutes * 60 + seconds) * _S_NS + rest_ns, Reference.DAY)
    zone = "+00:00" if zone in ("Z", "UTC") or (not zone and utc) else zone
    try:
        moment = datetime.fromisoformat(f"{match['date']} {clock}{zone}")
        time_ns = _since_epoch_ns(moment if zone else moment.astimezone()) + rest_ns
    except (ValueError, OverflowError, OSError):
        raise _error(option, text, frames) from None
    if abs(time_ns) > _MOST_NS:
        raise UsageError(f"{option} {text}: outside the years 1678 to 2262")
    return AskedTime(time_ns, Reference.EPOCH)


def _since_epoch_ns(moment: datetime) -> int:
    since = moment - _EPOCH
    return (since.days * 86_400 + since.seconds) * _S_NS


def _error(option: str, text: str, frames: bool) -> UsageError:
    return UsageError(
        f"{option} '{text[:60]}': not a time of the capture",
        next_step=f"write {_TIMES_OR_FRAMES if frames else _TIMES}",
    )
