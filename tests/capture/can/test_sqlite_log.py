"""Databases of strangers: nothing in them is run, nothing beside them changes, and what is not read of them is told."""

from __future__ import annotations

import gzip
import hashlib
import os
import shutil
import sqlite3
import struct
from contextlib import closing
from pathlib import Path

import pytest

from nvscope.capture.can import sqlite_file
from nvscope.capture.can.sqlite_file import MAX_VALUE_BYTES
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.reader import ReadingSizes
from nvscope.errors import UnreadableInput
from tests.capture.can.logs import frames_of

_COLUMNS = "ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, dlc INTEGER, data BLOB"
_ROW = "INSERT INTO messages VALUES (?, ?, 0, 0, 0, ?, ?)"
_ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT"


def database(path: Path, rows: int = 0, columns: str = _COLUMNS) -> Path:
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(f"CREATE TABLE messages ({columns})")
        put(connection, range(rows))
        connection.commit()
    return path


def put(connection: sqlite3.Connection, numbers: range) -> None:
    connection.executemany(_ROW, [(1e9 + n, 0x100 + n % 100, 2, bytes([n & 0xFF, n >> 8])) for n in numbers])


def changed(path: Path, *statements: str) -> Path:
    with closing(sqlite3.connect(path)) as connection:
        for statement in statements:
            connection.execute(statement)
        connection.commit()
    return path


def read(path: Path) -> tuple[list[int], str]:
    """Return the numbers that the messages of ``put`` have in their data, and what is told to be missing."""
    source = CaptureFile(str(path))
    numbers = [int.from_bytes(frame.data, "little") for frame in frames_of(source)]
    truncation = source.infos[0].truncation
    return numbers, truncation.message if truncation else ""


def kept(directory: Path) -> dict[str, tuple[str, int]]:
    """What lies in a directory: names, hashes and times of change."""
    return {
        path.name: (hashlib.sha256(path.read_bytes()).hexdigest(), path.stat().st_mtime_ns)
        for path in directory.iterdir()
    }


@pytest.mark.parametrize(
    "made",
    [
        f"CREATE VIEW messages AS {_ENDLESS} i AS rowid, i AS ts, 1 AS arbitration_id, 0 AS extended, 0 AS remote, "
        "0 AS error, 0 AS dlc, x'' AS data FROM n",
        "CREATE VIEW messages AS SELECT rowid, * FROM other",
        "CREATE VIRTUAL TABLE messages USING fts5(ts, arbitration_id, extended, remote, error, dlc, data)",
    ],
    ids=["endless view", "view of a table", "virtual table"],
)
def test_what_a_definition_makes_up_is_no_table_of_messages(tmp_path: Path, made: str) -> None:
    path = changed(tmp_path / "a.db", f"CREATE TABLE other ({_COLUMNS})", made)
    with pytest.raises(UnreadableInput, match="without a table 'messages'"):
        CaptureFile(str(path))


def _as_if_stored(path: Path) -> None:
    """Make the view of a database look like a table to who asks the schema."""
    changed(path, "PRAGMA writable_schema = ON", "UPDATE sqlite_master SET type = 'table', rootpage = 2")


@pytest.mark.parametrize(
    "column", ["zeroblob(900000000)", "hex(zeroblob(40000000))", "CAST(printf('%90000000d', 1) AS BLOB)"]
)
def test_columns_that_are_computed_are_not(tmp_path: Path, column: str) -> None:
    columns = _COLUMNS.replace("data BLOB", f"data_ BLOB, data BLOB GENERATED ALWAYS AS ({column}) VIRTUAL")
    try:
        path = database(tmp_path / "a.db", 3, columns)
    except sqlite3.OperationalError:
        pytest.skip("SQLite does not make such a column")
    with pytest.raises(UnreadableInput, match="without a table 'messages' as python-can writes it"):
        CaptureFile(str(path))


def test_a_view_that_says_it_is_a_table(tmp_path: Path) -> None:
    made_up = (f"i AS {name.split()[0]}" for name in ("rowid", *_COLUMNS.split(", ")))
    path = changed(tmp_path / "a.db", f"CREATE VIEW messages AS {_ENDLESS} {', '.join(made_up)} FROM n")
    _as_if_stored(path)
    with pytest.raises(UnreadableInput):
        CaptureFile(str(path))


