"""Law: the rows that a database says are left are those that SQLite finds in its files."""

from __future__ import annotations

import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.datalogger.leaves import NumberColumns
from dissectors.datalogger.tables import LoggedVariable, LogTable
from nvscope.capture.datalogger.names import closed_files
from nvscope.datalogger.configuration_file import read_configuration
from nvscope.datalogger.database import Database
from tests.datalogger.plants import configuration

TABLE = LogTable("log_1", True, (LoggedVariable("a", "INT", 2), LoggedVariable("b", "INT", 3)))
OLD, NEW = 0, 1


def write(database: Database, sizes: list[int], mark: int) -> None:
    """Write blocks of rows, all of whose values are the mark."""
    database.open(append=True)
    for size in sizes:
        database.write([NumberColumns(np.full((size, 4), mark))], size)
        database.make_room()
    database.close()


def rows_of(path: str, mark: int) -> int:
    with closing(sqlite3.connect(path)) as connection:
        return int(connection.execute("SELECT count(*) FROM log_1 WHERE a = ?", (mark,)).fetchone()[0])


@given(
    before=st.lists(st.integers(1, 400), max_size=3), after=st.lists(st.integers(1, 400), max_size=6),
    most=st.integers(1, 40_000), ratio=st.integers(1, 100), rollover=st.booleans(), files=st.integers(-1, 4),
)  # fmt: skip
def test_rows_left_are_there(
    before: list[int], after: list[int], most: int, ratio: int, rollover: bool, files: int
) -> None:
    sink = f'maxFileSize="{most}" deleteRatio="{ratio}" rollover="{str(rollover).lower()}" maxFiles="{files}"'
    with tempfile.TemporaryDirectory() as folder:
        config, path = Path(folder, "c.xml"), str(Path(folder, "log.db"))
        config.write_text(configuration(["a", "b"], "", sink), encoding="utf-8")
        session = read_configuration(str(config)).session
        write(Database(session, TABLE, path, durable=False), before, OLD)
        database = Database(session, TABLE, path, durable=False)
        write(database, after, NEW)
        there = [path, *(own for _, own in closed_files(path))]
        assert database.rows_left == sum(rows_of(one, NEW) for one in there)
        assert database.rows == sum(after)
        assert set(database.closed) <= set(there)
        assert not set(database.removed) & set(there)
