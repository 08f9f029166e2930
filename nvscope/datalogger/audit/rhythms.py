"""Rhythms: parts of a table in which rows do not come as they mostly do, since somebody configured it so.

Loggers go on with a table whatever interval their configuration says by then. Where they do, they say that data was
lost; so what stands between two rows that say this may have a rhythm of its own, and is judged by that. Where rows seem
to be missing, all intervals of the part have to be known for it, so the rows are read again.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit.intervals import Gaps, Intervals
from nvscope.tracker.readings.cadence import ALIKE_SHARE

_MOST_PARTS = 1 << 20
_MOST_IN_DOUBT = 10_000
"""So many parts are judged by themselves."""

OF_TABLE = -1
"""The rows of a part come as those of the table do."""

_NONE = 0
"""They come at no interval that is known."""


class Parts:
    """The parts of the rows of one task, by the numbers of the rows that begin them, which rise."""

    def __init__(self) -> None:
        self._begins: list[I64] = []
        self.count = 0
        self._in_doubt: set[int] = set()

    @property
    def in_doubt(self) -> I64:
        """The parts that may have a rhythm of their own, in their order."""
        return np.array(sorted(self._in_doubt), np.int64)

    def begin(self, number: I64) -> None:
        """Note rows with which parts begin."""
        self.count += len(number)
        if len(number) and self.count <= _MOST_PARTS:
            self._begins.append(number)

    def of(self, gaps: Gaps) -> I64:
        """Return the part that each gap is in."""
        begins = np.concatenate(self._begins) if self._begins else np.zeros(0, np.int64)
        return np.searchsorted(begins, gaps.number, "right") - 1

    def doubt(self, gaps: Gaps, *, though_it_is_one: bool) -> None:
        """Note that rows of some parts seem to be missing; where there is one part only, its rhythm is the table's."""
        if not len(gaps) or self.count > _MOST_PARTS or (self.count < 2 and not though_it_is_one):
            return
        left = max(_MOST_IN_DOUBT - len(self._in_doubt), 0)
        self._in_doubt.update(np.unique(self.of(gaps))[:left].tolist())


class Rhythms:
    """The intervals of some ``parts`` of a task, of which rows come every ``interval_ns`` mostly."""

    def __init__(self, parts: Iterable[int], interval_ns: int) -> None:
        self._parts = np.fromiter(parts, np.int64)
        self._interval_ns = interval_ns
        self._usual = np.zeros(len(self._parts), np.int64)
        self._intervals: dict[int, Intervals] = {}

    def take(self, gaps: Gaps, part: I64, judged: Bool) -> None:
        """Take rows as what may be gaps in front of them, the part of each, and which of these are intervals of it."""
        if not len(self._parts) or int(part[-1]) < self._parts[0] or int(part[0]) > self._parts[-1]:
            return
        rows = np.flatnonzero(judged)
        place = np.minimum(np.searchsorted(self._parts, part[rows]), len(self._parts) - 1)
        in_doubt = self._parts[place] == part[rows]
        rows, place = rows[in_doubt], place[in_doubt]
        length_ns = gaps.length_ns[rows]
        usual = np.abs(length_ns - self._interval_ns) * ALIKE_SHARE <= self._interval_ns
        self._usual += np.bincount(place[usual], minlength=len(self._parts))
        edges = np.flatnonzero(np.diff(place, prepend=-1)).tolist()
        for start, stop in pairwise([*edges, len(rows)]):
            own = self._intervals.setdefault(int(place[start]), Intervals.counted())
            own.take(gaps.take(rows[start:stop]))

    def own_ns(self, part: I64, *, least: int = 1) -> I64:
        """Return the interval that rows of some parts come at by themselves: ``OF_TABLE``, or 0 where none is known.

        Parts of fewer than ``least`` intervals are not asked.
        """
        parts, which = np.unique(part, return_inverse=True)
        own_ns = np.array([self._own_ns(one, least) for one in parts.tolist()], np.int64)
        found: I64 = own_ns[which]
        return found

    def _own_ns(self, part: int, least: int) -> int:
        place = int(np.searchsorted(self._parts, part))
        own = self._intervals.get(place) if part in self._parts else None
        if own is None or own.count < least or 2 * int(self._usual[place]) >= own.count:
            return OF_TABLE
        return own.median_ns or _NONE if own.is_regular else _NONE