@pytest.mark.parametrize("kind", ["zeroblob({})", "CAST(zeroblob({}) AS TEXT)", "printf('%.*c', {}, 'x')"])
@pytest.mark.parametrize("column", ["data", "ts", "arbitration_id"])
def test_only_rows_with_great_values_are_left_out(tmp_path: Path, column: str, kind: str) -> None:
    path = database(tmp_path / "a.db", 6)
    value = kind.format(MAX_VALUE_BYTES * 3)
    changed(path, f"UPDATE messages SET {column} = {value} WHERE rowid IN (1, 4, 5)")
    numbers, told = read(path)
    assert numbers == [1, 2, 5]
    assert told == f"row 1: a value of more than {MAX_VALUE_BYTES} bytes; 3 faults in all"


def test_great_values_of_other_columns_are_nothing_to_the_messages(tmp_path: Path) -> None:
    path = database(tmp_path / "a.db", 3)
    changed(path, "ALTER TABLE messages ADD note", f"UPDATE messages SET note = zeroblob({MAX_VALUE_BYTES * 3})")
    assert read(path) == ([0, 1, 2], "")


@pytest.mark.parametrize("text", ["'ab'", "CAST(x'ff80' AS TEXT)", "7"])
def test_data_that_are_no_bytes_are_told(tmp_path: Path, text: str) -> None:
    path = changed(database(tmp_path / "a.db", 3), f"UPDATE messages SET data = {text} WHERE rowid = 2")
    assert read(path) == ([0, 2], "row 2: data that are no bytes")


def test_pages_that_lie_in_a_tree_twice_end_the_reading(tmp_path: Path) -> None:
    path = database(tmp_path / "a.db", 2000)
    raw = bytearray(path.read_bytes())
    page_bytes = struct.unpack_from(">H", raw, 16)[0]
    roots = [at for at in range(0, len(raw), page_bytes) if raw[at] == 5]  # interior page of a table
    (root,) = roots
    (cells,) = struct.unpack_from(">H", raw, root + 3)
    first, *others = (root + at for at in struct.unpack_from(f">{cells}H", raw, root + 12))
    for cell in others:
        raw[cell : cell + 4] = raw[first : first + 4]
    path.write_bytes(raw)
    numbers, told = read(path)
    assert 0 < len(numbers) < 2000
    assert numbers == list(range(len(numbers)))
    assert "damaged: row 1 follows" in told


def test_a_schema_without_an_end_is_not_taken_into_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = database(tmp_path / "a.db", 3)
    changed(path, *(f"CREATE TABLE t{number} (a)" for number in range(400)))
    assert read(path)[0] == [0, 1, 2]
    monkeypatch.setattr(sqlite_file, "_MAX_OPENING_STEPS", 1000)
    with pytest.raises(UnreadableInput, match="interrupted"):
        CaptureFile(str(path))


@pytest.mark.parametrize("mode", ["delete", "truncate", "persist", "wal"])
def test_reading_leaves_all_files_as_they_are(tmp_path: Path, mode: str) -> None:
    path = database(tmp_path / "a.db")
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(f"PRAGMA journal_mode = {mode}")
        put(connection, range(5))
        connection.commit()
    before = kept(tmp_path)
    assert read(path) == ([0, 1, 2, 3, 4], "")
    assert kept(tmp_path) == before


def _unfinished(directory: Path, rows: int, mode: str) -> Path:
    """Make a database as a writer that was killed leaves it: with ``rows`` messages, and more of them beside it."""
    work = directory / "work"
    work.mkdir()
    path = database(work / "a.db", rows)
    plant = directory / "plant"
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute(f"PRAGMA journal_mode = {mode}")
        connection.execute("PRAGMA cache_size = 1")
        connection.execute("BEGIN")
        put(connection, range(rows, rows + 3000))
        if mode == "wal":
            connection.execute("COMMIT")
        shutil.copytree(work, plant)
    (plant / "a.db-shm").unlink(missing_ok=True)
    return plant / "a.db"


def test_what_lies_in_a_wal_is_read(tmp_path: Path) -> None:
    path = _unfinished(tmp_path, 5, "wal")
    before = kept(path.parent)
    assert set(before) == {"a.db", "a.db-wal"}
    assert read(path) == (list(range(3005)), "")
    assert kept(path.parent) == before


