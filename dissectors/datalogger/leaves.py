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
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from dissectors.batch import I64, U8, Bool

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
_SIZES = np.array([0, 1, 2, 3, 4, 6, 8, 8, 0, 0], np.uint8)
# A signed integer is within so many bits without its sign; the type is how many of these bounds it is beyond.
_BOUNDS = tuple((1 << bits) - 1 for bits in (7, 15, 23, 31, 47))
_ROUND_SIZES = {0: 1, 1: 1, 2: 2, 3: 4, 4: 4, 6: 8, 8: 8}
_TEXT, _FIRST_LONG_TEXT = 13, 58
"""The type of an empty text; from so many bytes on, the type takes two."""

Matrix = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class NumberColumns:
    """Numbers of columns that follow each other: int64 or float64 of shape (n, columns), ``null`` where there is none.

    ``null`` is None where none is. NaN is NULL, as SQLite has none.
    """

    numbers: Matrix
    null: Bool | None = None

    @property
    def columns(self) -> int:
        return int(self.numbers.shape[1])


@dataclass(frozen=True, slots=True)
class TextColumn:
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


@dataclass(frozen=True, slots=True)
class Leaves:
    """The pages of a table: those of its rows, and the last rowid of each; rowids count from 1."""

    pages: list[bytes]
    last_rowids: list[int]
    size_bytes: int
    """Of all rows, with their offsets."""

    def tree(self, first_page: int) -> tuple[bytes, list[bytes]]:
        """Return the root of the table, and the pages below it, of which the first has this number."""
        return (self.pages[0], []) if len(self.pages) == 1 else (self._root(first_page), self.pages)

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


@dataclass(frozen=True, slots=True)
class _Slots:
    """Bytes that a row may have, in their order, (n, slots), and which of them it has."""

    bytes: U8
    kept: Bool


def leaves_of(blocks: Sequence[Block], rows: int) -> Leaves | None:
    """Return the pages of rows; None where one is too long for a page, or all are too many for one root."""
    if not rows:
        return Leaves([], [], 0)
    types: list[_Slots] = []
    bodies: list[_Slots] = []
    for block in blocks:
        own = _texts(block) if isinstance(block, TextColumn) else _numbers(block)
        types.append(own[0])
        bodies.append(own[1])
    body_bytes = _lengths(bodies, rows)
    type_bytes = _lengths(types, rows)
    # The header's length counts itself.
    header_bytes = type_bytes + 1 + (type_bytes + 1 > 127)
    record_bytes = header_bytes + body_bytes
    if int(record_bytes.max()) > _MOST_RECORD_BYTES:
        return None
    head = [_varints(record_bytes), _varints(np.arange(1, rows + 1)), _varints(header_bytes)]
    parts = [*head, *types, *bodies]
    width = sum(part.bytes.shape[1] for part in parts)
    slots, kept = np.empty((rows, width), np.uint8), np.empty((rows, width), np.bool_)
    at = 0
    for part in parts:
        stop = at + part.bytes.shape[1]
        slots[:, at:stop], kept[:, at:stop] = part.bytes, part.kept
        at = stop
    cells: U8 = slots[kept]
    cell_bytes = record_bytes + sum(np.count_nonzero(part.kept, axis=1) for part in head[:2])
    return _paged(cells, np.append(0, np.cumsum(cell_bytes)))


def _paged(cells: U8, at: I64) -> Leaves | None:
    """Return cells, which lie one behind the other, in pages."""
    rows = len(at) - 1
    # What each row takes of a page, with its offset.
    taken = at + _POINTER_BYTES * np.arange(rows + 1)
    pages: list[bytes] = []
    last: list[int] = []
    first = 0
    while first < rows:
        stop = int(np.searchsorted(taken, taken[first] + PAGE_BYTES - _HEAD_BYTES, "right")) - 1
        begin = PAGE_BYTES - int(at[stop] - at[first])
        head = bytes([_LEAF, 0, 0]) + (stop - first).to_bytes(2, "big")
        head += (begin % PAGE_BYTES).to_bytes(2, "big") + b"\0"
        head += (at[first:stop] - at[first] + begin).astype(">u2").tobytes()
        pages.append(head.ljust(begin, b"\0") + cells[at[first] : at[stop]].tobytes())
        last.append(stop)
        first = stop
    return Leaves(pages, last, int(taken[-1])) if len(pages) <= _MOST_LEAVES else None


