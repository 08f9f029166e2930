"""Rows of leaves, as columns: where the record of each lies, and its row id.

::

    leaf   13 | freeblock 0 0 | cells 0 0 | start of content 0 0 | fragments | places of cells … | (free) | cells …
    cell   length of the record | row id | record, or as much of it as the page holds | (page in which it goes on)

Source: https://www.sqlite.org/fileformat2.html, sections 1.6 and 1.7.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, U8, Bool
from dissectors.datalogger.varints import varints
from nvscope.capture.datalogger.lost_cells import LEAST_ROWID, LostCells, lost_cells, rising
from nvscope.capture.datalogger.page_file import HEADER_BYTES, Header
from nvscope.capture.datalogger.tree import LEAF, LEAF_HEAD_BYTES, Leaves

POINTER_BYTES = 4
"""The number of the page in which a record goes on."""

_MOST_RECORD_BYTES = 1 << 31


class LeafRows(Struct, frozen=True):
    """Rows in the order of their ids; ``leaf`` is the place of the page of each among those that were asked for.

    The record has ``length`` bytes, of which ``local`` lie at ``start``; if that is not all of them, the number of the
    page in which it goes on stands behind them. ``bad_leaf`` are pages that are no leaves, ``lost`` are cells of others
    that are left out.
    """

    leaf: I64
    rowid: I64
    start: I64
    length: I64
    local: I64
    bad_leaf: Bool
    lost: tuple[LostCells, ...] = ()

    def __len__(self) -> int:
        return len(self.rowid)

    def take(self, rows: slice | Bool) -> LeafRows:
        """Return some of the rows; where they start and end can be changed in them."""
        return replace(
            self,
            leaf=self.leaf[rows],
            rowid=self.rowid[rows],
            start=self.start[rows].copy(),
            length=self.length[rows].copy(),
            local=self.local[rows],
        )

    @property
    def goes_on(self) -> Bool:
        """Which rows lie in other pages, too."""
        return self.local < self.length


def rows_of(data: U8, leaves: Leaves, header: Header) -> LeafRows:
    """Return the rows of leaves, the pages of which lie one behind the other in ``data``."""
    usable = header.usable_bytes
    base = np.arange(len(leaves.page), dtype=np.int64) * header.page_bytes
    head = np.where(leaves.page == 1, HEADER_BYTES, 0)
    at = base + head
    count = data[at + 3].astype(np.int64) << 8 | data[at + 4]
    bad_leaf = (data[at] != LEAF) | (count > (usable - head - LEAF_HEAD_BYTES) // 2)
    count[bad_leaf] = 0
    leaf = np.repeat(np.arange(len(base)), count)
    # The number of a cell within its page: its place among all, without those of the pages before.
    number = np.arange(len(leaf)) - np.repeat(np.cumsum(count) - count, count)
    page = base[leaf]
    places = page + head[leaf] + LEAF_HEAD_BYTES
    place = places + 2 * number
    cell = data[place].astype(np.int64) << 8 | data[place + 1]
    good = (page + cell >= places + 2 * count[leaf]) & (cell <= usable - POINTER_BYTES)
    if not good.all():
        cell = np.where(good, cell, 0)
    stop = page + usable
    length, used = varints(data, page + cell, stop)
    rowid, rowid_used = varints(data, page + cell + used, stop)
    start = page + cell + used + rowid_used
    good &= (used > 0) & (rowid_used > 0) & (length >= 0) & (length < _MOST_RECORD_BYTES)
    local = _local(length, usable)
    good &= start + local + np.where(local < length, POINTER_BYTES, 0) <= stop
    low = leaves.low[leaf]
    good &= (rowid > low) | ((rowid == low) & (low == LEAST_ROWID))
    good &= rowid <= leaves.high[leaf]
    good = _rising(leaf, rowid, good)
    if good.all():
        return LeafRows(leaf, rowid, start, length, local, bad_leaf)
    lost = tuple(lost_cells(leaf, rowid, good, leaves.low, leaves.high))
    return LeafRows(leaf[good], rowid[good], start[good], length[good], local[good], bad_leaf, lost)


def _local(length: I64, usable: int) -> I64:
    """Return how many bytes of a record lie in its leaf."""
    most = usable - 35
    over = length > most
    if not over.any():
        return length
    least = (usable - 12) * 32 // 255 - 23
    local = least + (length - least) % (usable - POINTER_BYTES)
    return np.where(over, np.where(local <= most, local, least), length)


def _rising(leaf: I64, rowid: I64, good: Bool) -> Bool:
    """Return the good rows without those whose ids are out of the order of the others in their page."""
    if len(rowid) < 2:
        return good
    if good.all() and ((rowid[1:] > rowid[:-1]) | (leaf[1:] != leaf[:-1])).all():
        return good
    good = good.copy()
    # Damage is rare, so pages that have some are gone through one by one.
    rows = np.flatnonzero(good)
    wrong = np.flatnonzero((rowid[rows[1:]] <= rowid[rows[:-1]]) & (leaf[rows[1:]] == leaf[rows[:-1]]))
    for page in dict.fromkeys(leaf[rows[wrong]].tolist()):
        first, stop = np.searchsorted(leaf[rows], [page, page + 1])
        good[rows[first:stop]] = rising(rowid[rows[first:stop]])
    return good
