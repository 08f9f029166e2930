"""A pattern looked for in the bytes of many telegrams at once.

All rows are read side by side, a byte of each at a time. The set of states that the pattern is in becomes a number, and
a table tells which number follows which at a byte; it is filled in as bytes occur. So a byte costs two look-ups of
numpy, 10 ns or so. A pattern such as ``a.{200}b`` can be in more sets of states than a table may hold: then those are
forgotten in which no row is, and at worst every byte costs what ``Pattern`` needs for it, 0.1 ms for the largest.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I32, I64, U8, Bool
from nvscope.expression.pattern import Pattern
from nvscope.expression.typed_columns import BytesColumn

_ROWS = 8192
_MAX_STATES = 1024
_UNKNOWN, _FOUND, _LOST = -1, 0, 1
"""Numbers in the table: not filled in yet; found, whatever follows; not to be found any more."""


class BytePattern:
    """A pattern over bytes; ``text`` has a character of U+0000 to U+00FF for each. PatternError as ``Pattern``."""

    def __init__(self, text: str) -> None:
        self._pattern = Pattern(text, of_bytes=True)
        self._begun = self._pattern.begun()
        self._sets: list[frozenset[int]]
        self._numbers: dict[frozenset[int], int]
        self._table: I32
        self._forget()

    def found_in(self, column: BytesColumn) -> Bool:
        """Tell in which spans the pattern is found anywhere."""
        if self._pattern.is_found(self._begun):
            return np.ones(len(column.start), np.bool_)
        found = np.zeros(len(column.start), np.bool_)
        empty = column.stop <= column.start
        found[empty] = self._pattern.is_found_at_end(self._begun, at_begin=True)
        # Rows of about one length come together, so that few of them end early.
        order = np.argsort(column.stop - column.start, kind="stable")
        order = order[~empty[order]]
        for first in range(0, len(order), _ROWS):
            rows = order[first : first + _ROWS]
            found[rows] = self._search(column, column.start[rows], column.stop[rows])
        return found

    def _search(self, column: BytesColumn, at: I64, stop: I64) -> Bool:
        found = np.zeros(len(at), np.bool_)
        rows = np.arange(len(at))
        state = np.full(len(at), self._number(self._begun))
        # In order of length: those that end are in front.
        while len(rows):
            byte = column.data[at]
            following = self._table[state, byte]
            state = self._learn(state, byte) if (following == _UNKNOWN).any() else following
            at = at + 1
            ended = at == stop
            if ended[0]:
                found[rows[ended]] = self._is_found_at_end(state[ended])
            going = state > _LOST
            if not going.all():
                found[rows[state == _FOUND]] = True
            if ended[0] or not going.all():
                going &= ~ended
                rows, at, stop, state = rows[going], at[going], stop[going], state[going]
        return found

    def _learn(self, state: I64, byte: U8) -> I64:
        """Fill in what follows at some bytes, and return it; all states but these and those in use may be forgotten."""
        pairs, place = np.unique(state * 256 + byte, return_inverse=True)
        sets = [self._pattern.after(self._sets[pair >> 8], chr(pair & 255)) for pair in pairs.tolist()]
        if len(self._sets) > _MAX_STATES:
            self._forget()
            return np.array([self._number(one) for one in sets], np.int64)[place]
        numbers = np.array([self._number(one) for one in sets], np.int64)
        self._table[pairs >> 8, pairs & 255] = numbers
        return numbers[place]

    def _is_found_at_end(self, state: I64) -> Bool:
        kinds, place = np.unique(state, return_inverse=True)
        told = [one == _FOUND or self._pattern.is_found_at_end(self._sets[one]) for one in kinds.tolist()]
        return np.array(told, np.bool_)[place]

    def _number(self, states: frozenset[int]) -> int:
        if self._pattern.is_found(states):
            return _FOUND
        if not states:
            return _LOST
        number = self._numbers.get(states)
        if number is None:
            number = self._numbers[states] = len(self._sets)
            self._sets.append(states)
            if number >= len(self._table):
                self._table = np.concatenate([self._table, np.full_like(self._table, _UNKNOWN)])
        return number

    def _forget(self) -> None:
        self._sets = [frozenset(), frozenset()]
        self._numbers = {}
        self._table = np.full((64, 256), _UNKNOWN, np.int32)
