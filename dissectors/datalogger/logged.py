"""Logged: which packets are rows of DataLogger databases, of which tables, and what it takes to read them.

The bytes of such a packet are the row's record as it lies in the file. What its columns are stands in no record, so
tables travel with the batch: whoever cuts, takes or joins batches has them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from dissectors.datalogger.tables import LogTable

NO_TABLE = -1
"""In place of the number of a table: a packet that is no row."""


class RowTable(Struct, frozen=True):
    """A table of a database: whose rows they are (``series``, files that follow each other are one), as people call it.

    ``real`` are the numbers of columns that hold real numbers; texts are in ``encoding``. Between rows of one ``part``
    of a series no file is missing.
    """

    series: str
    title: str
    log: LogTable
    real: tuple[int, ...] = ()
    encoding: str = "utf-8"
    part: int = 0


class Logged(Struct, frozen=True):
    """A row a packet: the number of its table, ``NO_TABLE`` for none, and the row id. Shapes (n,).

    ``unread`` are the rows in front of which others are in the file that nobody can read.
    """

    tables: tuple[RowTable, ...]
    table: I64
    rowid: I64
    unread: Bool

    def __len__(self) -> int:
        return len(self.table)

    def take(self, rows: I64 | Bool | slice) -> Logged:
        """Return those of some packets."""
        return Logged(self.tables, self.table[rows], self.rowid[rows], self.unread[rows])

    @staticmethod
    def of(table: RowTable, rowid: I64, unread: Bool) -> Logged:
        """Return rows that all are of one table."""
        number = np.array(0, np.int64)
        number.flags.writeable = False
        return Logged((table,), np.ndarray((len(rowid),), np.int64, number, 0, (0,)), rowid, unread)

    @staticmethod
    def joined(parts: Sequence[Logged | None], counts: Sequence[int]) -> Logged | None:
        """Return what is known of batches of so many packets, one behind the other; None where none has rows."""
        if all(part is None for part in parts):
            return None
        tables: dict[RowTable, int] = {}
        table, rowid, unread = [], [], []
        for part, count in zip(parts, counts, strict=True):
            if part is None:
                table.append(np.full(count, NO_TABLE))
                rowid.append(np.zeros(count, np.int64))
                unread.append(np.zeros(count, np.bool_))
                continue
            # Behind the last one stands that there is none, whose number is -1.
            numbers = np.array([*(tables.setdefault(one, len(tables)) for one in part.tables), NO_TABLE], np.int64)
            table.append(numbers[part.table])
            rowid.append(part.rowid)
            unread.append(part.unread)
        return Logged(tuple(tables), np.concatenate(table), np.concatenate(rowid), np.concatenate(unread))
