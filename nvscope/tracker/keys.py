"""KeyTable: numbers things in the order in which they appear, for whole columns of keys at once."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U64

_MIX_A = np.uint64(0x9E3779B97F4A7C15)
_MIX_B = np.uint64(0xC2B2AE3D27D4EB4F)
_EMPTY = -1


class KeyTable:
    """A growing map from keys of two 64-bit words to dense numbers 0, 1, 2 ….

    An open-addressing hash table in numpy arrays: looking up a column costs a few gathers, whatever the number of keys.
    Numbers are given in the order of first appearance, so that they do not depend on how the input was cut.
    """

    def __init__(self) -> None:
        self._bits = 10
        self._slots = np.full(1 << self._bits, _EMPTY, np.int64)
        self._high = np.empty(256, np.uint64)
        self._low = np.empty(256, np.uint64)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def high(self) -> U64:
        """First words of the keys, by number."""
        return self._high[: self._count]

    @property
    def low(self) -> U64:
        """Second words of the keys, by number."""
        return self._low[: self._count]

    def numbers(self, high: U64, low: U64) -> I64:
        """Return the number of each key, giving new keys the next ones. Shapes (n,)."""
        found = self.find(high, low)
        missing = np.flatnonzero(found == _EMPTY)
        if len(missing):
            self._append(high[missing], low[missing])
            found[missing] = self.find(high[missing], low[missing])
        return found

    def find(self, high: U64, low: U64) -> I64:
        """Return the number of each key, -1 where it is not known. Shapes (n,)."""
        place = self._places(high, low)
        found = self._slots[place]
        if not self._count:
            return found
        wrong = np.flatnonzero(((self._high[found] != high) | (self._low[found] != low)) & (found != _EMPTY))
        while len(wrong):
            place[wrong] = (place[wrong] + 1) & (len(self._slots) - 1)
            candidate = self._slots[place[wrong]]
            found[wrong] = candidate
            differs = (self._high[candidate] != high[wrong]) | (self._low[candidate] != low[wrong])
            wrong = wrong[differs & (candidate != _EMPTY)]
        return found

    def _places(self, high: U64, low: U64) -> I64:
        mixed = (high ^ (low * _MIX_B)) * _MIX_A
        mixed ^= mixed >> np.uint64(29)
        mixed *= _MIX_B
        mixed >>= np.uint64(64 - self._bits)
        return mixed.view(np.int64)

    def _append(self, high: U64, low: U64) -> None:
        first = self._first_appearances(high, low)
        start, self._count = self._count, self._count + len(first)
        if self._count > len(self._high):
            room = max(self._count, 2 * len(self._high))
            self._high = np.concatenate([self._high[:start], np.empty(room - start, np.uint64)])
            self._low = np.concatenate([self._low[:start], np.empty(room - start, np.uint64)])
        self._high[start : self._count], self._low[start : self._count] = high[first], low[first]
        if self._count * 4 > len(self._slots):
            self._bits = max(self._bits, (self._count * 8 - 1).bit_length())
            self._slots = np.full(1 << self._bits, _EMPTY, np.int64)
            start = 0
        self._place(np.arange(start, self._count))

    def _first_appearances(self, high: U64, low: U64) -> I64:
        """Return where each different key stands first, rising.

        Equal keys go from slot to slot together. In each round the first row of every slot wins it, for its key.
        """
        scratch = np.empty(len(self._slots), np.int64)
        place = self._places(high, low)
        rows = np.arange(len(high))
        winners = []
        while len(rows):
            scratch[place[::-1]] = rows[::-1]
            winner = scratch[place]
            winners.append(rows[winner == rows])
            beaten = (high[winner] != high[rows]) | (low[winner] != low[rows])
            rows, place = rows[beaten], (place[beaten] + 1) & (len(self._slots) - 1)
        return np.sort(np.concatenate(winners))

    def _place(self, numbers: I64) -> None:
        """Put numbers into free slots; where several want the same one, one wins and the others move on."""
        place = self._places(self._high[numbers], self._low[numbers])
        while len(numbers):
            free = self._slots[place] == _EMPTY
            self._slots[place[free]] = numbers[free]
            placed = self._slots[place] == numbers
            numbers, place = numbers[~placed], (place[~placed] + 1) & (len(self._slots) - 1)
