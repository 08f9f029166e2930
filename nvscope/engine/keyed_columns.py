"""Columns: the tracker's tables, one array a column and one row a key, growing as keys appear."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from dissectors.batch import I64, U16

Amounts = I64 | U16


class Columns:
    """A table whose columns are the annotated arrays of a subclass.

    ``COLUMNS`` names each column with the value that a new row starts with (its dtype is the column's) and, for rows of
    several numbers, their count. Arrays are longer than the table; ``resize`` keeps room for what is to come.
    """

    COLUMNS: ClassVar[dict[str, tuple[np.generic, int]]]

    def __init__(self) -> None:
        self._rows = 0
        for name, (initial, width) in self.COLUMNS.items():
            setattr(self, name, np.full((0, width) if width > 1 else 0, initial))

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
            grown = np.full((room, width) if width > 1 else room, initial)
            grown[: len(old)] = old
            setattr(self, name, grown)

    def column(self, name: str) -> Any:
        """Return one column, cut to the rows in use."""
        return getattr(self, name)[: self._rows]


def add_sums(column: I64, number: I64, amount: Amounts, rows: int) -> None:
    """Add amounts to the first rows of a column: each to the row ``number``. Sums stay far below 2^53."""
    column[:rows] += np.bincount(number, amount, minlength=rows).astype(np.int64)


def runs_of(numbers: I64) -> tuple[I64, I64]:
    """Return where each run of equal numbers starts, and where it stops."""
    if not len(numbers):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    start = np.flatnonzero(np.append(True, numbers[1:] != numbers[:-1]))
    return start, np.append(start[1:], len(numbers))


def stable_order(numbers: I64, bound: int) -> I64:
    """Return the order that sorts numbers 0 … bound − 1, equal ones as they came.

    numpy sorts 8 and 16 bit numbers by radix, an order of magnitude faster than wider ones.
    """
    if bound <= 1 << 8:
        return np.argsort(numbers.astype(np.uint8), kind="stable")
    if bound <= 1 << 16:
        return np.argsort(numbers.astype(np.uint16), kind="stable")
    low = np.argsort(numbers.astype(np.uint16), kind="stable")
    high = stable_order((numbers >> 16)[low], (bound >> 16) + 1)
    return low[high]


def order_by(number_of: I64, variety: I64, bound: int) -> I64:
    """Return the order that sorts rows by the numbers, 0 … ``bound``, of their varieties, equal ones as they came."""
    # Looked up in the width that they are sorted in.
    narrow: I64 = number_of.astype(np.uint8 if bound <= 0xFF else np.uint16 if bound <= 0xFFFF else np.int64)
    return stable_order(narrow[variety], bound + 1)


def runs_of_lengths(length: I64) -> tuple[I64, I64, I64]:
    """Return which numbers have runs, given how long that of each is, and where these start and stop end to end."""
    run = np.flatnonzero(length)
    stop = np.cumsum(length[run])
    return run, stop - length[run], stop
