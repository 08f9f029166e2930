"""Oldest rows: which rows of a full file make room, whichever of its tables they are of.

A file that was gone on with after its configuration had changed has other tables, of which all rows were there before
those of the run that writes. Of rows that were there before, the earlier ones go first; those of the run only when no
other ones are left.
"""

from __future__ import annotations

import sqlite3
from collections import Counter
from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import numpy as np
from msgspec import Struct, field

from dissectors.datalogger.tables import TIMESTAMP, LogTable, quoted
from dissectors.datalogger.timestamps import ISO_BYTES, iso_times, raw_times

_MOST_LOOKED_AT = 1000
"""So many times of a table are looked at: where more rows make room, those in between go with the next of these."""

_IDS = ("rowid", "_rowid_", "oid")
_NO_TIME = -(1 << 63)


class Deleted(Struct):
    """Rows that made room: ``own`` of the run, ``before`` of earlier runs in its table, ``others`` by their table."""

    own: int = 0
    before: int = 0
    others: Counter[str] = field(default_factory=Counter)

    @property
    def count(self) -> int:
        """How many there are."""
        return self.own + self.before + self.others.total()


class _Table(Struct):
    """A table that has rows; ``rowid`` is what their ids are called in it, ``until`` the last of those there before."""

    name: str
    rowid: str
    until: int


class _Part(Struct, frozen=True):
    """Rows of a table that follow each other, up to an id, the latest of them and those in front of it at a time."""

    table: _Table
    until: int
    rows: int
    time_ns: int


