"""The time of a table as a strip of cells, each of which says the worst that happened in it; of any length of time in
the same memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from itertools import pairwise

import numpy as np

from dissectors.batch import I64

_CELLS = 1 << 11
_FIRST_CELL_NS = 1_000_000
_USUAL = 3, 2
"""As much longer than usual a time between two rows may be, for which nothing is missing between them."""


class Mark(IntEnum):
    """What happened in a cell of a strip; of several, the greatest is shown."""

    NOTHING = 0
    ROWS = 1
    OFF = 2
    STARTED = 3
    TOLD = 4
    CLOCK_SET = 5
    UNREAD = 6
    GAP = 7


MARKS: Mapping[Mark, tuple[str, str]] = {
    Mark.NOTHING: (" ", "nothing"),
    Mark.ROWS: ("━", "rows"),
    Mark.OFF: ("·", "off"),
    Mark.STARTED: ("R", "started anew"),
    Mark.TOLD: ("▒", "loss told"),
    Mark.CLOCK_SET: ("!", "clock set"),
    Mark.UNREAD: ("?", "cannot be read, or file missing"),
    Mark.GAP: ("×", "rows missing, not told"),
}
"""The character of each mark, and what it says."""

NO_CHANGE = "─"
"""What stands for ``NOTHING`` in a table of changes, in which no row says that nothing has changed. Elsewhere it is
between two rows, and what is missing there has a mark of its own."""


def drawn(marks: Sequence[Mark], *, only_changes: bool) -> str:
    """Return a strip as characters."""
    nothing = NO_CHANGE if only_changes else MARKS[Mark.ROWS][0]
    return "".join(nothing if mark is Mark.NOTHING else MARKS[mark][0] for mark in marks)


def legend(marks: Sequence[Mark], *, only_changes: bool) -> list[str]:
    """Return what the marks of a strip say, of those that do not speak for themselves."""
    told = [" ".join(MARKS[mark]) for mark in sorted(set(marks)) if mark > Mark.ROWS]
    return [f"{NO_CHANGE} no change", *told] if only_changes and Mark.NOTHING in marks else told


class TimeStrip:
    """Marks over time, in cells that become twice as long when there is no room for what comes."""

    def __init__(self) -> None:
        self._start_ns: int | None = None
        self._cell_ns = _FIRST_CELL_NS
        self._marks = np.zeros(_CELLS, np.uint8)

    def take(self, time_ns: I64) -> None:
        """Take the times of rows."""
        if not len(time_ns):
            return
        if self._start_ns is None:
            self._start_ns = int(time_ns[0])
        self._make_room(int(time_ns.max()))
        cells = np.clip((time_ns - self._start_ns) // self._cell_ns, 0, _CELLS - 1)
        rows = np.bincount(cells, minlength=_CELLS) > 0
        self._marks[rows] = np.maximum(self._marks[rows], Mark.ROWS)

    def mark(self, mark: Mark, first_ns: int, last_ns: int) -> None:
        """Mark a stretch of time."""
        if self._start_ns is None:
            self._start_ns = first_ns
        self._make_room(last_ns)
        first, last = (
            min(max((time_ns - self._start_ns) // self._cell_ns, 0), _CELLS - 1) for time_ns in (first_ns, last_ns)
        )
        cells = self._marks[first : last + 1]
        np.maximum(cells, np.uint8(mark), out=cells)

    def cells(self, count: int) -> list[Mark]:
        """Return so many cells, or as many as there are, over the time that was taken.

        What lies between two rows that follow each other as usual is a part of these, whatever cell each begins in.
        """
        used = np.flatnonzero(self._marks)
        if not len(used):
            return []
        length = int(used[-1]) + 1
        marks = self._marks[:length].copy()
        steps = np.diff(used)
        of_rows = marks[used] == Mark.ROWS
        between = steps[of_rows[1:] & of_rows[:-1]]
        if len(between):
            usual = int(np.median(between)) * _USUAL[0] // _USUAL[1] + 1
            # Before each cell that has a mark: whether those in front of it are spanned.
            spanned = np.repeat(steps <= usual, steps)
            marks[used[0] + 1 :][spanned & (marks[used[0] + 1 :] == Mark.NOTHING)] = Mark.ROWS
        bounds = [place * length // count for place in range(count + 1)] if length > count else list(range(length + 1))
        told = [Mark(int(marks[first:last].max())) for first, last in pairwise(bounds)]
        if length >= count:
            return told
        return [told[place * length // count] for place in range(count)]

    def _make_room(self, last_ns: int) -> None:
        assert self._start_ns is not None
        while (last_ns - self._start_ns) // self._cell_ns >= _CELLS:
            self._marks[: _CELLS // 2] = np.maximum(self._marks[::2], self._marks[1::2])
            self._marks[_CELLS // 2 :] = 0
            self._cell_ns *= 2
