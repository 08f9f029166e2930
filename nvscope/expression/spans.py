"""Bytes of many telegrams compared and searched at once: spans of one buffer, never an object a telegram."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.expression.typed_columns import BytesColumn, Numbers

_JOINED_ROWS = 4096
_LOOKED_AT = 16
"""Of longer bytes that are searched for, so many are looked for everywhere at once: where these are, Python's search,
which is linear whatever repeats itself, goes through the span."""


def constant_span(value: bytes) -> BytesColumn:
    """Return some bytes as a column of one row, which stands for as many as there are on the other side."""
    return BytesColumn(np.frombuffer(value, np.uint8), np.zeros(1, np.int64), np.full(1, len(value), np.int64))


def equal(left: BytesColumn, right: BytesColumn) -> Bool:
    """Tell which spans have the same bytes."""
    left, right = _alike(left, right)
    size = left.stop - left.start
    same: Bool = size == right.stop - right.start
    rows = np.flatnonzero(same)
    for position in range(int(size[rows].max(initial=0))):
        inside = size[rows] > position
        differ = np.zeros(len(rows), np.bool_)
        differ[inside] = _byte(left, rows[inside], position) != _byte(right, rows[inside], position)
        same[rows[differ]] = False
        rows = rows[inside & ~differ]
    return same


def order(left: BytesColumn, right: BytesColumn) -> Numbers:
    """Return -1, 0 or 1 where left is below, the same as or above right, as int8.

    As in Wireshark, what is longer is above; only of the same length do the bytes decide, the first that differ.
    """
    left, right = _alike(left, right)
    size = left.stop - left.start
    found: Numbers = np.sign(size - (right.stop - right.start)).astype(np.int8)
    rows = np.flatnonzero((found == 0) & (size > 0))
    position = 0
    while len(rows):
        ours, theirs = _byte(left, rows, position), _byte(right, rows, position)
        found[rows[ours < theirs]] = -1
        found[rows[ours > theirs]] = 1
        position += 1
        rows = rows[(ours == theirs) & (size[rows] > position)]
    return found


def contains(column: BytesColumn, wanted: bytes) -> Bool:
    """Tell which spans have the wanted bytes in a row somewhere; no bytes are in every span."""
    if not wanted or not len(column.start):
        return np.ones(len(column.start), np.bool_)
    filled = column.stop > column.start
    if not filled.any():
        return filled
    # All of the buffer that the spans lie in is searched at once, then places are told to spans.
    begin, end = int(column.start[filled].min()), int(column.stop[filled].max())
    region = column.data[begin:end]
    places = len(region) - len(wanted) + 1
    if places <= 0:
        return np.zeros(len(column.start), np.bool_)
    # Zeros are everywhere; a byte that is not common leaves less to look at.
    anchor = next((at for at, byte in enumerate(wanted) if byte not in (0, 0xFF)), 0)
    hits = np.flatnonzero(region[anchor : anchor + places] == wanted[anchor])
    looked_at = min(max(anchor - _LOOKED_AT // 2, 0), max(len(wanted) - _LOOKED_AT, 0))
    for at in range(looked_at, min(looked_at + _LOOKED_AT, len(wanted))):
        if not len(hits):
            break
        if at != anchor:
            hits = hits[region[hits + at] == wanted[at]]
    hits += begin
    first = np.searchsorted(hits, column.start)
    last = np.searchsorted(hits, column.stop - len(wanted), side="right")
    found: Bool = first < last
    if len(wanted) > _LOOKED_AT:
        for row in np.flatnonzero(found).tolist():
            found[row] = wanted in column.data[column.start[row] : column.stop[row]].tobytes()
    return found


def part(column: BytesColumn, start: int, stop: int | None, length: int | None) -> tuple[BytesColumn, Bool]:
    """Return a part of every span, and which spans have it whole; the others hold anything.

    From ``start``, from the end where negative, up to and without ``stop`` (None: to the end, which is at least one
    byte), or, where ``length`` is given, so many.
    """
    size = column.stop - column.start
    begin = size + start if start < 0 else np.full_like(size, start)
    if length is not None:
        end = begin + length
    elif stop is None:
        end = size
    else:
        end = size + stop if stop < 0 else np.full_like(size, stop)
    whole: Bool = (begin >= 0) & (begin < end) & (end <= size)
    return (
        BytesColumn(column.data, column.start + np.where(whole, begin, 0), column.start + np.where(whole, end, 0)),
        whole,
    )


def joined(columns: Sequence[BytesColumn], known: Bool | None) -> BytesColumn:
    """Return the spans of several columns one behind the other, row for row; rows that are not known are empty."""
    sizes = [
        column.stop - column.start if known is None else (column.stop - column.start) * known for column in columns
    ]
    total: I64 = reduce(np.add, sizes)
    stop: I64 = np.cumsum(total)
    data = np.empty(int(stop[-1]) if len(stop) else 0, np.uint8)
    at = stop - total
    for column, size in zip(columns, sizes, strict=True):
        # An index of each byte takes eight: not of all rows at once.
        for first in range(0, len(size), _JOINED_ROWS):
            rows = slice(first, first + _JOINED_ROWS)
            count = size[rows]
            inside = np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)
            data[np.repeat(at[rows], count) + inside] = column.data[np.repeat(column.start[rows], count) + inside]
        at = at + size
    return BytesColumn(data, stop - total, stop)


def _alike(left: BytesColumn, right: BytesColumn) -> tuple[BytesColumn, BytesColumn]:
    count = max(len(left.start), len(right.start)) if len(left.start) and len(right.start) else 0
    return _repeated(left, count), _repeated(right, count)


def _repeated(column: BytesColumn, count: int) -> BytesColumn:
    if len(column.start) == count:
        return column
    return BytesColumn(column.data, np.broadcast_to(column.start, count), np.broadcast_to(column.stop, count))


def _byte(column: BytesColumn, rows: I64, position: int) -> Numbers:
    found: Numbers = column.data[column.start[rows] + position]
    return found
