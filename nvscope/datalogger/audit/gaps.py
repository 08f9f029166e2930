"""Gaps: rows that come later than they should, and which of them are none since a clock was set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from dissectors.columns import Columns
from nvscope.tracker.datalogger.late_rows import LATE_PERCENT

STEADY, STEADY_SHARE = 36, 8
"""So many rows that each come about as late as the one before have an interval of their own."""


class Gaps(Columns, Struct, frozen=True):
    """Rows that come later than they should: how long after the one before, when that was, and of which file.

    ``number`` counts the rows of the task. ``told``: the logger says that data was lost before them.
    """

    length_ns: I64
    before_ns: I64
    rowid: I64
    number: I64
    file: I64
    told: Bool

    @staticmethod
    def joined(parts: Sequence[Gaps]) -> Gaps:
        """Return several as one."""
        if not parts:
            none = np.zeros(0, np.int64)
            return Gaps(none, none, none, none, none, np.zeros(0, np.bool_))
        return Gaps.stacked(parts)


class SetBack(Struct, frozen=True):
    """A row before which the clock was set back: its number, the time of the row before, and its own."""

    number: int
    before_ns: int
    time_ns: int


def limit_ns(interval_ns: int) -> int:
    """Return how long after a row the next one may come."""
    return interval_ns * LATE_PERCENT // 100


def are_late(length_ns: I64, interval_ns: I64 | int) -> Bool:
    """Return which lengths are longer than that for intervals of their own, however long they are."""
    more = LATE_PERCENT - 100
    found: Bool = length_ns - interval_ns > interval_ns // 100 * more + interval_ns % 100 * more // 100
    return found


def are_steady(gaps: Gaps) -> Bool:
    """Return which of some, by rising numbers, follow each other by many, each about as long as that before it."""
    length_ns = gaps.length_ns
    alike = np.abs(np.diff(length_ns)) <= length_ns[:-1] // STEADY_SHARE
    begins = np.append(True, ~(alike & (np.diff(gaps.number) == 1)))[: len(gaps)]
    run = np.cumsum(begins) - 1
    found: Bool = np.bincount(run)[run] >= STEADY
    return found


def are_no_clock_sets(gaps: Gaps, interval_ns: I64, set_back: Sequence[SetBack]) -> Bool:
    """Tell which gaps, by rising numbers, are some though the clock was set forward and back, or back and forward.

    Where the time from the row before to the row behind both is that of the rows between them, none is missing.
    """
    kept = np.ones(len(gaps), np.bool_)
    for one in set_back if len(gaps) else ():
        place = int(np.searchsorted(gaps.number, one.number))
        if place:
            rows = one.number - int(gaps.number[place - 1]) + 1
            if _fits(one.time_ns - int(gaps.before_ns[place - 1]), rows, int(interval_ns[place - 1])):
                kept[place - 1] = False
        if place < len(gaps):
            rows = int(gaps.number[place]) - one.number + 1
            time_ns = int(gaps.before_ns[place]) + int(gaps.length_ns[place])
            if _fits(time_ns - one.before_ns, rows, int(interval_ns[place])):
                kept[place] = False
    return kept


def _fits(length_ns: int, rows: int, interval_ns: int) -> bool:
    """Return whether so many rows fill a time, of which the interval is known to a twentieth."""
    return 0 < length_ns <= rows * interval_ns * 21 // 20 + interval_ns // 2
