"""Rows of a table as SQLite hands them over: slower by far, for tables that only SQLite can read.

Those are tables without row ids, with a column that stands for the row id, or with defaults for values that a row has
not.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.datalogger.records import Cells, Form
from dissectors.datalogger.tables import quoted
from nvscope.capture.can.sqlite_file import Database, Text
from nvscope.capture.datalogger.damage import Damage, Damages, Harm

_ROWS = 4_000
_MOST_CELLS = 1 << 18
_ROWID_NAMES = ("rowid", "oid", "_rowid_")


class SqlRows:
    """Some rows of a table; texts are in UTF-8."""

    def __init__(self, rows: Sequence[Sequence[object]]) -> None:
        self.rowid: I64 = np.array([row[0] for row in rows], np.int64)
        self._values = [[row[column] for row in rows] for column in range(1, len(rows[0]))]
        self._buffer: list[bytes] = []
        self._cells: dict[int, Cells] = {}
        size = 0
        for column, values in enumerate(self._values):
            self._cells[column], size = self._read(values, size)
        self.data: U8 = np.frombuffer(b"".join(self._buffer), np.uint8)

    def __len__(self) -> int:
        return len(self.rowid)

    def cells(self, column: int, rows: I64 | None = None) -> Cells:
        """Return the values of a column, from 0, of all rows or of some."""
        cells = self._cells[column]
        if rows is None:
            return cells
        return Cells(cells.form[rows], cells.bits[rows], cells.start[rows], lambda: cells.stop[rows])

    def is_empty(self, column: int) -> bool:
        """Return whether a column is NULL in all rows."""
        return not self._cells[column].form.any()

    def filled(self, column: int) -> Bool:
        """Return where a column is not NULL."""
        filled: Bool = self._cells[column].form != Form.NULL
        return filled

    def _read(self, values: Sequence[object], size: int) -> tuple[Cells, int]:
        count = len(values)
        form, bits = np.zeros(count, np.uint8), np.zeros(count, np.int64)
        start, stop = np.zeros(count, np.int64), np.zeros(count, np.int64)
        for row, value in enumerate(values):
            if isinstance(value, int):
                form[row], bits[row] = Form.INTEGER, value
            elif isinstance(value, float):
                form[row], bits[row] = Form.REAL, np.float64(value).view(np.int64)
            elif isinstance(value, bytes):
                form[row] = Form.TEXT if isinstance(value, Text) else Form.BLOB
                start[row], stop[row] = size, size + len(value)
                size += len(value)
                self._buffer.append(bytes(value))
        return Cells(form, bits.view(np.uint64), start, lambda: stop), size


def sql_rows(database: Database, table: str, columns: Sequence[str], damages: Damages) -> Iterator[SqlRows]:
    """Yield the rows of a table, some thousand at a time; where SQLite gives up, that is told to ``damages``."""
    names = ", ".join(map(quoted, columns))
    taken = {column.lower() for column in columns}
    rowid = next((name for name in _ROWID_NAMES if name not in taken), None)
    last: int | None = None
    most = max(1, min(_ROWS, _MOST_CELLS // (len(columns) + 1)))
    try:
        rows = _numbered(database, names, quoted(table), rowid)
        while part := list(islice(rows, most)):
            chunk = SqlRows(part)
            last = int(chunk.rowid[-1])
            yield chunk
    except sqlite3.Error:
        damages.add(Damage(Harm.NOT_OF_TABLE, 0, after=last))


def _numbered(database: Database, names: str, table: str, rowid: str | None) -> Iterator[Sequence[object]]:
    """Yield rows with their ids in front; without such ids they are counted from 1."""
    if rowid is not None:
        try:
            yield from database.execute(f"SELECT {rowid}, {names} FROM {table}")
            return
        except sqlite3.OperationalError as error:
            if "no such column" not in str(error):
                raise
    for number, row in enumerate(database.execute(f"SELECT {names} FROM {table}"), 1):
        yield (number, *row)
