"""The tables of a database: what its first pages say of them, and SQLite of their definitions.

The definitions are texts of strangers. They are read with the database's other rows, so that a file of which much is
missing still has them, and handed to SQLite in a database in memory, where they can do nothing but make a table.
Source: https://www.sqlite.org/fileformat2.html, section 2.6.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing

from msgspec import Struct

from dissectors.datalogger.records import Form
from dissectors.datalogger.tables import LogTable, quoted, recognise
from nvscope.capture.datalogger.damage import Damages
from nvscope.capture.datalogger.page_file import PageFile
from nvscope.capture.datalogger.table_rows import Rows, table_rows
from nvscope.capture.datalogger.tree import Tree

MOST_TABLES = 100
"""So many of a database are looked at."""

_TYPE, _NAME, _TABLE_OF, _ROOT, _SQL = range(5)
_MOST_STEPS = 1_000_000
_MADE_UP = {1, 2, 3}
_MAKING = frozenset(
    {
        sqlite3.SQLITE_CREATE_TABLE, sqlite3.SQLITE_CREATE_INDEX, sqlite3.SQLITE_INSERT, sqlite3.SQLITE_UPDATE,
        sqlite3.SQLITE_READ,
    }
)  # fmt: skip


class StoredTable(Struct, frozen=True):
    """A table of a DataLogger and where its rows are.

    ``columns`` are its names, ``real`` the numbers of columns that hold real numbers. ``by_pages``: its rows can be
    read as they lie in the file; else only SQLite knows what they are.
    """

    log: LogTable
    root: int
    columns: tuple[str, ...]
    real: tuple[int, ...]
    by_pages: bool


class Schema(Struct, frozen=True):
    """The tables of DataLoggers, in the order of the file; the names of others; how many were not looked at."""

    tables: tuple[StoredTable, ...]
    others: tuple[str, ...]
    left_out: int


def read_schema(file: PageFile, damages: Damages) -> Schema:
    """Return the tables of a database; what cannot be read of their definitions goes to ``damages``."""
    found: list[StoredTable] = []
    others: list[str] = []
    left_out = 0
    encoding = file.header.encoding
    for rows in table_rows(file, Tree(file, 1, damages), 5, ()):
        for name, root, sql in _definitions(rows, encoding):
            if name.startswith("sqlite_"):
                continue
            if len(found) + len(others) >= MOST_TABLES:
                left_out += 1
                continue
            table = _table(name, root, sql, file)
            if table is None:
                others.append(name)
            else:
                found.append(table)
    return Schema(tuple(found), tuple(others), left_out)


def _definitions(rows: Rows, encoding: str) -> Iterator[tuple[str, int, str]]:
    kind, name, root, sql = (rows.cells(column) for column in (_TYPE, _NAME, _ROOT, _SQL))
    for row in range(len(rows)):
        if root.form[row] != Form.INTEGER or any(cells.form[row] != Form.TEXT for cells in (kind, name, sql)):
            continue
        texts = [
            rows.data[cells.start[row] : cells.stop[row]].tobytes().decode(encoding, "replace")
            for cells in (kind, name, sql)
        ]
        if texts[0] == "table":
            yield texts[1], int(root.integers[row]), texts[2]


def _table(name: str, root: int, sql: str, file: PageFile) -> StoredTable | None:
    columns = _columns(sql)
    if columns is None or root < 2:
        return None
    log = recognise(name, [(column, declared) for column, declared, *_ in columns])
    if log is None or any(hidden in _MADE_UP for *_, hidden in columns):
        return None
    real = tuple(number for number, (_, declared, *_) in enumerate(columns) if _is_real(declared))
    names = tuple(column for column, *_ in columns)
    # The id stands for a column that is its alias, and a default for values that a row has not.
    plain = all(key == 0 and (default is None or default.upper() == "NULL") for _, _, default, key, _ in columns)
    return StoredTable(log, root, names, real, plain and file.kind(root) not in _WITHOUT_ROWID)


_WITHOUT_ROWID = (2, 10)
"""Kinds of pages whose rows lie in the order of a key."""


def _columns(sql: str) -> list[tuple[str, str, str | None, int, int]] | None:
    """Return name, declared type, default, place in the key and whether it is made up, of each column; None where the
    text is no definition of a table."""
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        steps = 0

        def judge(action: int, *named: str | None) -> int:
            # Nothing but what making a table does: not from another one, and no functions.
            return sqlite3.SQLITE_OK if action in _MAKING else sqlite3.SQLITE_DENY

        def step() -> bool:
            nonlocal steps
            steps += 1
            return steps > _MOST_STEPS // 1000

        connection.set_progress_handler(step, 1000)
        connection.set_authorizer(judge)
        try:
            connection.execute(sql)
            connection.set_authorizer(None)
            (name,) = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchone()
            rows = connection.execute(f"PRAGMA table_xinfo({quoted(name)})").fetchall()
        except (sqlite3.Error, sqlite3.Warning, ValueError, TypeError, UnicodeError):
            return None
    return [
        (str(column), str(declared or ""), None if default is None else str(default), int(key), int(hidden))
        for _, column, declared, _, default, key, hidden in rows
    ]


def _is_real(declared: str) -> bool:
    """Return whether SQLite keeps whole numbers of a column as real ones (https://www.sqlite.org/datatype3.html)."""
    words = declared.upper()
    if "INT" in words or any(word in words for word in ("CHAR", "CLOB", "TEXT", "BLOB")):
        return False
    return any(word in words for word in ("REAL", "FLOA", "DOUB"))
