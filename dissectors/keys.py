"""KeyTable: numbers things in the order in which they appear, for whole columns of keys at once."""

from __future__ import annotations

import os

import numpy as np

from dissectors.batch import I64, U64, Bool

_EMPTY = -1
# Odd numbers of this run: nobody can make keys beforehand that all fall into one slot.
_RANDOM = np.frombuffer(os.urandom(8 * 16), np.uint64) | np.uint64(1)
_MIX = np.uint64(0xC2B2AE3D27D4EB4F)
_FIRST_ROOM = 256
_LEAST_BITS = 11
_MANY = 1 << 14


def _least_slots(keys: int) -> int:
    """Return the slots that so many keys need at least: many for each, so that few have to go on to another one.

    Where there are so many keys that no cache holds their slots anyway, memory matters more.
    """
    return keys * (8 if keys <= _MANY else 2)


class KeyTable:
    """A growing map from keys of some 64-bit words, two by default, to dense numbers 0, 1, 2 ….

    An open-addressing hash table in numpy arrays: looking up a column costs a few gathers, whatever the number of keys.
    Numbers are given in the order of first appearance in what was looked up, and stay.
    """

    def __init__(self, width: int = 2) -> None:
        self._bits = _LEAST_BITS
        self._slots = np.full(1 << self._bits, _EMPTY, np.int64)
        self._words = np.empty((width, _FIRST_ROOM), np.uint64)
        self._count = 0
        self._rising = np.empty(0, np.int64)

    def __len__(self) -> int:
        return self._count

    @property
    def words(self) -> tuple[U64, ...]:
        """The words of the keys, by number."""
        return tuple(word[: self._count] for word in self._words)

    @property
    def high(self) -> U64:
        """First words of the keys, by number."""
        return self._words[0, : self._count]

    @property
    def low(self) -> U64:
        """Second words of the keys, by number."""
        return self._words[1, : self._count]

    def rising(self) -> I64:
        """Return the numbers of all keys by their first word, those of equal ones in any order.

        Keys that have come since the last call are sorted in: those that were there need not be sorted again.
        """
        known = len(self._rising)
        if known < self._count:
            new = known + np.argsort(self.high[known:])
            place = np.searchsorted(self.high[self._rising], self.high[new])
            self._rising = np.insert(self._rising, place, new)
        return self._rising

    def numbers(self, *words: U64) -> I64:
        """Return the number of each key, giving new keys the next ones. One column a word, of shape (n,)."""
        found = self.find(*words)
        missing = np.flatnonzero(found == _EMPTY)
        if len(missing):
            new = tuple(word[missing] for word in words)
            known = self._count
            self._append(new)
            # Where all of them differ, they are the new ones in their order.
            all_differ = self._count - known == len(missing)
            found[missing] = np.arange(known, self._count) if all_differ else self.find(*new)
        return found

    def numbers_within(self, most: int, *words: U64) -> I64:
        """Return the numbers of keys as ``numbers`` does, -1 of those for which a table of ``most`` keys has no room.

        However keys are shared out to calls, the first ones of all have room.
        """
        if self._count + len(words[0]) <= most:
            return self.numbers(*words)
        found = self.find(*words)
        missing = np.flatnonzero(found == _EMPTY)
        room = most - self._count
        if room > 0 and len(missing):
            new = tuple(word[missing] for word in words)
            first = _first_appearances(new)[:room]
            self._append(tuple(word[first] for word in new))
            found[missing] = self.find(*new)
        return found

    def find(self, *words: U64) -> I64:
        """Return the number of each key, -1 where it is not known. One column a word, of shape (n,)."""
        place = _places(words, self._bits)
        found = self._slots[place]
        if not self._count:
            return found
        wrong = np.flatnonzero(self._differ(found, words) & (found != _EMPTY))
        while len(wrong):
            place[wrong] = (place[wrong] + 1) & (len(self._slots) - 1)
            candidate = self._slots[place[wrong]]
            found[wrong] = candidate
            differs = self._differ(candidate, tuple(word[wrong] for word in words))
            wrong = wrong[differs & (candidate != _EMPTY)]
        return found

    def _differ(self, number: I64, words: tuple[U64, ...]) -> Bool:
        """Tell where the key of a number is another one; anything where the number is -1."""
        differs: Bool = self._words[0][number] != words[0]
        for known, word in zip(self._words[1:], words[1:], strict=True):
            differs |= known[number] != word
        return differs

    def _append(self, words: tuple[U64, ...]) -> None:
        first = _first_appearances(words)
        start, self._count = self._count, self._count + len(first)
        if self._count > self._words.shape[1]:
            grown = np.empty((len(words), max(self._count, 2 * self._words.shape[1])), np.uint64)
            grown[:, :start] = self._words[:, :start]
            self._words = grown
        for known, word in zip(self._words, words, strict=True):
            known[start : self._count] = word[first]
        least = _least_slots(self._count)
        if least > len(self._slots):
            self._bits = (2 * least - 1).bit_length()
            self._slots = np.full(1 << self._bits, _EMPTY, np.int64)
            start = 0
        self._place(np.arange(start, self._count))

    def _place(self, numbers: I64) -> None:
        """Put numbers into free slots; where several want the same one, one wins and the others move on."""
        place = _places(tuple(word[numbers] for word in self._words), self._bits)
        while len(numbers):
            free = self._slots[place] == _EMPTY
            self._slots[place[free]] = numbers[free]
            placed = self._slots[place] == numbers
            numbers, place = numbers[~placed], (place[~placed] + 1) & (len(self._slots) - 1)


def first_rows(number: I64, bound: int) -> I64:
    """Return where each of the numbers 0 … ``bound`` − 1, which all occur, stands first."""
    first = np.empty(bound, np.int64)
    # Assigned backwards, so that the first one is what stays.
    first[number[::-1]] = np.arange(len(number))[::-1]
    return first


def first_rows_from(number: I64, known: int, bound: int) -> I64:
    """Return where each of the numbers ``known`` … ``bound`` − 1 stands first, as far as they occur."""
    later = np.flatnonzero(number >= known)[::-1]
    first = np.full(bound - known, -1)
    first[number[later] - known] = later
    return first[first >= 0]


def _places(words: tuple[U64, ...], bits: int) -> I64:
    """Return for each key one of 2 ** ``bits`` slots."""
    mixed = words[0] * _RANDOM[0]
    for factor, word in zip(_RANDOM[1:], words[1:], strict=False):
        # Folded each time: a factor alone carries nothing down from a word's upper bits.
        mixed ^= mixed >> np.uint64(32)
        mixed += word * factor
    mixed ^= mixed >> np.uint64(29)
    mixed *= _MIX
    mixed >>= np.uint64(64 - bits)
    places: I64 = mixed.view(np.int64)
    return places


def _first_appearances(words: tuple[U64, ...]) -> I64:
    """Return where each different key stands first, rising.

    Equal keys go from slot to slot together. In each round the first row of every slot wins it, for its key.
    """
    bits = max(10, len(words[0]).bit_length() + 1)
    scratch = np.empty(1 << bits, np.int64)
    place = _places(words, bits)
    rows = np.arange(len(words[0]))
    winners = []
    while len(rows):
        scratch[place[::-1]] = rows[::-1]
        winner = scratch[place]
        winners.append(rows[winner == rows])
        beaten = np.zeros(len(rows), np.bool_)
        for word in words:
            beaten |= word[winner] != word[rows]
        rows, place = rows[beaten], (place[beaten] + 1) & (len(scratch) - 1)
    first: I64 = np.sort(np.concatenate(winners))
    return first
