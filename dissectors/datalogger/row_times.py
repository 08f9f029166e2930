"""Timestamps of rows, whatever form each of them has: as int64 nanoseconds, with what kind of time it is.

A column that is declared for texts may hold raw numbers, as texts of digits, and one for numbers ISO texts. A session
whose ``tsfmt`` was changed has both in one table.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from dissectors.datalogger.records import Cells, Form
from dissectors.datalogger.timestamps import ISO_BYTES, TimeKind, iso_times, raw_times


class Stamp(IntEnum):
    """What a timestamp is written as; of what is ``NONE`` no time can be told."""

    NONE = 0
    ISO = 1
    RAW_UTC = 2
    RAW_UNSPECIFIED = 3
    RAW_LOCAL = 4


_OF_KIND = np.zeros(4, np.uint8)
_OF_KIND[TimeKind.UNSPECIFIED], _OF_KIND[TimeKind.UTC] = Stamp.RAW_UNSPECIFIED, Stamp.RAW_UTC
_OF_KIND[TimeKind.LOCAL] = _OF_KIND[TimeKind.LOCAL_AMBIGUOUS] = Stamp.RAW_LOCAL

_SECOND_BYTES = 19
"""As long as a text without a fraction of a second."""
_MOST_FRACTION_DIGITS = 9
_MOST_DIGITS = 20
_POINT, _MINUS, _T, _SPACE, _Z, _ZERO = b".-T Z0"


class RowTimes(Struct, frozen=True):
    """Times of rows: ``time_ns`` is 0 where ``stamp`` (``Stamp`` as uint8) is ``NONE``."""

    time_ns: I64
    stamp: U8

    @property
    def valid(self) -> Bool:
        """Where a time can be told."""
        valid: Bool = self.stamp != Stamp.NONE
        return valid


def row_times(cells: Cells, data: U8, encoding: str = "utf-8") -> RowTimes:
    """Return the times that cells tell; their texts lie in ``data`` and are encoded so."""
    count = len(cells)
    times = RowTimes(np.zeros(count, np.int64), np.zeros(count, np.uint8))
    wide = 2 if encoding.startswith("utf-16") else 1
    length = cells.stop - cells.start
    texts = cells.form == Form.TEXT
    if count and texts.all() and (length == ISO_BYTES * wide).all():
        _read_texts(times, slice(None), _characters(data, cells.start, ISO_BYTES, encoding))
        return times
    numbers = np.flatnonzero(cells.form == Form.INTEGER)
    _read_raw(times, numbers, cells.integers[numbers])
    places = np.flatnonzero(texts & (length % wide == 0))
    length = length[places] // wide
    for size in np.flatnonzero(np.bincount(np.minimum(length, _LONGEST + 1), minlength=1)[: _LONGEST + 1]).tolist():
        rows = places[length == size]
        text = _characters(data, cells.start[rows], size, encoding)
        dated = text[:, 4] == _MINUS if size >= _SECOND_BYTES else np.zeros(len(rows), np.bool_)
        if dated.any():
            _read_texts(times, rows[dated], text[dated])
        if size <= _MOST_DIGITS and not dated.all():
            _read_digits(times, rows[~dated], text[~dated])
    return times


_LONGEST = _SECOND_BYTES + 1 + _MOST_FRACTION_DIGITS + 1


def _characters(data: U8, start: I64, count: int, encoding: str) -> U8:
    """Return texts of one length, shape (n, count); what is not of ASCII is 0."""
    if not count or not len(start):
        return np.zeros((len(start), count), np.uint8)
    wide = 2 if encoding.startswith("utf-16") else 1
    windows = np.ndarray((len(data) - count * wide + 1,), f"V{count * wide}", data, 0, (1,))
    text = windows[start].view(np.uint8).reshape(len(start), count * wide)
    if wide == 1:
        return text
    low, high = (text[:, ::2], text[:, 1::2]) if encoding == "utf-16-le" else (text[:, 1::2], text[:, ::2])
    return np.where(high == 0, low, 0).astype(np.uint8)


def _read_raw(times: RowTimes, rows: I64, raw: I64) -> None:
    time_ns, kind, valid = raw_times(raw)
    times.time_ns[rows] = time_ns
    times.stamp[rows] = np.where(valid, _OF_KIND[kind], Stamp.NONE)


def _read_digits(times: RowTimes, rows: I64, text: U8) -> None:
    """Read numbers that were stored as texts."""
    if not text.shape[1]:
        return
    negative = text[:, 0] == _MINUS
    number = np.zeros(len(text), np.uint64)
    valid = np.ones(len(text), np.bool_)
    most = np.uint64((1 << 64) // 10 - 1)
    for place in range(text.shape[1]):
        digit = text[:, place] - np.uint8(_ZERO)
        if place == 0:
            valid &= (digit < 10) | negative
            digit = np.where(negative, 0, digit).astype(np.uint8)
        else:
            valid &= digit < 10
        valid &= number <= most
        number = np.where(valid, number * np.uint64(10) + digit, 0).astype(np.uint64)
    valid &= number <= np.uint64((1 << 63) - 1)
    signed = np.where(valid, number, 0).astype(np.int64)
    good = np.flatnonzero(valid)
    _read_raw(times, rows[good], np.where(negative, -signed, signed)[good])


def _read_texts(times: RowTimes, rows: I64 | slice, text: U8) -> None:
    """Read ISO texts of one length; with fewer or more digits of a second, a space for the T, or Z at the end."""
    size = text.shape[1]
    rest: I64 | None = None
    extra = np.ones(len(text), np.bool_)
    if size != ISO_BYTES or (text[:, 10] != _T).any() or (text[:, -1] == _Z).any():
        text, rest, extra = _evened(text)
    time_ns, valid = iso_times(text)
    valid &= extra
    times.time_ns[rows] = np.where(valid, time_ns if rest is None else time_ns + rest, 0)
    times.stamp[rows] = np.where(valid, Stamp.ISO, Stamp.NONE)


def _evened(text: U8) -> tuple[U8, I64, Bool]:
    """Return texts of the usual length, the nanoseconds that these do not hold, and which texts are of such a form."""
    count, size = text.shape
    whole = np.full((count, _SECOND_BYTES + 1 + _MOST_FRACTION_DIGITS), _ZERO, np.uint8)
    whole[:, :_SECOND_BYTES] = text[:, :_SECOND_BYTES]
    whole[whole[:, 10] == _SPACE, 10] = _T
    whole[:, _SECOND_BYTES] = _POINT
    zoned = (text[:, -1] == _Z) & (size > _SECOND_BYTES)
    end = size - zoned
    valid = (end == _SECOND_BYTES) | ((end > _SECOND_BYTES + 1) & (end <= whole.shape[1]))
    if size > _SECOND_BYTES:
        valid &= (end == _SECOND_BYTES) | (text[:, _SECOND_BYTES] == _POINT)
    for place in range(_SECOND_BYTES + 1, min(size, whole.shape[1])):
        whole[:, place] = np.where(place < end, text[:, place], _ZERO)
    rest = np.zeros(count, np.int64)
    for place in range(ISO_BYTES, whole.shape[1]):
        digit = whole[:, place] - np.uint8(_ZERO)
        valid &= digit < 10
        rest = rest * 10 + digit
    return whole[:, :ISO_BYTES], rest, valid
