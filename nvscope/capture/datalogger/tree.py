"""The tree of pages of one table: its leaves in the order of row ids, a stretch at a time.

::

    page   kind 5 or 13 | freeblock … | cells … | start of content … | fragments | (rightmost child) | places of cells …
    cell of kind 5   child | last row id of the child

No page is looked at twice, so a tree that leads back into itself ends. Source:
https://www.sqlite.org/fileformat2.html, section 1.6.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from dissectors.datalogger.varints import varints
from nvscope.capture.datalogger.damage import Damages, Harm
from nvscope.capture.datalogger.lost_cells import LEAST_ROWID, MOST_ROWID, between, lost_cells
from nvscope.capture.datalogger.page_file import HEADER_BYTES, PageFile

INTERIOR, LEAF = 5, 13
LEAF_HEAD_BYTES, _INTERIOR_HEAD_BYTES = 8, 12

_MOST_DEPTH = 20
"""As SQLite itself limits it."""


class Leaves(Struct, frozen=True):
    """Pages that should be leaves, and the bounds of their row ids: above ``low`` and not above ``high``.

    The first page of all has no lower bound: there, ``low`` itself is one of the ids.
    """

    page: I64
    low: I64
    high: I64


class _Branch(Struct, frozen=True):
    page: int
    low: int
    high: int
    depth: int


class Tree:
    """A table by its root page; ``damages`` tells what could not be read."""

    def __init__(self, file: PageFile, root: int, damages: Damages) -> None:
        self._file, self._root, self.damages = file, root, damages
        self.seen: Bool = np.zeros(file.pages + 1, np.bool_)
        """Pages that were met; parts of long rows are added by who reads them."""

    @property
    def is_of_table(self) -> bool:
        """Whether the root is a page of rows by id; else they lie in the order of a key (WITHOUT ROWID)."""
        if self._root == 1:
            return True
        return self._file.kind(self._root) in (INTERIOR, LEAF)

    def leaves(self) -> Iterator[Leaves]:
        """Yield the leaves, in their order."""
        branches = [_Branch(self._root, LEAST_ROWID, MOST_ROWID, 0)]
        while branches:
            branch = branches.pop()
            if branch.depth > _MOST_DEPTH:
                self._lost(Harm.TOO_DEEP, branch)
                continue
            if not self._is_new(branch):
                continue
            page = self._file.page(branch.page)
            if page is None:
                self._lost(Harm.UNREADABLE, branch)
                continue
            kind = page[HEADER_BYTES if branch.page == 1 else 0]
            if kind == LEAF:
                yield Leaves(*(np.array([value], np.int64) for value in (branch.page, branch.low, branch.high)))
            elif kind == INTERIOR:
                children = self._children(np.frombuffer(page, np.uint8), branch)
                if self._are_leaves(children.page):
                    children = self._new(children)
                    if len(children.page):
                        yield children
                else:
                    rows = zip(children.page.tolist(), children.low.tolist(), children.high.tolist(), strict=True)
                    branches.extend(reversed([_Branch(*row, branch.depth + 1) for row in rows]))
            else:
                self._lost(Harm.NOT_OF_TABLE, branch)

    def _children(self, page: U8, branch: _Branch) -> Leaves:
        """Return what an interior page refers to; cells that lie outside it are damage."""
        usable = self._file.header.usable_bytes
        head = HEADER_BYTES if branch.page == 1 else 0
        most = (usable - head - _INTERIOR_HEAD_BYTES) // 2
        count = min(int.from_bytes(page[head + 3 : head + 5].tobytes(), "big"), most)
        places = head + _INTERIOR_HEAD_BYTES
        cell = page[places : places + 2 * count].view(">u2").astype(np.int64)
        good = (cell >= places + 2 * count) & (cell <= usable - 5)
        at = np.where(good, cell, 0)
        child = np.zeros(count, np.int64)
        for place in range(4):
            child = child << 8 | page[at + place]
        key, used = varints(page, at + 4, np.full(count, usable))
        # Keys rise, and lie within those of the page above.
        good &= (used > 0) & (key >= branch.low) & (key <= branch.high)
        before = np.concatenate([[LEAST_ROWID], np.maximum.accumulate(np.where(good, key, LEAST_ROWID))[:-1]])[:count]
        good &= key >= before
        last = int.from_bytes(page[head + 8 : head + 12].tobytes(), "big")
        self._tell_lost(key, good, branch)
        child, key = child[good], key[good]
        low = np.concatenate([[branch.low], key]).astype(np.int64)
        high = np.concatenate([key, [branch.high]]).astype(np.int64)
        return Leaves(np.append(child, last), low, high)

    def _tell_lost(self, key: I64, good: Bool, branch: _Branch) -> None:
        """Tell of children that are lost with their cells: how far their rows go, no other cell says."""
        if good.all():
            return
        one = np.zeros(len(key), np.int64)
        for lost in lost_cells(one, key, good, np.array([branch.low]), np.array([branch.high])):
            self.damages.add(between(Harm.BAD_CELL, branch.page, lost.low, lost.high, partly=True))

    def _are_leaves(self, pages: I64) -> bool:
        """Return whether what an interior page refers to are leaves, by the first that can be told."""
        for page in pages.tolist():
            kind = self._file.kind(page)
            if kind in (INTERIOR, LEAF):
                return kind == LEAF
        return True

    def _is_new(self, branch: _Branch) -> bool:
        if not 0 < branch.page <= self._file.pages:
            self._lost(self._harm(branch.page), branch)
            return False
        if self.seen[branch.page]:
            self._lost(Harm.TWICE, branch)
            return False
        self.seen[branch.page] = True
        return True

    def _new(self, leaves: Leaves) -> Leaves:
        """Return leaves without those that are not there or were met before."""
        page = leaves.page
        there = (page > 1) & (page <= self._file.pages)
        again = self.seen[np.where(there, page, 0)] & there
        order = np.argsort(page, kind="stable")
        again[order[1:]] |= page[order[1:]] == page[order[:-1]]
        good = there & ~again
        self.seen[page[good]] = True
        if good.all():
            return leaves
        for row in np.flatnonzero(~good).tolist():
            number = int(page[row])
            harm = Harm.TWICE if again[row] and there[row] else self._harm(number)
            self.damages.add(between(harm, number, int(leaves.low[row]), int(leaves.high[row])))
        return Leaves(page[good], leaves.low[good], leaves.high[good])

    def _harm(self, page: int) -> Harm:
        return Harm.MISSING if page > self._file.pages and self._counts(page) else Harm.NO_SUCH_PAGE

    def _counts(self, page: int) -> bool:
        """Return whether the header of the file counts a page."""
        return page <= self._file.pages + self._file.pages_missing

    def _lost(self, harm: Harm, branch: _Branch) -> None:
        self.damages.add(between(harm, branch.page, branch.low, branch.high))
