"""Values of variables: what was known of each last, and its figures.

What is NULL among values is none: nobody knows it. It equals nothing, and is no change: whether it became another value
meanwhile, the next one tells.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, U64, Bool
from dissectors.datalogger.records import Cells, Form
from nvscope.datalogger.audit.chunk import Chunk, keys

_LONGEST = 120
"""Bytes of a text that are kept to be shown."""

Value = int | float | str | bytes | None

_UNKNOWN = -1


class Figures(Struct):
    """What an audit tells of one variable: how often it was stored, how often that was another value than before, in
    how many of the ``rows`` that could tell it nobody knows it, and the first, last, least and greatest value.

    Of a table that stores every value, these are the rows of its task. All values are those that are known.
    """

    stored: int = 0
    changes: int = 0
    unknown: int = 0
    rows: int = 0
    first: Value = None
    last: Value = None
    least: int | float | None = None
    greatest: int | float | None = None


class Values:
    """The last known value of each variable, and its figures."""

    def __init__(self, variables: int, encoding: str) -> None:
        self.figures = [Figures() for _ in range(variables)]
        self._key = [0] * variables
        self._form = [int(Form.NULL)] * variables
        self._stretches = [_UNKNOWN] * variables
        """The stretch in which each was known last."""
        self._valued: list[tuple[int, int, int]] = [(_UNKNOWN, 0, int(Form.NULL))] * variables
        """Of the last value of each that is not NULL, its stretch, key and form."""
        self._encoding = encoding

    def forget(self) -> None:
        """Let no value be known any more."""
        count = len(self.figures)
        self._stretches = [_UNKNOWN] * count
        self._valued = [(_UNKNOWN, 0, int(Form.NULL))] * count

    def use(self, encoding: str) -> None:
        """Take texts to be encoded so from now on."""
        self._encoding = encoding

    def take(
        self, variable: int, chunk: Chunk, rows: I64 | None, cells: Cells, unknown: Bool | None = None
    ) -> tuple[Bool, Bool]:
        """Take the values of some rows, in their order; return which equal the one before, and of which that is known.

        A value that is NULL here is one that is no number, which equals none and is known to be none; or nobody knows
        it, where ``unknown``.
        """
        count = len(cells)
        key = keys(cells, chunk.rows.data)
        form = cells.form
        known = np.ones(count, np.bool_)
        if chunk.is_one_stretch:
            first = last = int(chunk.stretch[0])
        else:
            stretch = chunk.stretch if rows is None else chunk.stretch[rows]
            first, last = int(stretch[0]), int(stretch[-1])
            np.equal(stretch[1:], stretch[:-1], out=known[1:])
        known[0] = self._stretches[variable] == first
        same = np.empty(count, np.bool_)
        same[0] = self._key[variable] == int(key[0]) and self._form[variable] == int(form[0])
        np.equal(key[1:], key[:-1], out=same[1:])
        low, high = int(form.min()), int(form.max())
        if low != high:
            same[1:] &= form[1:] == form[:-1]
        if unknown is not None:
            known &= ~unknown
            known[1:] &= ~unknown[:-1]
        same &= known
        if low == Form.NULL:
            same &= form != Form.NULL
        told = self.figures[variable]
        if low != Form.NULL and self._form[variable] != Form.NULL:
            told.changes += int(np.count_nonzero(known)) - int(np.count_nonzero(same))
            self._valued[variable] = last, int(key[-1]), int(form[-1])
            self._tell(told, chunk, cells, (low, high), (0, count - 1))
        elif len(stored := np.flatnonzero(form != Form.NULL)):
            stretch = chunk.stretch[stored if rows is None else rows[stored]]
            told.changes += self._changes(variable, key[stored], form[stored], stretch)
            self._tell(told, chunk, cells, (low, high), (int(stored[0]), int(stored[-1])))
        self._key[variable], self._form[variable] = int(key[-1]), int(form[-1])
        self._stretches[variable] = last if unknown is None or not unknown[-1] else _UNKNOWN
        return same, known

    def _changes(self, variable: int, key: U64, form: U8, stretch: I64) -> int:
        """Take values without NULL, which tells nothing; return how often they are others than the ones before."""
        known_in, last_key, last_form = self._valued[variable]
        self._valued[variable] = int(stretch[-1]), int(key[-1]), int(form[-1])
        changed = ((key[1:] != key[:-1]) | (form[1:] != form[:-1])) & (stretch[1:] == stretch[:-1])
        is_other = known_in == int(stretch[0]) and (int(key[0]), int(form[0])) != (last_key, last_form)
        return int(np.count_nonzero(changed)) + is_other

    def _tell(self, told: Figures, chunk: Chunk, cells: Cells, forms: tuple[int, int], places: tuple[int, int]) -> None:
        """Tell of values that are stored, the first and the last of which are at these places."""
        first, last = places
        if not told.stored:
            told.first = self._value(chunk, cells, first)
        told.last = self._value(chunk, cells, last)
        low, high = forms
        if low == high:
            told.stored += len(cells) if low != Form.NULL else 0
            if low == Form.INTEGER:
                self._extremes(told, cells.integers)
            elif low == Form.REAL:
                self._extremes(told, cells.bits.view(np.float64))
            return
        told.stored += int(np.count_nonzero(cells.form))
        integers, reals = cells.form == Form.INTEGER, cells.form == Form.REAL
        if integers.any():
            self._extremes(told, cells.integers[integers])
        if reals.any():
            self._extremes(told, cells.bits.view(np.float64)[reals])

    @staticmethod
    def _extremes(told: Figures, numbers: np.ndarray) -> None:
        least, greatest = numbers.min().item(), numbers.max().item()
        told.least = least if told.least is None else min(told.least, least)
        told.greatest = greatest if told.greatest is None else max(told.greatest, greatest)

    def _value(self, chunk: Chunk, cells: Cells, row: int) -> Value:
        form = int(cells.form[row])
        if form == Form.INTEGER:
            return int(cells.integers[row])
        if form == Form.REAL:
            return float(cells.bits[row : row + 1].view(np.float64)[0])
        if form == Form.NULL:
            return None
        start, stop = int(cells.start[row]), int(cells.stop[row])
        raw = chunk.rows.data[start : min(stop, start + _LONGEST)].tobytes()
        return raw.decode(self._encoding, "replace") if form == Form.TEXT else raw
