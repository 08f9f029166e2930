"""Values of variables: what was known of each last, and its figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.datalogger.records import Cells, Form
from nvscope.datalogger.audit.chunk import Chunk, keys

_LONGEST = 120
"""Bytes of a text that are kept to be shown."""

Value = int | float | str | bytes | None

_UNKNOWN = -1


@dataclass(slots=True)
class Figures:
    """What an audit tells of one variable: how often it was stored, how often that was another value than before, in
    how many of the ``rows`` that could tell it nobody knows it, and the first, last, least and greatest value.

    Of a table that stores every value, these are the rows of its task.
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
        self.stretches: I64 = np.full(variables, _UNKNOWN, np.int64)
        """The stretch in which each was known last."""
        self._encoding = encoding

    def forget(self) -> None:
        """Let no value be known any more."""
        self.stretches[:] = _UNKNOWN

    def use(self, encoding: str) -> None:
        """Take texts to be encoded so from now on."""
        self._encoding = encoding

    def take(
        self, variable: int, chunk: Chunk, rows: I64 | None, cells: Cells, unknown: Bool | None = None
    ) -> tuple[Bool, Bool]:
        """Take the values of some rows, in their order; return which equal the one before, and of which that is known.

        A value that is NULL here is one that is no number, which equals none; or nobody knows it, where ``unknown``.
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
        known[0] = self.stretches[variable] == first
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
        self._key[variable], self._form[variable] = int(key[-1]), int(form[-1])
        self.stretches[variable] = last if unknown is None or not unknown[-1] else _UNKNOWN
        changes = int(np.count_nonzero(known)) - int(np.count_nonzero(same))
        self._tell(self.figures[variable], chunk, cells, (low, high), changes)
        return same, known

    def _tell(self, told: Figures, chunk: Chunk, cells: Cells, forms: tuple[int, int], changes: int) -> None:
        if not told.stored:
            told.first = self._value(chunk, cells, 0)
        told.last = self._value(chunk, cells, len(cells) - 1)
        told.changes += changes
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
