"""Timestamps of DataLogger databases, in both of their forms, as int64 nanoseconds since 1970-01-01 UTC.

``Iso8601`` is a text of 26 characters, UTC without a zone: ``2020-04-13T14:05:58.674675``. ``Raw`` is an integer as
``DateTime.ToBinary`` of .NET makes it: 100-ns ticks since 0001-01-01 in the lower 62 bits, above them what kind of time
that is. Source: the DataLogger's reference, "Time stamp", and ``datalogger.md`` section 2.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from enum import IntEnum

import numpy as np

from dissectors.batch import I32, I64, U8, Bool, Records

ISO_BYTES = 26
"""How long a text is."""

TICK_NS = 100
EPOCH_TICKS = 621_355_968_000_000_000
"""Ticks at 1970-01-01."""

_DAY_S, _HOUR_S, _MINUTE_S, _S_NS, _US_NS = 86_400, 3_600, 60, 1_000_000_000, 1_000
_TICKS = np.int64((1 << 62) - 1)
_KIND_SHIFT = np.int64(62)
_LEAST_NS, _MOST_NS = -(1 << 63), (1 << 63) - 1
_LEAST_TICKS, _MOST_TICKS = EPOCH_TICKS + _LEAST_NS // TICK_NS + 1, EPOCH_TICKS + _MOST_NS // TICK_NS
_YEARS = 1678, 2261
"""Years that are whole in int64 nanoseconds."""

# Where the digits of a number stand, and what stands between them.
_FIELDS = (0, 4), (5, 7), (8, 10), (11, 13), (14, 16)  # year, month, day, hour, minute
_MINUTE_BYTES = 16
_POINT = 19
_MICROSECOND = 20, 26
_BETWEEN = {4: "-", 7: "-", 10: "T", 13: ":", 16: ":", 19: "."}
_ZERO = ord("0")
# Two digits at once: 00 to 99, the first one in the lower byte.
_PAIRS = np.array([(_ZERO + pair // 10) | (_ZERO + pair % 10) << 8 for pair in range(100)], "<u2")
_TRIPLES = np.array([f"{number:03}".encode() for number in range(1000)]).view("V3")

_EPOCH = datetime(1970, 1, 1)  # of UTC, which is not written
_FEW = 32


class TimeKind(IntEnum):
    """What kind of time a raw timestamp is, by its two highest bits; both of local time mean the same."""

    UNSPECIFIED = 0
    UTC = 1
    LOCAL = 2
    LOCAL_AMBIGUOUS = 3


def iso_texts(time_ns: I64) -> U8:
    """Return texts as (n, ``ISO_BYTES``); what is below a microsecond is left out."""
    count = len(time_ns)
    text = np.empty((count, ISO_BYTES), np.uint8)
    us = time_ns // _US_NS
    second = us // 1_000_000
    # Of times that follow each other, many lie in one second.
    start = np.flatnonzero(np.append(True, second[1:] != second[:-1])[:count])
    own = second[start]
    seconds = _few_seconds(own) if len(own) <= _FEW else _seconds(own)
    begin, end = _MICROSECOND
    _fields_of(text, 0, begin)[...] = np.repeat(seconds.view(f"V{begin}").ravel(), np.diff(np.append(start, count)))
    below = us - second * 1_000_000
    thousands = below // 1000
    middle = (begin + end) // 2
    _fields_of(text, begin, middle)[...] = _TRIPLES[thousands]
    _fields_of(text, middle, end)[...] = _TRIPLES[below - thousands * 1000]
    return text


def _fields_of(text: U8, begin: int, end: int) -> Records:
    """Return the same bytes of all texts, to be put at once."""
    return np.ndarray((len(text),), f"V{end - begin}", text, begin, (ISO_BYTES,))


def _few_seconds(second: I64) -> U8:
    """Return what ``_seconds`` does; of few it takes less time."""
    texts = [f"{(_EPOCH + timedelta(0, one)).isoformat()}." for one in second.tolist()]
    return np.frombuffer("".join(texts).encode(), np.uint8).reshape(-1, _MICROSECOND[0])


def _seconds(second: I64) -> U8:
    """Return texts up to the microseconds, as (n, 20)."""
    text = np.empty((len(second), _MICROSECOND[0]), np.uint8)
    for place, character in _BETWEEN.items():
        text[:, place] = ord(character)
    of_day = second % _DAY_S
    _put_date(text, second // _DAY_S)
    _put(text, 11, of_day // _HOUR_S, 2)
    _put(text, 14, of_day // _MINUTE_S % 60, 2)
    _put(text, 17, of_day % 60, 2)
    return text


def _put_date(text: U8, day: I64) -> None:
    date = day.astype("M8[D]")
    month = date.astype("M8[M]")
    year = month.astype("M8[Y]")
    _put(text, 0, (year.astype(np.int64) + 1970), 4)
    _put(text, 5, (month - year).astype(np.int64) + 1, 2)
    _put(text, 8, (date - month).astype(np.int64) + 1, 2)


def iso_times(text: U8) -> tuple[I64, Bool]:
    """Return the times of texts, shape (n, ``ISO_BYTES``), and which of these are times at all; else they are 0."""
    # Of rows that follow each other, many are of one minute, which is read once.
    first = np.flatnonzero(_minutes_begin(text))
    if len(first) == len(text):
        minute_ns, valid = _minutes(text)
    else:
        rows = np.diff(first, append=len(text))
        minute_ns, valid = _minutes(text[first])
        minute_ns, valid = np.repeat(minute_ns, rows), np.repeat(valid, rows)
    behind = np.ascontiguousarray(text[:, _MINUTE_BYTES:].T)
    for place in (_MINUTE_BYTES, _POINT):
        valid &= behind[place - _MINUTE_BYTES] == ord(_BETWEEN[place])
    # Seconds and microseconds as one number.
    us = _number(np.delete(behind, [0, _POINT - _MINUTE_BYTES], axis=0), valid)
    valid &= us < _MINUTE_S * _S_NS // _US_NS
    return np.where(valid, minute_ns + us.astype(np.int64) * _US_NS, 0), valid


def _minutes_begin(text: U8) -> Bool:
    """Return which texts are in another minute than the one before."""
    begins = np.ones(len(text), np.bool_)
    if len(text) > 1:
        text = np.ascontiguousarray(text)
        words = [np.ndarray((len(text),), np.uint64, text, at, text.strides[:1]) for at in (0, 8)]
        begins[1:] = (words[0][1:] != words[0][:-1]) | (words[1][1:] != words[1][:-1])
    return begins


def _minutes(text: U8) -> tuple[I64, Bool]:
    """Return when the minutes of texts begin, and which are some; what is behind them is not looked at."""
    valid = np.ones(len(text), np.bool_)
    characters = np.ascontiguousarray(text[:, :_MINUTE_BYTES].T)
    for place, character in _BETWEEN.items():
        if place < _MINUTE_BYTES:
            valid &= characters[place] == ord(character)
    year, month, day, hour, minute = (
        _number(characters[start:stop], valid).astype(np.int64) for start, stop in _FIELDS
    )  # fmt: skip
    valid &= (year >= _YEARS[0]) & (year <= _YEARS[1]) & (month >= 1) & (month <= 12) & (day >= 1) & (day <= 31)
    valid &= (hour < 24) & (minute < 60)
    first = np.where(valid, (year - 1970) * 12 + month - 1, 0).astype("M8[M]")
    date = first.astype("M8[D]").astype(np.int64) + day - 1
    valid &= date.astype("M8[D]").astype("M8[M]") == first
    return (date * _DAY_S + hour * _HOUR_S + minute * _MINUTE_S) * _S_NS, valid


def raw_of(time_ns: I64) -> I64:
    """Return raw timestamps, as UTC; what is below 100 ns is left out."""
    return (time_ns // TICK_NS + EPOCH_TICKS) | np.int64(TimeKind.UTC << 62)


def raw_times(raw: I64) -> tuple[I64, U8, Bool]:
    """Return the times of raw timestamps, their ``TimeKind``, and which of them can be told; else the time is 0.

    Local times are as they were: ``ToBinary`` writes them as UTC.
    """
    kind = ((raw >> _KIND_SHIFT) & 3).astype(np.uint8)
    ticks = raw & _TICKS
    valid = (ticks >= _LEAST_TICKS) & (ticks <= _MOST_TICKS)
    return np.where(valid, (np.where(valid, ticks, EPOCH_TICKS) - EPOCH_TICKS) * TICK_NS, 0), kind, valid


def _put(text: U8, place: int, number: I64, digits: int) -> None:
    for at in range(place + digits - 2, place - 1, -2):
        text[:, at : at + 2] = _PAIRS[number % 100].view(np.uint8).reshape(-1, 2)
        number = number // 100


def _number(characters: U8, valid: Bool) -> I32:
    """Return the numbers that digits make, given as a row a place, nine at most; ``valid`` is cleared where they are
    none."""
    digits = characters - np.uint8(_ZERO)
    valid &= (digits < 10).all(axis=0)
    number: I32 = digits[0].astype(np.int32)
    for digit in digits[1:]:
        number = number * np.int32(10) + digit
    return number
