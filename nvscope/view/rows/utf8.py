"""Texts of telegrams as UTF-8, a whole column at once."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, U32, Bool
from nvscope.expression.typed_columns import Numbers

_PIECE_BYTES = 1 << 20  # what is made of a piece of text is some ten times as large
_REPLACEMENT = 0xFFFD
_HIGH, _LOW, _BEHIND = 0xD800, 0xDC00, 0xE000
_FIRST_OF_WIDTH = ((2, 0x80, 0xC0), (3, 0x800, 0xE0), (4, 0x10000, 0xF0))


class Utf8Column(Struct, frozen=True):
    """Texts in UTF-8: that of row i is ``data[offset[i] : offset[i + 1]]``. Offsets int64 of shape (n + 1,)."""

    offset: I64
    data: U8

    def __len__(self) -> int:
        return len(self.offset) - 1

    def texts(self) -> list[str]:
        """Return the texts as Python has them."""
        data = self.data.tobytes()
        bounds = self.offset.tolist()
        return [data[start:stop].decode() for start, stop in itertools.pairwise(bounds)]


def latin_column(cells: U8) -> Utf8Column:
    """Return texts in ISO-8859-1, each up to its first NUL; shape (n, bytes)."""
    return _joined(len(cells), [_encoded(*_up_to_nul(piece)) for piece in _pieces(cells)])


def utf16_column(cells: U8) -> Utf8Column:
    """Return texts in UTF-16LE, each up to its first NUL, half a character as U+FFFD; shape (n, bytes)."""
    return _joined(
        len(cells), [_encoded(*_paired(*_up_to_nul(piece.view("<u2")))) for piece in _pieces(cells)]
    )  # fmt: skip


def _pieces(cells: U8) -> Iterator[U8]:
    step = max(1, _PIECE_BYTES // cells.shape[1])
    for begin in range(0, len(cells), step):
        yield np.ascontiguousarray(cells[begin : begin + step])


def _up_to_nul(units: Numbers) -> tuple[Numbers, I64]:
    """Return the units of all texts end to end, and how many each has."""
    ends = units == 0
    length = np.where(ends.any(axis=1), ends.argmax(axis=1), units.shape[1])
    return units[np.arange(units.shape[1]) < length[:, np.newaxis]], length


def _paired(units: Numbers, length: I64) -> tuple[U32, I64]:
    """Return the characters that UTF-16 units are, and how many each text has."""
    points = units.astype(np.uint32)
    high, low = (units >= _HIGH) & (units < _LOW), (units >= _LOW) & (units < _BEHIND)
    if not (high | low).any():
        return points, length
    text = np.repeat(np.arange(len(length)), length)
    first = np.flatnonzero(high[:-1] & low[1:] & (text[:-1] == text[1:]))
    pairs = 0x10000 + ((points[first] - _HIGH) << np.uint32(10)) + (points[first + 1] - _LOW)
    points[high | low] = _REPLACEMENT
    points[first] = pairs
    kept = np.ones(len(points), np.bool_)
    kept[first + 1] = False
    return points[kept], length - np.bincount(text[first], minlength=len(length))


def _encoded(points: Numbers, length: I64) -> tuple[U8, I64]:
    """Return characters in UTF-8, and how many bytes each text has."""
    if not len(points) or int(points.max()) < 0x80:
        return points.astype(np.uint8), length
    points = points.astype(np.uint32)
    width = np.ones(len(points), np.int64)
    for _, least, _ in _FIRST_OF_WIDTH:
        width += points >= least
    after = np.cumsum(width)
    data = np.empty(int(after[-1]), np.uint8)
    start = after - width
    _put(data, start, points, width == 1, 0, 0)
    for wide, _, mark in _FIRST_OF_WIDTH:
        own = width == wide
        _put(data, start, points, own, mark, 6 * (wide - 1))
        for behind in range(1, wide):
            _put(data, start + behind, points & 0x3F << 6 * (wide - 1 - behind), own, 0x80, 6 * (wide - 1 - behind))
    total = np.append(0, after)[np.append(0, np.cumsum(length))]
    return data, np.diff(total)


def _put(data: U8, at: I64, points: Numbers, own: Bool, mark: int, shift: int) -> None:
    data[at[own]] = (points[own] >> np.uint32(shift)).astype(np.uint8) | np.uint8(mark)


def _joined(count: int, parts: list[tuple[U8, I64]]) -> Utf8Column:
    offset = np.zeros(count + 1, np.int64)
    if parts:
        np.cumsum(np.concatenate([length for _, length in parts]), out=offset[1:])
    return Utf8Column(offset, np.concatenate([data for data, _ in parts]) if parts else np.empty(0, np.uint8))
