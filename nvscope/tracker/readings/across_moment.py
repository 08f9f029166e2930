"""AcrossMoment: which variables nobody knows at a moment, since values were lost between the rows before and behind it.

What a variable was in the last row holds until the next one, unless something may be missing between these.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.engine.told import Told
from nvscope.tracker.readings.lasting import RowsRead
from nvscope.tracker.readings.readings import Readings


class _Stood(NamedTuple):
    """When the last row of a variable came that counts, and the highest number of a stretch up to then.

    Numbers rise. Where several tables have rows by turns, each has its own: what goes on has a number that was there.
    """

    time_ns: int
    stretch: int


class AcrossMoment:
    """Takes the rows of ``read`` batch by batch, of which those up to the moment count."""

    def __init__(self, read: RowsRead) -> None:
        self._read = read
        self._stood: dict[int, _Stood] = {}
        self._next: dict[int, int] = {}

    def count_all(self) -> None:
        """Let all that came so far count."""
        self._next.clear()

    def take(self, told: Told, batch: Sequence[Readings], until: int, numbers: int) -> None:
        """Take what was read of a batch, of which so many packets count; there are so many variables."""
        if until:
            self.count_all()
        parts = [(one.variable, one.row, one.stretch) for one in batch if one.stretch is not None and len(one.variable)]
        for number in range(numbers):
            row, stretch = self._read.rows_of(number)
            # The first row behind the moment, and the last one before it, are all that is asked for.
            place = int(np.searchsorted(row, until))
            own = slice(max(place - 1, 0), place + 1)
            if len(row[own]):
                parts.append((np.full(len(row[own]), number), row[own], stretch[own]))
        if not parts:
            return
        variable, row, stretch = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        order = np.argsort(row, kind="stable")
        self._note(told, variable[order], row[order], self._read.unbroken(stretch[order]), until)

    def _note(self, told: Told, variable: I64, row: I64, stretch: I64, until: int) -> None:
        first = int(np.searchsorted(row, until))
        last = dict(zip(variable[:first].tolist(), range(first), strict=True))
        highest = np.full(int(variable.max()) + 1, -1)
        np.maximum.at(highest, variable[:first], stretch[:first])
        for number, place in last.items():
            before = self._stood.get(number)
            most = max(int(highest[number]), -1 if before is None else before.stretch)
            self._stood[number] = _Stood(int(told.packets.ts_ns[row[place]]), most)
        for number, own in zip(variable[first:].tolist(), stretch[first:].tolist(), strict=True):
            self._next.setdefault(number, own)

    def is_lost(self, number: int, time_ns: int) -> bool:
        """Tell whether nobody knows what a variable was at a time, which is that of the moment."""
        stood, behind = self._stood.get(number), self._next.get(number)
        return stood is not None and behind is not None and behind > stood.stretch and stood.time_ns < time_ns
