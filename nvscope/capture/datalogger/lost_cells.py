"""Cells of a page that cannot be read, by the row ids between which they lie."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.capture.datalogger.damage import Damage, Harm

LEAST_ROWID, MOST_ROWID = -(1 << 63), (1 << 63) - 1


class LostCells(NamedTuple):
    """Cells that follow each other in a page, by the place of that among those that were asked for.

    Their row ids are above ``low`` and not above ``high``.
    """

    leaf: int
    cells: int
    low: int
    high: int

    def damage(self, page: int) -> Damage:
        """Return what is lost with them: rows by their ids where these have no other place."""
        if self.high - self.low == self.cells and self.low != LEAST_ROWID:
            return Damage(
                Harm.BAD_CELL, page, rows=tuple(range(self.low + 1, self.high + 1)), row_count=self.cells
            )  # fmt: skip
        return between(Harm.BAD_CELL, page, self.low, self.high)


def lost_cells(leaf: I64, rowid: I64, good: Bool, low: I64, high: I64) -> Iterator[LostCells]:
    """Yield the cells that are not good, page by page, each stretch of them; ``low`` and ``high`` are of the pages.

    A logger numbers its rows without a gap, so that what lies around a stretch mostly says which rows are lost.
    """
    bad = np.flatnonzero(~good)
    first = np.flatnonzero(np.diff(bad, prepend=-2) != 1)
    # What goes on in the next page is another stretch.
    first = np.union1d(first, np.flatnonzero(np.diff(leaf[bad], prepend=-1)))
    stops = np.append(first[1:], len(bad))
    for start, stop in zip(bad[first].tolist(), (bad[stops - 1] + 1).tolist(), strict=True):
        page = int(leaf[start])
        before = start > 0 and leaf[start - 1] == page
        behind = stop < len(leaf) and leaf[stop] == page
        least = int(rowid[start - 1]) if before else int(low[page])
        most = int(rowid[stop]) - 1 if behind else int(high[page])
        # Nothing fits between two rows that follow each other: what was there has lost its id, too.
        yield LostCells(page, stop - start, least, max(most, least + 1) if least < MOST_ROWID else most)


def between(harm: Harm, page: int, low: int, high: int, *, partly: bool = False) -> Damage:
    """Return the loss of all rows within bounds, or with ``partly`` of some, at a page."""
    after, until = None if low == LEAST_ROWID else low, None if high == MOST_ROWID else high
    return Damage(harm, page, after=after, until=until, partly=partly)


def rising(rowid: I64) -> Bool:
    """Return the rows that stay when as few as possible are left out of a page, so that all ids rise."""
    ids = rowid.tolist()
    ends: list[int] = []  # the least id with which so many rising ones can end
    places: list[int] = []
    before = [-1] * len(ids)
    for place, one in enumerate(ids):
        at = bisect_left(ends, one)
        before[place] = places[at - 1] if at else -1
        ends[at : at + 1] = [one]
        places[at : at + 1] = [place]
    kept = np.zeros(len(ids), np.bool_)
    place = places[-1] if places else -1
    while place >= 0:
        kept[place] = True
        place = before[place]
    return kept
