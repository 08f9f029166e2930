"""Rows read by pages, and rows that SQLite hands over, are the same; of damaged files no other ones."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nvscope.capture.datalogger.damage import Damages
from nvscope.capture.datalogger.database import opened
from nvscope.errors import UnreadableInput
from tests.capture.datalogger.drawn import Made, alike, as_columns_say, as_sqlite_reads, by_sqlite, databases, make
from tests.test_captures_index import CAPTURES

GENUINE = CAPTURES / "datalogger" / "genuine-5min.db"

_shared = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)


def read(path: Path, table: int = 0) -> tuple[list[tuple[object, ...]], Damages]:
    """Return the rows of a table and what of it cannot be read."""
    damages = Damages()
    with opened(str(path)) as database:
        one = database.tables[table]
        return list(as_columns_say(database, database.rows(one, damages), one.log.columns)), damages


def test_the_database_of_a_controller_is_read_as_sqlite_reads_it() -> None:
    rows, damages = read(GENUINE)
    assert rows == as_sqlite_reads(GENUINE, "log_changes_575121309")
    assert len(rows) == 1080
    assert not len(damages)


@_shared
@given(databases())
def test_pages_and_sqlite_tell_the_same_rows(tmp_path: Path, made: Made) -> None:
    path = tmp_path / "a.db"
    make(made, path)
    expected = as_sqlite_reads(path)
    rows, damages = read(path)
    assert rows == expected
    assert not len(damages), list(map(str, damages))
    with opened(str(path)) as database:
        (table,) = database.tables
        assert table.by_pages
        asked = Damages()
        # UTF-8 whatever the file has, as SQLite hands texts over.
        handed = [
            row
            for some in by_sqlite(path, table, asked)
            for row in as_columns_say(database, iter([some]), table.log.columns)
        ]
    assert handed == expected
    assert not len(asked)


def filled(path: Path, rows: int, page_bytes: int = 1024, columns: str = "a INT, b TEXT") -> Path:
    """Make a database of which row n has n, and a text that takes a page now and then."""
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.execute(f"PRAGMA page_size = {page_bytes}")
        database.execute(f"CREATE TABLE log_1(Timestamp TEXT, ConsistentDataSeries INT, {columns})")
        put(database, range(1, rows + 1))
    return path


def put(database: sqlite3.Connection, numbers: range) -> None:
    with database:
        database.execute("BEGIN")
        database.executemany(
            "INSERT INTO log_1(Timestamp, ConsistentDataSeries, a, b) VALUES ('2020-04-13T14:05:58.674675', 1, ?, ?)",
            [(n, "x" * (3000 if n % 50 == 0 else n % 7)) for n in numbers],
        )


def numbers(rows: list[tuple[object, ...]]) -> list[object]:
    return [row[3] for row in rows]


def test_records_of_any_length_are_put_together(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "a.db")) as database:
        database.execute("PRAGMA page_size = 512")
        database.execute("CREATE TABLE log_1(Timestamp TEXT, ConsistentDataSeries INT, a TEXT)")
        database.executemany("INSERT INTO log_1(a) VALUES (?)", [("x" * size,) for size in range(2200)])
        database.commit()
    rows, damages = read(tmp_path / "a.db")
    assert rows == as_sqlite_reads(tmp_path / "a.db")
    assert not len(damages)


@pytest.mark.parametrize(
    ("definition", "by_pages"),
    [
        ("CREATE TABLE log_1(Timestamp TEXT, ConsistentDataSeries INT, a INT)", True),
        ("CREATE TABLE log_1(Timestamp TEXT PRIMARY KEY, ConsistentDataSeries INT, a INT) WITHOUT ROWID", False),
        ("CREATE TABLE log_1(Timestamp TEXT, ConsistentDataSeries INT, a INTEGER PRIMARY KEY)", False),
        ("CREATE TABLE log_1(Timestamp TEXT, ConsistentDataSeries INT, a INT, rowid INT)", True),
        ("CREATE TABLE log_1(Timestamp TEXT, ConsistentDataSeries INT, a INT, b INT DEFAULT 7)", False),
    ],
)
def test_what_only_sqlite_can_read_it_reads(tmp_path: Path, definition: str, by_pages: bool) -> None:
    with closing(sqlite3.connect(tmp_path / "a.db")) as database:
        database.execute(definition)
        for number in range(5000):
            values = (f"2020-04-13T14:05:58.{number:06}", 1, 5000 - number)
            database.execute("INSERT INTO log_1(Timestamp, ConsistentDataSeries, a) VALUES (?, ?, ?)", values)
        database.commit()
        expected = sorted(alike(row) for row in database.execute("SELECT * FROM log_1"))
    with opened(str(tmp_path / "a.db")) as database:
        assert database.tables[0].by_pages is by_pages
    rows, damages = read(tmp_path / "a.db")
    assert sorted(row[1:] for row in rows) == expected
    assert not len(damages)


@pytest.mark.parametrize("mode", ["wal", "delete"])
def test_what_a_writer_left_beside_a_database_is_taken_in_and_stays(tmp_path: Path, mode: str) -> None:
    path = filled(tmp_path / "a.db", 500)
    live = tmp_path / "live.db"
    live.write_bytes(path.read_bytes())
    database = sqlite3.connect(live, isolation_level=None)
    database.execute(f"PRAGMA journal_mode = {mode}")
    database.execute("PRAGMA cache_size = 5")
    if mode == "wal":
        put(database, range(501, 901))
    else:
        database.execute("BEGIN")
        database.execute("UPDATE log_1 SET a = -a")
    # As a writer that was killed leaves it.
    found = tmp_path / "found"
    found.mkdir()
    for one in tmp_path.glob("live.db*"):
        if not one.name.endswith("-shm"):
            (found / one.name).write_bytes(one.read_bytes())
    database.close()
    before = {one.name: (one.read_bytes(), one.stat().st_mtime_ns) for one in found.iterdir()}
    assert len(before) == 2
    rows, damages = read(found / "live.db")
    assert numbers(rows) == [("int", n) for n in range(1, 901 if mode == "wal" else 501)]
    assert not len(damages)
    with opened(str(found / "live.db")) as log:
        (note,) = log.notes
    assert ("and was taken in: the file alone lacks" in note) is (mode == "wal")
    assert ("what its writer had not finished was undone" in note) is (mode == "delete")
    assert {one.name: (one.read_bytes(), one.stat().st_mtime_ns) for one in found.iterdir()} == before


@pytest.mark.parametrize(
    ("size", "doubt"),
    [
        (100, "it does not begin as one"), (32 + 1048 * 3 - 1, "it ends in the middle of a page"),
        (40, "it ends in the middle of a page"), (32 + 1048, ""),
    ],
)  # fmt: skip
def test_a_wal_of_which_nothing_is_taken_in_is_told_as_that(tmp_path: Path, size: int, doubt: str) -> None:
    path = filled(tmp_path / "a.db", 500)
    live = tmp_path / "live.db"
    live.write_bytes(path.read_bytes())
    with closing(sqlite3.connect(live, isolation_level=None)) as database:
        database.execute("PRAGMA journal_mode = wal")
        put(database, range(501, 901))
        wal = (tmp_path / "live.db-wal").read_bytes()
    path.with_name("a.db-wal").write_bytes(b"\x7f" * size if "begin" in doubt else wal[:size])
    rows, damages = read(path)
    assert numbers(rows) == [("int", n) for n in range(1, 501)]
    assert not len(damages)
    with opened(str(path)) as log:
        assert "taken in, " not in "".join(log.notes)
        if doubt:
            assert log.notes == ()
            assert log.doubt.startswith(f"a.db-wal lies beside it and is damaged ({doubt}): nothing of it can be taken")
        else:
            assert log.notes == ("a.db-wal lies beside it, and no finished change is in it to be taken in",)
            assert log.doubt == ""


def test_a_journal_that_has_nothing_to_undo_is_told_as_that(tmp_path: Path) -> None:
    path = filled(tmp_path / "a.db", 500)
    path.with_name("a.db-journal").write_bytes(bytes.fromhex("d9d505f920a163d7") + bytes(600))
    with opened(str(path)) as log:
        assert log.notes == ("a.db-journal lies beside it, and there was nothing to undo",)


def test_rows_of_a_file_that_is_cut_are_those_of_the_pages_that_are_left(tmp_path: Path) -> None:
    path = filled(tmp_path / "a.db", 3000)
    whole = as_sqlite_reads(path)
    raw = path.read_bytes()
    for pages in (3, 4, 10, 30, len(raw) // 1024 - 1):
        path.write_bytes(raw[: pages * 1024 + 100])
        with opened(str(path)) as database:
            missing = len(raw) // 1024 - pages
            are = "is" if missing == 1 else "are"
            assert f"cut short: {missing} of its {len(raw) // 1024} pages {are} missing at its end" in database.notes
        rows, damages = read(path)
        assert len(rows) < len(whole)
        assert set(rows) <= set(whole)
        assert len(damages)


def test_a_tree_that_leads_back_into_itself_ends(tmp_path: Path) -> None:
    path = filled(tmp_path / "a.db", 3000, 512)
    raw = bytearray(path.read_bytes())
    interior = [at for at in range(512, len(raw), 512) if raw[at] == 5]
    assert len(interior) > 2
    for at in interior:
        cell = at + int.from_bytes(raw[at + 12 : at + 14], "big")
        raw[cell : cell + 4] = (interior[0] // 512 + 1).to_bytes(4, "big")
    path.write_bytes(raw)
    rows, damages = read(path)
    assert len({row[0] for row in rows}) == len(rows) < 3000
    assert "is referred to twice" in "".join(map(str, damages))


def test_rows_of_which_a_part_is_missing_are_named(tmp_path: Path) -> None:
    path = filled(tmp_path / "a.db", 200)
    raw = bytearray(path.read_bytes())
    # Row 100 goes on in a page that begins with the number of the next one, and is full of x.
    parts = [at for at in range(0, len(raw), 1024) if raw[at + 4 : at + 1024] == b"x" * 1020 and any(raw[at : at + 4])]
    raw[parts[1] : parts[1] + 4] = bytes(4)
    path.write_bytes(raw)
    rows, damages = read(path)
    (damage,) = damages
    assert [n for n in range(1, 201) if ("int", n) not in {row[0] for row in rows}] == list(damage.rows)
    assert len(damage.rows) == 1
    assert "has rows of which a part is missing: row" in str(damage)


@_shared
@given(st.data())
def test_damaged_bytes_raise_nothing_and_rows_keep_their_order(tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / "a.db"
    if not path.exists():
        filled(path, 800, 512)
    raw = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 6))):
        # Heads of pages and of cells are where damage goes furthest.
        page = data.draw(st.integers(0, len(raw) // 512 - 1))
        at = page * 512 + data.draw(st.one_of(st.integers(0, 20), st.integers(0, 511)))
        some = data.draw(st.binary(min_size=1, max_size=4) | st.sampled_from([bytes(40), b"\xff" * 40]))
        raw[at : at + len(some)] = some
    broken = tmp_path / "broken.db"
    broken.write_bytes(raw[: len(raw) if data.draw(st.booleans()) else data.draw(st.integers(0, len(raw)))])
    try:
        rows, damages = read(broken)
    except UnreadableInput:
        return
    ids = [row[0][1] for row in rows]  # type: ignore[index]
    assert ids == sorted(set(ids))
    assert len(rows) <= 800 or len(damages)


@_shared
@given(st.integers(0, 1 << 20), st.sampled_from([b"\xff" * 10, b"\xff", b"\x7f", b"\0\0", bytes(40)]))
def test_no_row_is_lost_that_was_read(tmp_path: Path, at: int, some: bytes) -> None:
    path = tmp_path / "a.db"
    if not path.exists():
        filled(path, 800, 512)
    raw = bytearray(path.read_bytes())
    at %= len(raw)
    raw[at : at + len(some)] = some
    (tmp_path / "broken.db").write_bytes(raw)
    try:
        rows, damages = read(tmp_path / "broken.db")
    except UnreadableInput:
        return
    ids = {row[0][1] for row in rows}  # type: ignore[index]
    for damage in damages:
        if damage.row_count:
            assert ids.isdisjoint(damage.rows)
        elif not damage.partly:
            assert not [one for one in ids if (damage.after or 0) < one <= (damage.until or 1 << 63)]  # type: ignore[operator]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "empty"),
        (b"Timestamp;a\n" * 50, "not an SQLite database"),
        (b"SQLite format 3\0" + b"\xff" * 200, "damaged: its header says"),
    ],
)
def test_what_is_no_database_is_told(tmp_path: Path, content: bytes, told: str) -> None:
    (tmp_path / "a.db").write_bytes(content)
    with pytest.raises(UnreadableInput, match=told), opened(str(tmp_path / "a.db")):
        pass


def test_a_database_of_something_else_is_told(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "a.db")) as database:
        database.execute("VACUUM")
    with pytest.raises(UnreadableInput, match="without tables"), opened(str(tmp_path / "a.db")):
        pass
    with closing(sqlite3.connect(tmp_path / "a.db")) as database:
        database.execute("CREATE TABLE messages(ts, a)")
        database.execute("CREATE VIEW log_1 AS SELECT ts AS Timestamp, a AS ConsistentDataSeries, a FROM messages")
    with pytest.raises(UnreadableInput, match="without a table of a DataLogger"), opened(str(tmp_path / "a.db")):
        pass


@pytest.mark.parametrize(
    "definition",
    [
        "CREATE TABLE t AS SELECT 1 AS Timestamp, 1 AS ConsistentDataSeries",
        "CREATE TABLE t(Timestamp, ConsistentDataSeries, a DEFAULT (randomblob(9)), b AS (zeroblob(1000000000)))",
        "CREATE TABLE t(Timestamp, ConsistentDataSeries); DROP TABLE t",
        "ATTACH 'other.db' AS other",
        "CREATE VIRTUAL TABLE t USING fts5(Timestamp, ConsistentDataSeries)",
        "SELECT 1",
        "",
    ],
)
def test_definitions_make_a_table_or_nothing(tmp_path: Path, definition: str) -> None:
    path = filled(tmp_path / "a.db", 5)
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA writable_schema = ON")
        database.execute("UPDATE sqlite_master SET sql = ?", (definition,))
        database.commit()
    before = sorted(tmp_path.iterdir())
    with pytest.raises(UnreadableInput), opened(str(path)):
        pass
    assert sorted(tmp_path.iterdir()) == before
