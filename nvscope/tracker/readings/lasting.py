"""Lasting values: what a variable was in rows in which only what has changed is stored, as far as that is known."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from dissectors.batch import I64, U64, Bool
from nvscope.tracker.readings.readings import Readings


@runtime_checkable
class RowsRead(Protocol):
    """What reads values that stand in rows: it knows the rows, too, in which one is what it was before."""

    def rows_of(self, number: int) -> tuple[I64, I64]:
        """Return the packets of such rows of a variable in the batch read last, and their stretches."""
        ...

    def unbroken(self, stretch: I64) -> I64:
        """Return stretches that end only where rows may be missing, not where a variable alone is unknown."""
        ...


class Lasted(NamedTuple):
    """Values by the row of their packet, rising; columns of shape (n,), as those of ``Readings``."""

    row: I64
    form: I64
    bits: U64
    stretch: I64

    def take(self, rows: I64 | Bool) -> Lasted:
        """Return some of them."""
        return Lasted(self.row[rows], self.form[rows], self.bits[rows], self.stretch[rows])

    @staticmethod
    def of(readings: Readings, rows: I64) -> Lasted:
        """Return some readings of one variable."""
        stretch = np.zeros(len(rows), np.int64) if readings.stretch is None else readings.stretch[rows]
        return Lasted(readings.row[rows], readings.form[rows], readings.bits[rows], stretch)


_NOTHING = Lasted(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, np.uint64), np.empty(0, np.int64))


class LastingValue:
    """One variable: its values of a batch are ``take``n, and then ``fill``ed up by what lasted."""

    def __init__(self) -> None:
        self._last = _NOTHING
        self._came: list[Lasted] = []

    def forget(self) -> None:
        """Let nobody know what it was before."""
        self._last = _NOTHING

    def take(self, values: Lasted) -> None:
        """Take values that are stored in a batch."""
        self._came.append(values)

    def fill(self, lasting: I64, stretches: I64) -> Lasted:
        """Return what it was in each row of the batch in which that is known.

        ``lasting`` are the rows in which it is what it was before where no value is stored, and their stretches. Behind
        a loss, nobody knows what is not stored anew.
        """
        came = _joined(self._came)
        self._came.clear()
        # The last one of a row is its value there.
        order = np.argsort(came.row, kind="stable")
        came = came.take(order)
        row, first = np.unique(np.append(lasting, came.row), return_index=True)
        stretch = np.append(stretches, came.stretch)[first]
        known = _joined([self._last._replace(row=np.full(len(self._last.row), -1)), came])
        if not len(known.row):
            return _NOTHING
        self._last = known.take(np.array([len(known.row) - 1]))
        place = np.searchsorted(known.row, row, "right") - 1
        kept = np.flatnonzero((place >= 0) & (known.stretch[place] == stretch))
        lasted = known.take(place[kept])
        return Lasted(row[kept], lasted.form, lasted.bits, stretch[kept])


def _joined(parts: list[Lasted]) -> Lasted:
    return Lasted(*(np.concatenate(columns) for columns in zip(_NOTHING, *parts, strict=True)))