def _numbers(block: NumberColumns) -> tuple[_Slots, _Slots]:
    numbers, null = block.numbers, block.null
    if numbers.dtype.kind == "f":
        null = np.isnan(numbers) if null is None else null | np.isnan(numbers)
        # A real number without a fraction is kept as an integer where that is shorter (section 2.1).
        whole = ~null & (numbers == np.trunc(numbers)) & (np.abs(numbers) < float(1 << 47))
        integers = np.where(whole, numbers, 0).astype(np.int64)
        kind = np.where(whole, _integer_types(integers), np.uint8(_REAL))
        words = np.where(whole, integers, np.ascontiguousarray(numbers).view(np.int64))
    else:
        kind, words = _integer_types(numbers), numbers
    if null is not None:
        kind[null] = _NULL
    size = _SIZES[kind]
    most = int(size.max(initial=0))
    round_size = _ROUND_SIZES[most]
    body = np.ascontiguousarray(words.astype(f">i{round_size}")).view(np.uint8).reshape(*kind.shape, round_size)
    body = body[:, :, round_size - most :]
    kept = np.arange(most, dtype=np.uint8) >= (most - size)[:, :, np.newaxis]
    rows = len(kind)
    return (
        _Slots(kind, np.ones(kind.shape, np.bool_)),
        _Slots(body.reshape(rows, -1), kept.reshape(rows, -1)),
    )


def _integer_types(numbers: Matrix) -> U8:
    """Return the shortest type of each integer; 0 and 1 have types of their own."""
    folded = numbers ^ (numbers >> 63)
    most = int(folded.max(initial=0))
    kind: U8 = np.ones(numbers.shape, np.uint8)
    for bound in _BOUNDS:
        if most > bound:
            kind += folded > bound
    small = (numbers == 0) | (numbers == 1)
    kind[small] = numbers[small].astype(np.uint8) + np.uint8(_ZERO)
    return kind


def _texts(column: TextColumn) -> tuple[_Slots, _Slots]:
    length = column.stop - column.start
    if column.null is not None:
        length = np.where(column.null, 0, length)
    most = int(length.max(initial=0))
    place = np.arange(most)
    kept: Bool = place < length[:, np.newaxis]
    at = np.minimum(column.start[:, np.newaxis] + place, max(len(column.data) - 1, 0))
    body: U8 = column.data[at] if len(column.data) else np.zeros(at.shape, np.uint8)
    kind = 2 * length + _TEXT
    if column.null is not None:
        kind = np.where(column.null, _NULL, kind)
    return _varints(kind), _Slots(body, kept)


def _varints(numbers: I64) -> _Slots:
    """Return variable-length integers: seven bits a byte, the highest ones first; all but the last have bit 7 set."""
    width = max(1, -(-int(numbers.max(initial=0)).bit_length() // 7))
    slots, kept = np.empty((len(numbers), width), np.uint8), np.ones((len(numbers), width), np.bool_)
    for place in range(width):
        above = 7 * (width - 1 - place)
        slots[:, place] = (numbers >> above & 0x7F) | (0x80 if above else 0)
        if above:
            kept[:, place] = numbers >= 1 << above
    return _Slots(slots, kept)


def _varint(number: int) -> bytes:
    slots = _varints(np.array([number]))
    return slots.bytes[slots.kept].tobytes()


def _lengths(parts: Sequence[_Slots], rows: int) -> I64:
    total = np.zeros(rows, np.int64)
    for part in parts:
        total += np.count_nonzero(part.kept, axis=1)
    return total