def test_what_a_writer_did_not_finish_is_taken_back(tmp_path: Path) -> None:
    path = _unfinished(tmp_path, 5, "delete")
    before = kept(path.parent)
    assert set(before) == {"a.db", "a.db-journal"}
    assert read(path) == (list(range(5)), "")
    assert kept(path.parent) == before


def test_a_journal_that_names_a_file_to_delete(tmp_path: Path) -> None:
    path = _unfinished(tmp_path, 5, "delete")
    victim = tmp_path / "victim"
    victim.write_bytes(b"\0")
    journal = path.with_name("a.db-journal")
    name = str(victim).encode()
    tail = struct.pack(">I", 0xFFFF_FFFF) + name + struct.pack(">II", len(name), sum(name))
    journal.write_bytes(journal.read_bytes() + tail + bytes.fromhex("d9d505f920a163d7"))
    before = kept(path.parent)
    told = read(path)[1]
    assert told.startswith("a.db-journal is not read: it belongs to a change of several databases")
    assert victim.exists()
    assert kept(path.parent) == before


def test_a_wal_that_is_too_large_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = _unfinished(tmp_path, 5, "wal")
    monkeypatch.setattr(sqlite_file, "MAX_SPOOLED_BYTES", 1 << 12)
    numbers, told = read(path)
    assert numbers == list(range(5))
    assert told.startswith("a.db-wal is not read: ")


@pytest.mark.skipif(os.getuid() == 0, reason="root may write everywhere")
def test_a_directory_in_which_nothing_may_be_written(tmp_path: Path) -> None:
    path = _unfinished(tmp_path, 5, "wal")
    path.parent.chmod(0o555)
    try:
        assert read(path) == (list(range(3005)), "")
    finally:
        path.parent.chmod(0o755)


def test_a_copy_of_what_is_compressed_is_read_like_the_file(tmp_path: Path) -> None:
    path = changed(database(tmp_path / "a.db", 5), "PRAGMA journal_mode = wal")
    packed = tmp_path / "b.db.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    assert read(packed) == read(path) == ([0, 1, 2, 3, 4], "")


def test_a_database_that_changes_meanwhile_is_told(tmp_path: Path) -> None:
    path = database(tmp_path / "a.db", 10_000)
    source = CaptureFile(str(path), sizes=ReadingSizes(batch_packets=100))
    batches = iter(source)
    next(batches)
    with closing(sqlite3.connect(path)) as connection:
        # Who reads takes no lock for which a recorder would have to wait.
        put(connection, range(10))
        connection.commit()
    for _ in batches:
        pass
    truncation = source.infos[0].truncation
    assert truncation is not None
    assert truncation.message.startswith("changed while it was read")


@pytest.mark.parametrize("packed", [False, True])
def test_of_a_database_that_is_cut_short_the_rows_in_front_are_read(tmp_path: Path, packed: bool) -> None:
    data = database(tmp_path / "whole.db", rows=2000).read_bytes()
    (page_bytes,) = struct.unpack_from(">H", data, 16)
    before = 0
    for size in [*range(2 * page_bytes, len(data), 3 * page_bytes // 2), len(data) - 1]:
        cut = tmp_path / "cut.db"
        cut.write_bytes(gzip.compress(data[:size]) if packed else data[:size])
        kept_before = kept(tmp_path)
        numbers, fault = read(cut)
        assert numbers == list(range(len(numbers)))
        assert before <= len(numbers) < 2000
        before = len(numbers)
        after = f"after row {before}" if before else "of its rows"
        assert fault == f"cut short: {size} of {len(data)} bytes; nothing {after} can be read"
        assert kept(tmp_path) == kept_before
    assert before > 1800


def test_pages_that_no_row_lies_in_are_missed_too(tmp_path: Path) -> None:
    path = database(tmp_path / "log.db", rows=2000)
    changed(path, "DELETE FROM messages WHERE rowid > 1000")
    data = path.read_bytes()
    path.write_bytes(data[:-1])
    assert read(path) == (list(range(1000)), f"cut short: {len(data) - 1} of {len(data)} bytes")


@pytest.mark.parametrize("size", [40, 100, 1000, 4096, 5000])
def test_a_database_that_is_cut_before_its_tables_is_no_log(tmp_path: Path, size: int) -> None:
    path = database(tmp_path / "log.db", rows=2000)
    data = path.read_bytes()
    path.write_bytes(data[:size])
    with pytest.raises(UnreadableInput, match=f"an SQLite file that is cut short: {size} of {len(data)} bytes"):
        read(path)
