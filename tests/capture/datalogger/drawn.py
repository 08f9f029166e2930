"""Databases with anything in them that SQLite can store in a table of a DataLogger, and how they are read."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from hypothesis import strategies as st

from dissectors.datalogger.records import Form
from nvscope.capture.can import sqlite_file
from nvscope.capture.datalogger.damage import Damages
from nvscope.capture.datalogger.database import AnyRows, LogDatabase
from nvscope.capture.datalogger.schema import StoredTable
from nvscope.capture.datalogger.sql_rows import sql_rows

Value = object
DECLARED = ("TINYINT", "INT", "BIGINT", "FLOAT", "DOUBLE", "TEXT", "", "BLOB", "NUMERIC", "FLOATING POINT")

_WIDTHS = (0, 1, 2, 7, 8, 15, 16, 23, 24, 31, 32, 47, 48, 62)
_integers = st.builds(
    lambda width, sign, less: sign * (1 << width) - less, st.sampled_from(_WIDTHS), st.sampled_from((-1, 1)),
    st.sampled_from((0, 1)),
) | st.sampled_from([-(1 << 63), (1 << 63) - 1])  # fmt: skip
_sizes = st.sampled_from([0, 1, 5, 26, 57, 58, 59, 300, 3000, 70_000])
_texts = st.builds(lambda size, letter: letter * size, _sizes, st.sampled_from(["a", "ä", "𝔸"]))
_blobs = st.builds(lambda size, byte: bytes([byte]) * size, _sizes, st.integers(0, 255))
VALUES = st.none() | _integers | st.floats(allow_nan=False) | _texts | _blobs | st.sampled_from([2.0, -0.0, 1e300])


@dataclass(frozen=True)
class Made:
    """How a database is made."""

    page_bytes: int
    reserved_bytes: int
    encoding: str
    auto_vacuum: int
    declared: tuple[str, ...]
    rows: tuple[tuple[int, tuple[Value, ...]], ...]
    added: str | None
    rows_added: tuple[tuple[int, tuple[Value, ...]], ...]
    copies: int
    delete_every: int


def _rows(columns: int) -> st.SearchStrategy[tuple[tuple[int, tuple[Value, ...]], ...]]:
    row = st.tuples(_integers, st.tuples(*[VALUES] * columns))
    return st.lists(row, max_size=12, unique_by=lambda one: one[0]).map(tuple)


@st.composite
def databases(draw: st.DrawFn) -> Made:
    """Draw how a database is made."""
    declared = draw(st.lists(st.sampled_from(DECLARED), max_size=6).map(tuple))
    added = draw(st.none() | st.sampled_from(DECLARED))
    return Made(
        draw(st.sampled_from([512, 1024, 4096, 65536])), draw(st.sampled_from([0, 0, 4, 32])),
        draw(st.sampled_from(["UTF-8", "UTF-16le", "UTF-16be"])), draw(st.sampled_from([0, 1, 2])),
        declared, draw(_rows(2 + len(declared))), added, draw(_rows(3 + len(declared))),
        draw(st.sampled_from([1, 1, 40, 700])), draw(st.sampled_from([0, 2, 7])),
    )  # fmt: skip


def make(made: Made, path: Path) -> None:
    """Make the database in a file."""
    path.unlink(missing_ok=True)
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.execute(f"PRAGMA page_size = {made.page_bytes}")
        database.execute(f"PRAGMA encoding = '{made.encoding}'")
        database.execute(f"PRAGMA auto_vacuum = {made.auto_vacuum}")
        database.execute("CREATE TABLE before(a)")
        if made.reserved_bytes and made.page_bytes - made.reserved_bytes >= 480:
            database.execute("DROP TABLE before")
            _reserve(database, path, made.reserved_bytes)
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        columns = "".join(f', "v{number}" {declared}' for number, declared in enumerate(made.declared))
        database.execute("BEGIN")
        database.execute(f'CREATE TABLE log_1("Timestamp" TEXT, "ConsistentDataSeries" INT{columns})')
        _insert(database, made.rows, made.copies)
        if made.added is not None:
            database.execute(f'ALTER TABLE log_1 ADD COLUMN "added" {made.added} DEFAULT NULL')
            _insert(database, made.rows_added, 1)
        if made.delete_every:
            database.execute(f"DELETE FROM log_1 WHERE (rowid / 3) % {made.delete_every} = 0")
        database.execute("COMMIT")


def _insert(database: sqlite3.Connection, rows: Sequence[tuple[int, tuple[Value, ...]]], copies: int) -> None:
    for rowid, values in rows:
        marks = ", ".join("?" * (1 + len(values)))
        names = ", ".join(f'"{name}"' for _, name, *_ in database.execute("PRAGMA table_info(log_1)"))
        database.execute(f"INSERT OR REPLACE INTO log_1(rowid, {names}) VALUES ({marks})", (rowid, *values))
        short = [value if not isinstance(value, str | bytes) or len(value) < 400 else None for value in values]
        marks = ", ".join("?" * len(values))
        if rowid < 1 << 62:  # behind the largest there is, SQLite draws ids at random
            database.executemany(f"INSERT INTO log_1({names}) VALUES ({marks})", [short] * (copies - 1))


def _reserve(database: sqlite3.Connection, path: Path, count: int) -> None:
    """Have SQLite leave bytes of each page to others, as extensions ask it to."""
    database.execute("VACUUM")
    raw = bytearray(path.read_bytes())
    raw[20] = count
    (content,) = struct.unpack_from(">H", raw, 105)
    page_bytes = struct.unpack_from(">H", raw, 16)[0]
    page_bytes = 1 << 16 if page_bytes == 1 else page_bytes
    if (content or 1 << 16) != page_bytes:
        return
    struct.pack_into(">H", raw, 105, page_bytes - count)
    path.write_bytes(raw)


def as_sqlite_reads(path: Path, table: str = "log_1") -> list[tuple[object, ...]]:
    """Return the rows of a table with their ids, as SQLite hands them over; texts as ``str``."""
    with closing(sqlite3.connect(path)) as database:
        return [alike(row) for row in database.execute(f"SELECT rowid, * FROM {table}")]


def alike(row: Sequence[object]) -> tuple[object, ...]:
    """Return a row in which values of several types that Python calls equal are not."""
    return tuple(
        (type(value).__name__, struct.pack(">d", value) if isinstance(value, float) else value) for value in row
    )


def as_columns_say(database: LogDatabase, rows: Iterator[AnyRows], columns: int) -> Iterator[tuple[object, ...]]:
    """Yield rows with their ids, as they are read by columns."""
    for some in rows:
        encoding = database.encoding_of(some)
        cells = [some.cells(column) for column in range(columns)]
        assert len({len(one) for one in cells} | {len(some)}) == 1
        for row in range(len(some)):
            values: list[object] = [int(some.rowid[row])]
            for one in cells:
                form = one.form[row]
                if form == Form.INTEGER:
                    values.append(int(one.integers[row]))
                elif form == Form.REAL:
                    (real,) = struct.unpack(">d", int(one.bits[row]).to_bytes(8, "big"))
                    values.append(real)
                elif form in (Form.TEXT, Form.BLOB):
                    raw = some.data[one.start[row] : one.stop[row]].tobytes()
                    values.append(raw.decode(encoding, "replace") if form == Form.TEXT else raw)
                else:
                    values.append(None)
            yield alike(values)


def by_sqlite(path: Path, table: StoredTable, damages: Damages) -> Iterator[AnyRows]:
    """Yield the rows of a table as they are read where pages cannot be."""
    with sqlite_file.opened(str(path), with_texts=True) as database:
        yield from sql_rows(database, table.log.name, table.columns, damages)
