"""UsualRows: rows of 64 bytes that come again and again, found among many rows at once."""

from __future__ import annotations

import os

import numpy as np

from dissectors.batch import I64, U64

WORDS = 8
"""64-bit words in a row."""

_BITS = 14
NOBODY = -1
"""The number of rows that are not found."""

_ROW = np.dtype((np.void, 8 * WORDS))
# Odd numbers of this run: nobody can make rows beforehand that all fall into one slot.
_RANDOM = np.frombuffer(os.urandom(8 * WORDS), np.uint64) | np.uint64(1)


class UsualRows:
    """Numbers of rows; each row has a slot, by its words ``telling``, and the first row of a slot keeps it.

    Rows may share a number. A row that is not found may be known all the same: this stands in front of a ``KeyTable``,
    which knows all. Rows are compared where they lie, without being taken apart into columns.
    """

    def __init__(self, telling: tuple[int, ...]) -> None:
        self._telling = telling
        self._number = np.full(1 << _BITS, NOBODY, np.int64)
        self._rows = np.zeros(1 << _BITS, _ROW)

    def find(self, rows: U64) -> I64:
        """Return the numbers of rows, ``NOBODY`` of those that have no slot. Contiguous, of shape (n, ``WORDS``)."""
        slot = self._slots(rows)
        number = self._number.take(slot)
        differs = rows.reshape(-1) != self._rows.take(slot).view(np.uint64)
        # The eight truth values of a row are one word.
        number[np.flatnonzero(differs.view(np.uint64) != 0)] = NOBODY
        return number

    def add(self, rows: U64, number: I64) -> None:
        """Give rows with their numbers the slots that are free."""
        slot = self._slots(rows)
        free = np.flatnonzero(self._number[slot] == NOBODY)[::-1]
        # Assigned backwards, so that the first one is what stays.
        self._number[slot[free]] = number[free]
        self._rows[slot[free]] = rows[free].view(_ROW)[:, 0]

    def _slots(self, rows: U64) -> I64:
        first, *others = self._telling
        mixed = rows[:, first] * _RANDOM[first]
        for word in others:
            mixed += rows[:, word] * _RANDOM[word]
        # Factors carry upwards: the upper bits depend on all bits of all words.
        mixed >>= np.uint64(64 - _BITS)
        slots: I64 = mixed.view(np.int64)
        return slots
