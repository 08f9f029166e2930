"""A full file gives up its name when another one is ready: faults, and programs that have it open, lose nothing."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from nvscope.capture.datalogger.names import to_close
from nvscope.datalogger import begun_files, plan
from nvscope.datalogger.database import Database
from nvscope.errors import CaptureError
from tests.datalogger import recording
from tests.datalogger.recording import opened, record_in_batches, table_in
from tests.datalogger.test_killed import BLOCK, errors, series, values
from tests.datalogger.test_killed import plant as plant_of

ROWS = 4 * BLOCK


def recorded(folder: Path, *, append: bool = False, first: int = 0, max_files: int = -1) -> None:
    logged = plant_of(first, first + ROWS, max_files)
    record_in_batches(folder, logged.write(folder), logged, 1000, append=append)


def refusing(do: Callable[..., Any], number: int) -> Callable[..., Any]:
    """Return what does as it should, but for one time, from 0."""
    times = iter(range(1_000_000))

    def refuse(*about: Any, **options: Any) -> Any:
        if next(times) == number:
            raise PermissionError(13, "Permission denied", str(about[0]))
        return do(*about, **options)

    return refuse


@pytest.mark.parametrize("number", range(1, 5))
def test_a_name_that_cannot_be_given_leaves_all_as_it_was(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    # The first name is that of the first file; then there are two for each that is full.
    with monkeypatch.context() as context:
        context.setattr(os, "rename", refusing(os.rename, number))
        with pytest.raises(CaptureError, match="a full file cannot be closed: Permission denied"):
            recorded(tmp_path)
    found = values(series(tmp_path))
    assert found == list(range(len(found)))
    assert len(found) >= BLOCK
    assert (tmp_path / "log.db").exists()
    assert not list(tmp_path.glob("*.begun*"))
    recorded(tmp_path, append=True, first=1000)
    assert values(series(tmp_path)) == [*found, *range(1000, 1000 + ROWS)]
    assert errors(tmp_path) == []


def test_a_file_that_cannot_be_begun_leaves_all_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter(range(100))

    def full(connection: sqlite3.Connection) -> None:
        if next(times) >= 2:
            raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as context:
        context.setattr(begun_files, "begin_file", full)
        with pytest.raises(CaptureError, match="rows were written before"):
            recorded(tmp_path)
    found = values(series(tmp_path))
    assert found == list(range(len(found)))
    assert len(found) >= 2 * BLOCK
    assert [path.name for path in series(tmp_path)] == ["log.db.0", "log.db"]
    assert not list(tmp_path.glob("*.begun*"))


def test_what_was_begun_by_somebody_else_stays(tmp_path: Path) -> None:
    mine = tmp_path / "log.db.begun"
    with sqlite3.connect(mine) as connection:
        connection.execute("CREATE TABLE notes (text)")
        connection.execute("INSERT INTO notes VALUES ('keep')")
    connection.close()
    before = mine.read_bytes()
    (tmp_path / "log.db.begun-1").write_text("mine, too")
    recorded(tmp_path)
    assert mine.read_bytes() == before
    assert (tmp_path / "log.db.begun-1").read_text() == "mine, too"
    assert sorted(path.name for path in tmp_path.glob("*.begun*")) == ["log.db.begun", "log.db.begun-1"]
    assert values(series(tmp_path)) == list(range(ROWS))


@pytest.mark.parametrize(
    "statements",
    [
        ["CREATE TABLE notes (text)"],
        ['CREATE TABLE log_1 ("Timestamp" TEXT, "ConsistentDataSeries" INT, "a" INT)', "CREATE TABLE notes (text)"],
        ['CREATE TABLE log_1 ("Timestamp" TEXT, "ConsistentDataSeries" INT, "a" INT)', "PRAGMA user_version = 77"],
        ["CREATE VIEW one AS SELECT 1"],
    ],
)
def test_a_database_of_somebody_else_stays_though_it_has_no_row(tmp_path: Path, statements: list[str]) -> None:
    mine = tmp_path / "log.db.begun"
    with closing(sqlite3.connect(mine, isolation_level=None)) as connection:
        for statement in statements:
            connection.execute(statement)
    before = mine.read_bytes()
    recorded(tmp_path)
    assert mine.read_bytes() == before
    assert len(series(tmp_path)) == ROWS // BLOCK + 1


def test_what_was_begun_and_has_no_row_is_taken_away(tmp_path: Path) -> None:
    (tmp_path / "log.db.begun").write_bytes(b"")
    recorded(tmp_path)
    assert not list(tmp_path.glob("*.begun*"))
    assert len(series(tmp_path)) == ROWS // BLOCK + 1


@pytest.mark.parametrize("mode", ["DELETE", "WAL"])
def test_a_program_that_reads_it_keeps_what_it_reads(
    mode: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    """In front of each rollover, somebody begins to read the file, and goes on behind it."""
    recorded(tmp_path)
    paths = [path.name for path in series(tmp_path)]
    before = sqlite3.connect(tmp_path / "log.db", isolation_level=None)
    before.execute(f"PRAGMA journal_mode = {mode}")
    before.execute("BEGIN")
    assert before.execute(f"SELECT count(*) FROM {table_in(before)[0]}").fetchone() == (0,)
    readers: list[sqlite3.Connection] = []
    roll_over = Database._roll_over

    def read_and_roll_over(self: Database) -> None:
        reader = opened(Path(self.path))
        reader.execute("BEGIN")
        reader.execute(f"SELECT count(*) FROM {table_in(reader)[0]}").fetchone()
        readers.append(reader)
        roll_over(self)

    monkeypatch.setattr(Database, "_roll_over", read_and_roll_over)
    if mode == "DELETE":
        before.close()
    logged = plant_of(1000, 1000 + ROWS, -1)
    monkeypatch.setattr(recording, "_logged", _durable(recording._logged))
    record_in_batches(tmp_path, logged.write(tmp_path), logged, 1000, append=True)
    for reader in readers:
        reader.close()
    before.close()
    assert [path.name for path in series(tmp_path)][: len(paths) - 1] == paths[:-1]
    assert values(series(tmp_path)) == [*range(ROWS), *range(1000, 1000 + ROWS)]
    assert all(len(values([path])) >= BLOCK for path in series(tmp_path)[:-1])
    assert errors(tmp_path) == []


def _durable(logged: Callable[..., Any]) -> Callable[..., Any]:
    """Return what records as it does live: others may read meanwhile."""

    def record(*about: Any, **options: Any) -> Any:
        data_log = plan.data_log
        plan.data_log = lambda *own, durable, **rest: data_log(*own, durable=True, **rest)
        try:
            return logged(*about, **options)
        finally:
            plan.data_log = data_log

    return record


def test_the_folder_is_listed_once(tmp_path: Path) -> None:
    for name in ("x.db", "x.db.0", "x.db.7"):
        (tmp_path / name).touch()
    path = str(tmp_path / "x.db")
    assert to_close(path) == ([(0, f"{path}.0"), (7, f"{path}.7")], f"{path}.8")
