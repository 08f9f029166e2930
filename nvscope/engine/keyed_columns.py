"""KeyedColumns: tables with one array a column and one row a key, growing as keys appear."""

from __future__ import annotations

import mmap
from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np

from dissectors.batch import I64, U64
from dissectors.keys import KeyTable

_WIDE = 8
"""A row of so many numbers or more is worth a look before it is copied."""

_MAPPED_BYTES = 1 << 20


class KeyedColumns:
    """A table whose columns are the annotated arrays of a subclass.

    ``COLUMNS`` names each column with the value that a new row starts with (its dtype is the column's) and, for rows of
    several numbers, their count. Arrays are longer than the table; ``resize`` keeps room for what is to come.
    """

    COLUMNS: ClassVar[dict[str, tuple[np.generic, int]]]

    def __init__(self) -> None:
        self._rows = 0
        for name, (initial, width) in self.COLUMNS.items():
            setattr(self, name, _filled(initial, width, 0))

    def __len__(self) -> int:
        return self._rows

    def resize(self, rows: int) -> None:
        """Make the table at least this long; new rows hold the initial values."""
        if rows <= self._rows:
            return
        self._rows = rows
        first = getattr(self, next(iter(self.COLUMNS)))
        if rows <= len(first):
            return
        room = max(rows, 2 * len(first), 64)
        for name, (initial, width) in self.COLUMNS.items():
            old = getattr(self, name)
            grown = _filled(initial, width, room)
            if width >= _WIDE and not initial:
                # Of most keys little happens: their rows stay untouched, and take no memory.
                kept = np.flatnonzero(old.any(axis=1))
                grown[kept] = old[kept]
            else:
                grown[: len(old)] = old
            setattr(self, name, grown)

    def own_rows(self, row: I64) -> I64:
        """Return those of some rows that the table has already."""
        return row[row < self._rows]

    def take(self, other: Self, row: I64) -> None:
        """Make rows of this table what they are in another one of the same keys; it may be shorter."""
        row = row[row < len(other)]
        self.resize(len(other))
        self._put(row, other, row)

    def take_keyed(self, keys: KeyTable, other: Self, words: Sequence[U64]) -> I64:
        """Take over all rows of another table, whose keys are ``words``; return their rows here.

        ``keys`` are those of this table, and none of them is one of the other's.
        """
        row = keys.numbers(*words)
        self.resize(len(keys))
        self._put(row, other, np.arange(len(row)))
        return row

    def rows(self, row: I64) -> Self:
        """Return a table of some rows of this one, in their order."""
        chosen = type(self)()
        chosen.resize(len(row))
        chosen._put(np.arange(len(row)), self, row)
        return chosen

    def put(self, row: I64, other: Self) -> None:
        """Make some rows of this table what all rows of another one are, in the same order."""
        self._put(row, other, np.arange(len(row)))

    def _put(self, row: I64, other: Self, other_row: I64) -> None:
        for name in self.COLUMNS:
            getattr(self, name)[row] = getattr(other, name)[other_row]

    def copied(self, *names: str) -> Self:
        """Return a copy of the rows in use that shares nothing with this table; with ``names``, of these columns only.

        Columns that are not copied hold nothing.
        """
        copy = type(self)()
        copy._rows = self._rows
        for name in names or self.COLUMNS:
            setattr(copy, name, self.column(name).copy())
        return copy

    @property
    def taken_bytes(self) -> int:
        """How many bytes the columns take, the room for what is to come with them."""
        return sum(getattr(self, name).nbytes for name in self.COLUMNS)

    def column(self, name: str) -> Any:
        """Return one column, cut to the rows in use."""
        return getattr(self, name)[: self._rows]


def _filled(initial: np.generic, width: int, rows: int) -> Any:
    """Return so many rows of a column; of zeros, those that nobody writes to take no memory."""
    shape = (rows, width) if width > 1 else rows
    if initial:
        return np.full(shape, initial)
    size = rows * width * initial.dtype.itemsize
    if size < _MAPPED_BYTES or not hasattr(mmap, "MAP_PRIVATE"):
        return np.zeros(shape, initial.dtype)
    # Memory that was used before would have to be filled with zeros, and what the allocator hands out in large pages
    # is there as soon as one row of it is.
    fresh = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    return np.frombuffer(fresh, initial.dtype).reshape(shape)
