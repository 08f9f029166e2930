"""Counters of single cells that are wrong, told from changes that were missed by the counters around them.

Where a counter goes on, behind a cell that does not fit, as if that cell had counted rightly, no change is missing: its
counter alone is corrupt, and nothing is wrong with the one behind it. A cell may be the last of a chunk: what
follows it says later what it is.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit import topics
from nvscope.datalogger.audit.counts import steps_of
from nvscope.datalogger.audit.finding import Notes


class Counted(Struct, frozen=True):
    """The cells of a chunk that have a counter of a variable, each with the one before it.

    ``follows``: nothing between the two says that a change was lost, or was stored without a counter. ``doubtful`` are
    cells whose counter does not fit the one before. ``starts``: the logger starts anew there, if the next one counts 1.
    ``may_be_none``: a change may be to NULL.
    """

    counts: I64
    before: I64
    follows: Bool
    doubtful: Bool
    starts: Bool
    valued: Bool
    may_be_none: bool


class _Waiting(Struct, frozen=True):
    """A step of more than 1 to the last cell of a chunk, and where to tell of it."""

    notes: Notes
    place: tuple[I64, I64, Bool]
    amount: I64


class OddCounts:
    """Finds the cells of each variable, by its number, whose counter alone is wrong."""

    def __init__(self, count: int) -> None:
        self._before = np.zeros(count, np.int64)
        self._doubtful = np.zeros(count, np.bool_)
        self._starts = np.zeros(count, np.bool_)
        self._valued = np.zeros(count, np.bool_)
        self._waiting: dict[int, _Waiting] = {}

    def find(self, number: int, cells: Counted) -> tuple[Bool, Bool, I64]:
        """Return which cells are odd, which are behind one that is, and by how much those step from a right counter."""
        before = np.append(self._before[number], cells.before[:-1])
        doubtful = np.append(self._doubtful[number], cells.doubtful[:-1])
        valued_before = np.append(self._valued[number], cells.valued[:-1])
        starts = np.append(self._starts[number], cells.starts[:-1])
        self._valued[number], self._starts[number] = cells.valued[-1], cells.starts[-1]
        behind = doubtful & cells.follows
        steps = cells.valued.astype(np.int64)
        if behind.any():
            over_both = steps_of(cells.counts, before)
            fits = over_both == steps + valued_before
            if cells.may_be_none:
                fits |= over_both == 2
                steps = np.where(over_both == 2, 1, steps)
            behind = _every_second(behind & fits & ~(starts & (cells.counts == 1)))
        self._before[number], self._doubtful[number] = cells.before[-1], cells.doubtful[-1] & ~behind[-1]
        if number in self._waiting:
            self._settle(number, is_odd=bool(behind[0]))
        return np.append(behind[1:], False), behind, steps

    def is_open(self, number: int) -> bool:
        """Return whether what follows tells whether the last cell is odd."""
        return number in self._waiting or bool(self._doubtful[number])

    def count_on(self, number: int, before: int) -> None:
        """Take cells of a variable that count on, without one that is odd; ``before`` is the count before the last."""
        self._before[number], self._doubtful[number] = before, False
        self._valued[number], self._starts[number] = True, False

    def wait(self, number: int, notes: Notes, place: tuple[I64, I64, Bool], amount: I64) -> None:
        """Keep a step to the last cell of a chunk until it is known whether changes were missed, or it is odd."""
        self._waiting[number] = _Waiting(notes, place, amount)

    def end(self) -> None:
        """Tell of what waits: nothing follows."""
        self._doubtful[:] = False
        for number in list(self._waiting):
            self._settle(number, is_odd=False)

    def _settle(self, number: int, *, is_odd: bool) -> None:
        waiting = self._waiting.pop(number)
        if is_odd:
            waiting.notes.of(topics.AHEAD, number).add(*waiting.place)
        else:
            waiting.notes.of(topics.MISSED, number).add(*waiting.place, waiting.amount)


def _every_second(found: Bool) -> Bool:
    """Return the first, third … of those that follow each other: the one behind an odd cell is none itself."""
    places = np.flatnonzero(found)
    begins = np.diff(places, prepend=-2) > 1
    first = places[begins][np.cumsum(begins) - 1]
    kept = np.zeros(len(found), np.bool_)
    kept[places[(places - first) % 2 == 0]] = True
    return kept
