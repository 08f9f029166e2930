"""Rows of DataLogger databases in a packet batch: of which tables they are, and their values as columns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool, LinkType, PacketBatch
from dissectors.datalogger.logged import NO_TABLE, Logged, RowTable
from dissectors.datalogger.records import Form, Records

CONSISTENT = 1
"""The number of the column ConsistentDataSeries."""


class RowBatch(Struct, frozen=True):
    """The rows of a packet batch; ``row`` is that of the packet, ``logged`` has those of ``row`` alone."""

    packets: PacketBatch
    row: I64
    logged: Logged

    def __len__(self) -> int:
        return len(self.row)

    def take(self, rows: I64 | Bool) -> RowBatch:
        """Return those at the given positions or where the mask is set."""
        return RowBatch(self.packets, self.row[rows], self.logged.take(rows))

    @property
    def tables(self) -> tuple[RowTable, ...]:
        """The tables, by number."""
        return self.logged.tables

    def by_table(self) -> Iterator[tuple[RowTable, I64, Records]]:
        """Yield each table of which there are rows, the positions of these, rising, and their values."""
        for number, table in enumerate(self.tables):
            rows = np.flatnonzero(self.logged.table == number)
            if len(rows):
                packet = self.row[rows]
                offset, length = self.packets.offset[packet], self.packets.captured[packet].astype(np.int64)
                yield table, rows, Records(self.packets.data, offset, length, table.log.columns, table.real)


def dissect_rows(packets: PacketBatch) -> RowBatch:
    """Return the rows of databases of a packet batch. Total: what is no row of a known table is left out."""
    logged = packets.logged
    if logged is None:
        nothing = np.empty(0, np.int64)
        return RowBatch(packets, nothing, Logged((), nothing, nothing, nothing.astype(np.bool_)))
    own = np.flatnonzero((packets.link == LinkType.DATABASE_ROW) & (logged.table != NO_TABLE))
    return RowBatch(packets, own, logged.take(own))


def consistent(records: Records) -> Bool:
    """Tell which rows say that nothing was lost before them: all but those that hold the number 0."""
    cells = records.cells(CONSISTENT)
    told: Bool = (cells.form != Form.INTEGER) | (cells.bits != 0)
    return told


def says_whether(records: Records) -> Bool:
    """Tell which rows say whether anything was lost before them: those that hold 0 or 1."""
    cells = records.cells(CONSISTENT)
    said: Bool = (cells.form == Form.INTEGER) & (cells.bits <= 1)
    return said