class OldestRows:
    """Deletes the oldest rows of an open file; ``own`` is the table of the run, ``found`` are all tables there.

    Rows that are there now are older than all that are written from now on. ``deleted`` are those of this file so far.
    """

    def __init__(self, connection: sqlite3.Connection, own: LogTable, found: Sequence[LogTable]) -> None:
        self._connection: Any = connection
        self.deleted = Deleted()
        rowid = _id_of(own)
        self._own = None if rowid is None else _Table(own.name, rowid, 0)
        if self._own is not None:
            self._own.until = self._last(self._own)
        self._others: list[_Table] = []
        for table in found:
            if table.name != own.name and (rowid := _id_of(table)) is not None:
                other = _Table(table.name, rowid, 0)
                try:
                    other.until = self._last(other)
                except sqlite3.OperationalError:
                    continue  # its rows have no ids: nobody knows which are the oldest
                self._others.append(other)

    @property
    def used_bytes(self) -> int:
        """How much of the file is used: where it does not shrink, what was deleted is written over."""
        pages, free, page_bytes = (
            self._connection.execute(f"PRAGMA main.{name}").fetchone()[0]
            for name in ("page_count", "freelist_count", "page_size")
        )
        return int((pages - free) * page_bytes)

    def make_room(self, most_bytes: int, percent: int) -> None:
        """Delete so much of all rows, as often as it takes to have less than ``most_bytes``, or no row.

        Raises sqlite3.Error; what is deleted by then is in ``deleted``.
        """
        while self.used_bytes >= most_bytes and self._delete(percent):
            pass

    def _delete(self, percent: int) -> bool:
        """Delete a part of all rows; return whether there is more."""
        self._others = [one for one in self._others if self._has_older(one)]
        counts = [self._count(one) for one in self._others]
        first, last = (0, -1) if self._own is None else self._bounds(self._own)
        total = sum(counts) + last - first + 1
        if not total:
            return False
        share = max(1, total * percent // 100)
        if not self._others:
            cuts = [] if self._own is None else [(self._own, first + share - 1)]
        else:
            cuts = self._older(share, first)
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            gone = [
                (table, until, self._connection.execute(f"DELETE FROM {_in(table)} WHERE {table.rowid} <= ?", [until]))
                for table, until in cuts
            ]
            self._connection.execute("COMMIT")
        except sqlite3.Error:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            raise
        for table, until, done in gone:
            if table is self._own:
                fresh = max(min(until, last) - max(table.until, first - 1), 0)
                self.deleted.own += fresh
                self.deleted.before += done.rowcount - fresh
                if until >= last:
                    table.until = 0  # the ids begin anew
            else:
                self.deleted.others[table.name] += done.rowcount
        return total > share

    def _older(self, share: int, first: int) -> list[tuple[_Table, int]]:
        """Return up to which ids rows of tables make room: those of earlier runs by their times, then the run's own."""
        own = self._own
        tables = self._others if own is None or own.until < first else [own, *self._others]
        parts = [part for table in tables for part in self._parts(table, share)]
        cuts: dict[str, tuple[_Table, int]] = {}
        left = share
        for part in sorted(parts, key=attrgetter("time_ns")):
            if left < part.rows:
                break
            cuts[part.table.name] = part.table, part.until
            left -= part.rows
        if own is not None and left and not self._any_left(cuts, tables):
            cuts[own.name] = own, max(own.until, first - 1) + left
        return list(cuts.values())

    def _any_left(self, cuts: dict[str, tuple[_Table, int]], tables: Sequence[_Table]) -> bool:
        return any(table.name not in cuts or cuts[table.name][1] < table.until for table in tables)

    def _parts(self, table: _Table, share: int) -> list[_Part]:
        """Return the first rows of a table that were there before, in parts that are taken as one."""
        step = -(-share // _MOST_LOOKED_AT)
        numbered = (
            f"SELECT {table.rowid} AS id, {TIMESTAMP} AS stamp, row_number() OVER (ORDER BY {table.rowid}) AS number "
            f"FROM {_in(table)} WHERE {table.rowid} <= ? ORDER BY {table.rowid} LIMIT ?"
        )
        rows = self._connection.execute(
            f"SELECT id, stamp, number FROM ({numbered}) WHERE number % ? = 0 OR id = ?",
            [table.until, share, step, table.until],
        )
        parts: list[_Part] = []
        number_before, latest_ns = 0, _NO_TIME
        for rowid, stamp, number in rows:
            # Where the clock was set back, rows stay in the order in which they were written.
            latest_ns = max(latest_ns, _time_of(stamp))
            parts.append(_Part(table, rowid, number - number_before, latest_ns))
            number_before = number
        return parts

    def _last(self, table: _Table) -> int:
        return int(self._connection.execute(f"SELECT max({table.rowid}) FROM {_in(table)}").fetchone()[0] or 0)

    def _bounds(self, table: _Table) -> tuple[int, int]:
        """Return the first and the last id of a table; those of none where it has no row."""
        asked = f"SELECT min({table.rowid}), max({table.rowid}) FROM {_in(table)}"
        first, last = self._connection.execute(asked).fetchone()
        return (0, -1) if first is None else (first, last)

    def _count(self, table: _Table) -> int:
        asked = f"SELECT count(*) FROM {_in(table)} WHERE {table.rowid} <= ?"
        return int(self._connection.execute(asked, [table.until]).fetchone()[0])

    def _has_older(self, table: _Table) -> bool:
        asked = f"SELECT EXISTS (SELECT 1 FROM {_in(table)} WHERE {table.rowid} <= ?)"
        return bool(self._connection.execute(asked, [table.until]).fetchone()[0])


def _in(table: _Table) -> str:
    return f"main.{quoted(table.name)}"


def _id_of(table: LogTable) -> str | None:
    """Return what the ids of rows are called where no variable has that name, None where some have all there are."""
    taken = {one.name.lower() for one in table.variables}
    return next((name for name in _IDS if name not in taken), None)


def _time_of(stamp: Any) -> int:
    """Return when a row was written by its timestamp; of one without a time, before all others."""
    if isinstance(stamp, int):
        time_ns, _, valid = raw_times(np.array([stamp], np.int64))
    elif isinstance(stamp, str) and len(data := stamp.encode()) == ISO_BYTES:
        time_ns, valid = iso_times(np.frombuffer(data, np.uint8).reshape(1, ISO_BYTES))
    else:
        return _NO_TIME
    return int(time_ns[0]) if valid[0] else _NO_TIME
