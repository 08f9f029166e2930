"""Row shapes: in which columns a row has a value, as one number, by which rows that are alike are found."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dissectors.batch import U64, Bool

_STEP = np.uint64(0x9E3779B97F4A7C15)
_FACTORS = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_SHIFTS = np.uint64(30), np.uint64(27), np.uint64(31)


class RowShapes:
    """The shapes of rows with so many columns.

    Rows of different shapes have the same number by chance alone, once in 10 to the power of 19: each column adds a
    number of its own (splitmix64).
    """

    def __init__(self, columns: int) -> None:
        number = np.arange(1, columns + 1, dtype=np.uint64) * _STEP
        for shift, factor in zip(_SHIFTS, _FACTORS, strict=False):
            number = (number ^ (number >> shift)) * factor
        self._numbers: U64 = number ^ (number >> _SHIFTS[-1])

    def of(self, rows: int, filled: Iterable[tuple[int, Bool]]) -> U64:
        """Return the shapes of so many rows, given columns by their number with where they have a value."""
        shape = np.zeros(rows, np.uint64)
        for column, has_value in filled:
            shape += has_value * self._numbers[column]
        return shape
