"""Rows of a table, read page by page: stretches of them in the order of their ids, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from dissectors.datalogger.records import Cells, Records
from nvscope.capture.datalogger.damage import Damage, Harm
from nvscope.capture.datalogger.leaf_rows import POINTER_BYTES, LeafRows, rows_of
from nvscope.capture.datalogger.long_rows import MOST_ROW_BYTES, LongRows, put_together
from nvscope.capture.datalogger.lost_cells import between
from nvscope.capture.datalogger.page_file import PageFile
from nvscope.capture.datalogger.tree import Leaves, Tree

_READ_BYTES = 1 << 20, 1 << 22
"""Bytes of leaves that are looked at together: the least, and the most where a page has few rows."""
_ROWS = 16_000
"""So many rows are wanted at a time, and never more: numpy has its costs by the call, and memory its bound."""
_MOST_CELLS = 1 << 22
_MOST_LONG_BYTES = 1 << 23


class Rows(Struct, frozen=True):
    """Some rows of a table: their ids, which rise, and their values by column. None of them is faulty.

    The record of each lies at ``start`` of ``data`` and has ``length`` bytes.
    """

    rowid: I64
    records: Records
    start: I64
    length: I64

    def __len__(self) -> int:
        return len(self.rowid)

    @property
    def data(self) -> U8:
        """The buffer that texts and blobs lie in."""
        return self.records.data

    def is_empty(self, column: int) -> bool:
        """Return whether a column is NULL in all rows."""
        return self.records.is_empty(column)

    def filled(self, column: int) -> Bool:
        """Return where a column is not NULL."""
        return self.records.filled(column)

    def cells(self, column: int, rows: I64 | None = None) -> Cells:
        """Return the values of a column, from 0, of all rows or of some."""
        return self.records.cells(column, rows)


def table_rows(file: PageFile, tree: Tree, columns: int, real: Sequence[int]) -> Iterator[Rows]:
    """Yield the rows of a table, some thousand at a time; what cannot be read is told to the tree's ``damages``."""
    most_rows = max(1, min(_ROWS, _MOST_CELLS // max(columns, 1)))
    for leaves in _together(file, tree, most_rows):
        data, found = file.read(leaves.page)
        rows = rows_of(data, leaves, file.header)
        for _, damage in sorted(_damages(rows, leaves, found), key=lambda one: one[0]):
            tree.damages.add(damage)
        for part in _parts(rows, most_rows):
            buffer, whole = _with_long_rows(file, tree, data, leaves, rows.take(part))
            records = Records(buffer, whole.start, whole.length, columns, real)
            if records.faulty.any():
                lost = np.flatnonzero(records.faulty)
                for leaf in dict.fromkeys(whole.leaf[lost].tolist()):
                    tree.damages.add(_rows_lost(Harm.BAD_RECORD, leaves, whole, lost[whole.leaf[lost] == leaf]))
                whole = whole.take(~records.faulty)
                records = Records(buffer, whole.start, whole.length, columns, real)
            if len(whole):
                yield Rows(whole.rowid, records, whole.start, whole.length)


def _damages(rows: LeafRows, leaves: Leaves, found: Bool) -> Iterator[tuple[int, Damage]]:
    """Yield what of leaves cannot be read, each with the place of its page; ``found`` are those that the disk has."""
    for place in np.flatnonzero(rows.bad_leaf).tolist():
        harm = Harm.NOT_OF_TABLE if found[place] else Harm.UNREADABLE
        low, high = int(leaves.low[place]), int(leaves.high[place])
        yield place, between(harm, int(leaves.page[place]), low, high)
    for lost in rows.lost:
        yield lost.leaf, lost.damage(int(leaves.page[lost.leaf]))


def _together(file: PageFile, tree: Tree, most_rows: int) -> Iterator[Leaves]:
    """Yield leaves, as many at a time as have about as many rows as are wanted."""
    page_bytes = file.page_bytes
    pages = max(1, _READ_BYTES[0] // page_bytes)
    waiting: list[Leaves] = []
    count = 0
    for leaves in tree.leaves():
        waiting.append(leaves)
        count += len(leaves.page)
        if count < pages:
            continue
        joined = _joined(waiting)
        for first in range(0, count, pages):
            yield _slice(joined, slice(first, first + pages))
        waiting, count = [], 0
        if pages * page_bytes < _READ_BYTES[1] and _rows_in(file, int(joined.page[-1])) * pages < most_rows:
            pages *= 2
    if waiting:
        yield _joined(waiting)


def _rows_in(file: PageFile, page: int) -> int:
    """Return how many rows a page says that it has."""
    content = file.page(page)
    return int.from_bytes(content[3:5], "big") if content else _ROWS


def _joined(leaves: Sequence[Leaves]) -> Leaves:
    return Leaves(*(np.concatenate([getattr(one, name) for one in leaves]) for name in ("page", "low", "high")))


def _slice(leaves: Leaves, rows: slice) -> Leaves:
    return Leaves(leaves.page[rows], leaves.low[rows], leaves.high[rows])


def _parts(rows: LeafRows, most_rows: int) -> Iterator[slice]:
    """Yield stretches of rows, none of which takes too much memory."""
    long_bytes = np.cumsum(np.where(rows.goes_on, np.minimum(rows.length, MOST_ROW_BYTES), 0))
    first = 0
    while first < len(rows):
        before = int(long_bytes[first - 1]) if first else 0
        stop = int(np.searchsorted(long_bytes, before + _MOST_LONG_BYTES, "right"))
        stop = min(max(stop, first + 1), first + most_rows, len(rows))
        yield slice(first, stop)
        first = stop


def _with_long_rows(file: PageFile, tree: Tree, data: U8, leaves: Leaves, rows: LeafRows) -> tuple[U8, LeafRows]:
    """Return rows of which none goes on elsewhere, and the buffer that they lie in."""
    places = np.flatnonzero(rows.goes_on)
    if not len(places):
        return data, rows
    start, local = rows.start[places].tolist(), rows.local[places].tolist()
    first = [data[at : at + size + POINTER_BYTES].tobytes() for at, size in zip(start, local, strict=True)]
    long: LongRows = put_together(file, tree.seen, first, rows.length[places].tolist())
    good = np.ones(len(rows), np.bool_)
    for place, harm in zip(places.tolist(), long.harm, strict=True):
        if harm is not None:
            good[place] = False
            tree.damages.add(_rows_lost(harm, leaves, rows, np.array([place])))
    rows.start[places] = long.start + len(data)
    rows.length[places] = long.length
    return np.concatenate([data, long.data]), rows.take(good)


def _rows_lost(harm: Harm, leaves: Leaves, rows: LeafRows, lost: I64) -> Damage:
    page = int(leaves.page[rows.leaf[lost[0]]])
    return Damage(harm, page, rows=tuple(rows.rowid[lost].tolist()), row_count=len(lost))
