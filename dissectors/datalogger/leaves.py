"""Leaves: rows as the pages in which SQLite keeps them, made of columns.

::

    page   type 13 | freeblock 0 | cells | start of content | fragments 0 | offsets of the cells … | (free) | cells …
    cell   length of the record | rowid | record                 both as variable-length integers
    record length of the header | a type a column … | values …

To hand a row to SQLite value by value takes several times as long as all else that is done with it. A database in
memory that holds some rows costs little to make, and SQLite copies its records as they are.
Source: https://www.sqlite.org/fileformat2.html, sections 1.6 and 2.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from dissectors.datalogger.records import sizes_of

PAGE_BYTES = 1 << 16
"""The largest page there is: no record that is written here is longer than one."""

_LEAF, _INTERIOR = 13, 5
_HEAD_BYTES, _POINTER_BYTES = 8, 2
_MOST_RECORD_BYTES = PAGE_BYTES - 35
"""Longer ones go on in other pages (section 2.3.3.1)."""

_MOST_LEAVES = 4_000
"""So many fit into one interior page, with their last rowids."""

# Of each type of a record: how many bytes the value has. Types from 12 on are texts and blobs.
_NULL, _REAL, _ZERO = 0, 7, 8
_LONG_SIZES = 1, 2, 3, 4, 6, 8
# A signed integer is within so many bits without its sign; the type is how many of these bounds it is beyond.
_BOUNDS = tuple((1 << bits) - 1 for bits in (7, 15, 23, 31, 47))
_ROUND_SIZES = {0: 1, 1: 1, 2: 2, 3: 4, 4: 4, 6: 8, 8: 8}
_TEXT, _FIRST_LONG_TEXT = 13, 58
"""The type of an empty text; from so many bytes on, the type takes two."""

_FEW = 16
"""One of so many values may be short to be looked at by itself."""
_MOSTLY_KEPT = 24
"""Where one byte of so many is left out, to pick the others one by one is faster than to look for stretches."""

Matrix = npt.NDArray[Any]
Part = bytes | memoryview


class NumberColumns(Struct, frozen=True):
    """Numbers of columns that follow each other: signed or float64, (n, columns), ``null`` where there is none.

    ``null`` is None where none is. NaN is NULL, as SQLite has none.
    """

    numbers: Matrix
    null: Bool | None = None

    @property
    def columns(self) -> int:
        return int(self.numbers.shape[1])


class TextColumn(Struct, frozen=True):
    """Texts in UTF-8: that of row i is ``data[start[i] : stop[i]]``; NULL where ``null``, None where none is."""

    data: U8
    start: I64
    stop: I64
    null: Bool | None = None

    @property
    def columns(self) -> int:
        return 1

    def take(self, rows: slice) -> TextColumn:
        """Return the texts of some rows."""
        null = None if self.null is None else self.null[rows]
        return TextColumn(self.data, self.start[rows], self.stop[rows], null)


Block = NumberColumns | TextColumn


class Leaves(Struct, frozen=True):
    """The pages of a table: those of its rows, and the last rowid of each; rowids count from 1.

    A page is what stands in front of its cells, and the cells.
    """

    pages: list[tuple[bytes, memoryview]]
    last_rowids: list[int]
    size_bytes: int
    """Of all rows, with their offsets."""

    def tree(self, first_page: int) -> tuple[Sequence[Part], list[Part]]:
        """Return the root of the table, and the pages below it, of which the first has this number, in parts."""
        if len(self.pages) == 1:
            return self.pages[0], []
        return (self._root(first_page),), [part for page in self.pages for part in page]

    def _root(self, first_page: int) -> bytes:
        """Return the page that names these pages; there are several."""
        children = list(enumerate(self.last_rowids, first_page))
        cells = [page.to_bytes(4, "big") + _varint(rowid) for page, rowid in children[:-1]]
        at, offsets = PAGE_BYTES, b""
        for cell in cells:
            at -= len(cell)
            offsets += at.to_bytes(2, "big")
        head = bytes([_INTERIOR, 0, 0]) + len(cells).to_bytes(2, "big") + (at % PAGE_BYTES).to_bytes(2, "big") + b"\0"
        head += children[-1][0].to_bytes(4, "big") + offsets
        return head.ljust(at, b"\0") + b"".join(reversed(cells))


class _Shaped(Struct, frozen=True):
    """Columns with how they are written: the type of each value, (n, columns), and how many bytes each takes.

    ``types`` are as wide as ``type_bytes`` says, in bytes of variable length where that is not 1. ``words`` are numbers
    of which the last ``most`` bytes are written, at most; None of texts, which are ``text``. ``short`` are the places,
    row by row, of values of fewer bytes; None where they are not few.
    """

    types: Matrix
    type_bytes: int
    size: Matrix
    most: int
    words: Matrix | None = None
    text: TextColumn | None = None
    short: I64 | None = None

    @property
    def width(self) -> int:
        """How many bytes the values may take in a row."""
        return int(self.size.shape[1]) * self.most

    @property
    def row_bytes(self) -> I64:
        """How many bytes the values of each row take."""
        rows, columns = self.size.shape
        if self.short is None:
            total: Matrix = self.size.sum(axis=1, dtype=np.uint16 if self.size.dtype == np.uint8 else np.int64)
            return total.astype(np.int64)
        lacking = np.bincount(self.short // columns, self.most - self.size.ravel()[self.short], rows)
        return self.width - lacking.astype(np.int64)


def leaves_of(blocks: Sequence[Block], rows: int) -> Leaves | None:
    """Return the pages of rows; None where one is too long for a page, or all are too many for one root."""
    if not rows:
        return Leaves([], [], 0)
    shaped = [_text(block) if isinstance(block, TextColumn) else _numbers(block) for block in blocks]
    body_bytes, type_bytes = np.zeros(rows, np.int64), np.zeros(rows, np.int64)
    for one in shaped:
        body_bytes += one.row_bytes
        type_bytes += one.types.shape[1] if one.type_bytes == 1 else _varint_bytes(one.types[:, 0])
    # The header's length counts itself.
    header_bytes = type_bytes + 1 + (type_bytes + 1 > 127)
    record_bytes = header_bytes + body_bytes
    if int(record_bytes.max()) > _MOST_RECORD_BYTES:
        return None
    rowids = np.arange(1, rows + 1)
    heads = [(number, _varint_width(number)) for number in (record_bytes, rowids, header_bytes)]
    width = sum(size for _, size in heads)
    width += sum(one.types.shape[1] * one.type_bytes + one.width for one in shaped)
    slots, kept = np.empty((rows, width), np.uint8), np.ones((rows, width), np.bool_)
    at = 0
    for number, size in heads:
        at = _put_varints(slots, kept, at, number, size)
    for one in shaped:
        if one.type_bytes == 1:
            _put_bytes(slots, at, one.types)
            at += one.types.shape[1]
        else:
            at = _put_varints(slots, kept, at, one.types[:, 0], one.type_bytes)
    for one in shaped:
        at = _put_values(slots, kept, at, one)
    at_cell = np.append(0, np.cumsum(record_bytes + _varint_bytes(record_bytes) + _varint_bytes(rowids)))
    mostly_kept = (slots.size - int(at_cell[-1])) * _MOSTLY_KEPT < slots.size
    cells: U8 = slots[kept] if mostly_kept else slots.ravel().take(np.flatnonzero(kept))
    return _paged(cells, at_cell)


def _paged(cells: U8, at: I64) -> Leaves | None:
    """Return cells, which lie one behind the other, in pages."""
    rows = len(at) - 1
    # What each row takes of a page, with its offset.
    taken = at + _POINTER_BYTES * np.arange(rows + 1)
    pages: list[tuple[bytes, memoryview]] = []
    view = cells.data
    last: list[int] = []
    first = 0
    while first < rows:
        stop = int(np.searchsorted(taken, taken[first] + PAGE_BYTES - _HEAD_BYTES, "right")) - 1
        here, end = int(at[first]), int(at[stop])
        begin = PAGE_BYTES - (end - here)
        head = bytes([_LEAF, 0, 0]) + (stop - first).to_bytes(2, "big")
        head += (begin % PAGE_BYTES).to_bytes(2, "big") + b"\0"
        head += (at[first:stop] + (begin - here)).astype(">u2").tobytes()
        pages.append((head.ljust(begin, b"\0"), view[here:end]))
        last.append(stop)
        first = stop
    return Leaves(pages, last, int(taken[-1])) if len(pages) <= _MOST_LEAVES else None


def _numbers(block: NumberColumns) -> _Shaped:
    numbers, null = block.numbers, block.null
    if numbers.dtype.kind == "f":
        null = np.isnan(numbers) if null is None else null | np.isnan(numbers)
        # A real number without a fraction is kept as an integer where that is shorter (section 2.1).
        whole = ~null & (numbers == np.trunc(numbers)) & (np.abs(numbers) < float(1 << 47))
        integers = np.where(whole, numbers, 0).astype(np.int64)
        kind = np.where(whole, _integer_types(integers, _folded(integers)), np.uint8(_REAL))
        words = np.where(whole, integers, np.ascontiguousarray(numbers).view(np.int64))
    else:
        folded = _folded(numbers)
        if null is None and (shaped := _mostly_long(numbers, folded)):
            return shaped
        kind, words = _integer_types(numbers, folded), numbers
    if null is not None:
        kind *= (~null).view(np.uint8)
    size = sizes_of(kind)
    most = int(size.max(initial=0))
    return _Shaped(kind, 1, size, most, words, short=_few(size != most))


def _few(found: Bool) -> I64 | None:
    """Return the places of what was found, row by row; None where that are not few."""
    return np.flatnonzero(found) if np.count_nonzero(found) * _FEW < found.size else None


def _mostly_long(numbers: Matrix, folded: Matrix) -> _Shaped | None:
    """Return integers of which most need the longest type that any needs; None where others do not."""
    greatest = int(folded.max(initial=0))
    longest = sum(greatest > bound for bound in _BOUNDS)
    short = _few(folded <= _BOUNDS[longest - 1]) if longest else None
    if short is None:
        return None
    kind, size = (np.full(numbers.shape, one, np.uint8) for one in (longest + 1, _LONG_SIZES[longest]))
    few = numbers.reshape(-1)[short]
    kind.reshape(-1)[short] = own = _integer_types(few, folded.reshape(-1)[short])
    size.reshape(-1)[short] = sizes_of(own)
    return _Shaped(kind, 1, size, _LONG_SIZES[longest], numbers, short=short)


def _folded(numbers: Matrix) -> Matrix:
    """Return numbers without their signs: one and the one that it is told from by its sign need as many bits."""
    folded: Matrix = numbers ^ (numbers >> (8 * numbers.itemsize - 1))
    return folded


def _integer_types(numbers: Matrix, folded: Matrix) -> U8:
    """Return the shortest type of each integer; 0 and 1 have types of their own."""
    most = int(folded.max(initial=0))
    kind: U8 = np.ones(numbers.shape, np.uint8)
    for bound in _BOUNDS:
        if most > bound:
            kind += (folded > bound).view(np.uint8)
    small = numbers.view(f"u{numbers.itemsize}") <= 1
    if small.any():
        # To put them where they are takes much longer where they are many.
        kind += small.view(np.uint8) * (numbers.astype(np.uint8) + np.uint8(_ZERO - 1))
    return kind


def _text(column: TextColumn) -> _Shaped:
    length = column.stop - column.start
    if column.null is not None:
        length = np.where(column.null, 0, length)
    kind = 2 * length + _TEXT
    if column.null is not None:
        kind = np.where(column.null, _NULL, kind)
    return _Shaped(
        kind[:, np.newaxis], _varint_width(kind), length[:, np.newaxis], int(length.max(initial=0)), text=column
    )


def _put_values(slots: U8, kept: Bool, at: int, shaped: _Shaped) -> int:
    """Write values from a slot on, and return the slot behind them."""
    rows, (_, columns), most = len(slots), shaped.size.shape, shaped.most
    stop = at + shaped.width
    if not most:
        return stop
    if shaped.text is not None:
        data, start = shaped.text.data, shaped.text.start
        if len(data) == rows * most and (shaped.size == most).all() and (np.diff(start) == most).all():
            _put_bytes(slots, at, data.reshape(rows, most))
            return stop
        within = np.arange(most)
        kept[:, at:stop] = within < shaped.size
        if len(data):
            slots[:, at:stop] = data[np.minimum(start[:, np.newaxis] + within, len(data) - 1)]
        return stop
    assert shaped.words is not None
    round_size = _ROUND_SIZES[most]
    whole = shaped.words.astype(f">i{round_size}", order="C").view(np.uint8).reshape(rows, columns, round_size)
    _put_bytes(slots, at, whole[:, :, round_size - most :].reshape(rows, -1))
    if shaped.short is None:
        for place in range(most):
            np.greater_equal(shaped.size, most - place, out=kept[:, at + place : stop : most])
        return stop
    row, column = np.divmod(shaped.short, columns)
    lacking = most - shaped.size[row, column]
    for place in range(most):
        lacks = lacking > place
        kept[row[lacks], at + most * column[lacks] + place] = False
    return stop


def _put_bytes(slots: U8, at: int, content: U8) -> None:
    """Write as many bytes into each row, from a slot on: a row at a time, and not a byte."""
    piece = f"V{content.shape[1]}"
    np.ndarray((len(slots),), piece, slots, at, slots.strides[:1])[...] = np.ascontiguousarray(content).view(piece)[
        :, 0
    ]


def _put_varints(slots: U8, kept: Bool, at: int, numbers: I64, width: int) -> int:
    """Write integers of variable length from a slot on, and return the slot behind them.

    They are seven bits a byte, the highest ones first; all but the last byte have bit 7 set.
    """
    for place in range(width):
        above = 7 * (width - 1 - place)
        slots[:, at + place] = (numbers >> above & 0x7F) | (0x80 if above else 0)
        if above:
            kept[:, at + place] = numbers >= 1 << above
    return at + width


def _varint_width(numbers: I64) -> int:
    return max(1, -(-int(numbers.max(initial=0)).bit_length() // 7))


def _varint_bytes(numbers: I64) -> I64:
    """Return how many bytes each integer takes."""
    size = np.ones(len(numbers), np.int64)
    for place in range(1, _varint_width(numbers)):
        size += numbers >= 1 << 7 * place
    return size


def _varint(number: int) -> bytes:
    groups = [number >> 7 * place & 0x7F for place in range(max(1, -(-number.bit_length() // 7)))]
    return bytes([*(group | 0x80 for group in groups[:0:-1]), groups[0]])
