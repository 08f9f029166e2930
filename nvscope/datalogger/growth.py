"""Growth: how large a database becomes by how many rows, measured on one in memory, as SQLite fills its pages."""

from __future__ import annotations

import os
import sqlite3
from bisect import bisect_left
from collections.abc import Sequence
from contextlib import closing
from fractions import Fraction
from itertools import cycle, islice

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from dissectors.datalogger.leaves import Block
from dissectors.datalogger.tables import LogTable, statement
from nvscope.datalogger.begun_files import begin_file
from nvscope.datalogger.columns import TableColumns
from nvscope.datalogger.configuration import Session
from nvscope.datalogger.database import IN_MEMORY, table_of, tuples
from nvscope.datalogger.existing import others_in
from nvscope.datalogger.logged import Content, Logged
from nvscope.datalogger.plan import Planned
from nvscope.datalogger.rows import Rows
from nvscope.datalogger.texts import Texts
from nvscope.definition.variables import Elementary, ScalarKind, String, scalar_of
from nvscope.units import count, count_of

_STEP_ROWS, _MEASURED_BYTES = 64, 1 << 19
_ROWID_BEFORE = 1 << 17
"""What rowids of a day need, which are longer than those of the first rows."""


class Growth(Struct, frozen=True):
    """The size of a database in bytes, behind each ``step_rows`` rows; the first one is that of an empty one."""

    step_rows: int
    sizes: tuple[int, ...]

    @property
    def empty_bytes(self) -> int:
        return self.sizes[0]

    @property
    def row_bytes(self) -> Fraction:
        """How much a row adds, with its part of what SQLite keeps of pages."""
        return Fraction(self.sizes[-1] - self.sizes[0], self.step_rows * (len(self.sizes) - 1))

    def rows_until(self, size_bytes: int) -> int:
        """Return with how many rows, at least, a database is so large."""
        steps = bisect_left(self.sizes, size_bytes)
        if steps == len(self.sizes):
            return -(-(size_bytes - self.empty_bytes) // self.row_bytes)
        return max(steps * self.step_rows, 1)


def always_full(planned: Planned, *, append: bool = False) -> str:
    """Return a sentence, with its place, that a database is full before it has a row; '' where it is not.

    ``append``: tables of other variables that are in the file stay in it when their rows are gone.
    """
    session = planned.session
    if session.max_bytes is None:
        return ""
    table = table_of(session, planned.logged)
    with closing(_begun(table)) as connection:
        empty_bytes = _size(connection)
        page_bytes = connection.execute("PRAGMA page_size").fetchone()[0]
    others = 0
    if append and planned.deletes_oldest and os.path.isfile(planned.path):
        others = others_in(planned.path, table)
        empty_bytes += others * page_bytes
    if empty_bytes < session.max_bytes:
        return ""
    beside = f", with {count_of(others, 'other table')} that {planned.path} has," if others else ""
    then = "is deleted as soon as it is written" if planned.deletes_oldest else "fills a file"
    return (
        f"{session.places['max_bytes']}: Datasink, attribute maxFileSize: {count(session.max_bytes)} bytes are full "
        f"before there is a row: an empty database of these variables{beside} has {count(empty_bytes)}; "
        f"each block of rows {then}"
    )


def growth(planned: Planned) -> Growth:
    """Return how a database grows whose numbers are any, and whose texts are half full."""
    session, logged = planned.session, planned.logged
    table = table_of(session, logged)
    step_rows = min(session.block_rows, _STEP_ROWS)
    rows = cycle(tuples(_usual_rows(session, logged, _STEP_ROWS), _STEP_ROWS))
    insert = f"INSERT INTO {table.name} VALUES ({','.join('?' * table.columns)})"
    with closing(_begun(table)) as connection:
        sizes = [_size(connection)]
        connection.execute(f"INSERT INTO {table.name}(rowid) VALUES ({_ROWID_BEFORE})")
        while sizes[-1] - sizes[0] < _MEASURED_BYTES:
            connection.executemany(insert, islice(rows, step_rows))
            sizes.append(_size(connection))
    return Growth(step_rows, tuple(sizes))


def _begun(table: LogTable) -> sqlite3.Connection:
    connection = sqlite3.connect(IN_MEMORY, isolation_level=None)
    begin_file(connection)
    connection.execute(statement(table))
    return connection


def _size(connection: sqlite3.Connection) -> int:
    pages, page_bytes = (connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("page_count", "page_size"))
    return int(pages * page_bytes)


def _usual_rows(session: Session, logged: Sequence[Logged], rows: int) -> list[Block]:
    texts = Texts()
    cells = np.zeros((rows, len(logged)), np.int64)
    for column, one in enumerate(logged):
        if isinstance(one.type, String):
            half = np.full((rows, one.type.size_bytes), ord("x"), np.uint8)
            half[:, one.type.size_bytes // 2 :] = 0
            cells[:, column] = texts.numbers(one.type, half)
        elif one.content is Content.REAL:
            size = one.type.size_bytes
            cells[:, column] = np.array([0.1], f"f{size}").view(f"i{size}")[0]
        else:
            cells[:, column] = _integers(one.type, rows)
    counts = np.full(cells.shape, 1 << 16, np.int64)
    every = np.ones(rows, np.bool_)
    columns = TableColumns(logged, texts, raw=session.raw, only_changes=session.only_changes, document_style=False)
    return columns.of(Rows(np.zeros(rows, np.int64), every, cells, None, counts, np.zeros(rows, np.int64)))


def _integers(kind: Elementary, rows: int) -> I64:
    """Return integers that need all bytes of their type; half of those without a sign need more, with one."""
    scalar = scalar_of(kind)
    if scalar is not None and scalar.kind is ScalarKind.BOOL:
        return np.arange(rows) % 2
    most = (1 << 8 * kind.size_bytes - 1) - 1
    signed = scalar is not None and scalar.kind is ScalarKind.SIGNED
    return np.where(np.arange(rows) % 2 == 0, most, -1 - most if signed or kind.size_bytes == 8 else 2 * most + 1)
