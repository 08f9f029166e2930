"""``nvscope datalog`` where one was killed in the middle of a block: what that left is no part of a new database."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_datalog import here, logged
from tests.datalogger.plants import configuration, rows_of

__all__ = ["here"]

_KILLED = """
import os, sqlite3, sys
database = sqlite3.connect(sys.argv[1], isolation_level=None)
database.execute(f"PRAGMA journal_mode = {sys.argv[2]}")
database.execute("PRAGMA cache_size = 1")
((table,),) = database.execute("SELECT name FROM sqlite_master")
database.execute("BEGIN IMMEDIATE")
for _ in range(7):
    database.execute(f"INSERT INTO {table} SELECT * FROM {table}")
if sys.argv[2] == "WAL":
    database.execute("COMMIT")
os._exit(9)
"""


def kill_a_writer(path: Path, mode: str) -> None:
    """Leave a database as one does that is killed while it writes."""
    subprocess.run([sys.executable, "-c", _KILLED, path, mode], check=False)
    assert path.with_name(path.name + ("-wal" if mode == "WAL" else "-journal")).stat().st_size > 4096


def is_sound(path: Path) -> bool:
    connection = sqlite3.connect(path)
    try:
        return connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    finally:
        connection.close()


@pytest.mark.parametrize("mode", ["DELETE", "WAL"])
def test_what_force_takes_the_place_of_leaves_nothing_behind(here: Path, mode: str) -> None:
    assert logged(here).returncode == 0
    kill_a_writer(here / "log.db", mode)
    assert logged(here, "--force", "--to-time", "2s").returncode == 0
    assert is_sound(here / "log.db")
    assert len(rows_of(here / "log.db")) == 41
    assert [one.name for one in here.glob("log.db*")] == ["log.db"]


@pytest.mark.parametrize("mode", ["DELETE", "WAL"])
def test_what_lay_beside_a_database_that_is_gone_is_no_part_of_the_next(here: Path, mode: str) -> None:
    assert logged(here).returncode == 0
    kill_a_writer(here / "log.db", mode)
    (here / "log.db").unlink()
    for option in ("-q", "--append"):
        assert logged(here, option, "--to-time", "2s").returncode == 0
        assert is_sound(here / "log.db")
    assert len(rows_of(here / "log.db")) == 82


@pytest.mark.parametrize("mode", ["DELETE", "WAL"])
def test_what_lay_beside_a_closed_file_that_is_gone_is_no_part_of_the_next(here: Path, mode: str) -> None:
    sink = 'rollover="true" maxFileSize="1" writeInterval="60"'
    (here / "c.xml").write_text(configuration(["a/dwFirst"], 'taskContext="list1"', sink), encoding="utf-8")
    assert logged(here, "-w", "log.db.0").returncode == 0
    (here / "log.db.0.0").rename(here / "log.db.0")
    kill_a_writer(here / "log.db.0", mode)
    for name in ("log.db.0", "log.db.0.1"):
        (here / name).unlink()
    assert logged(here).returncode == 0
    assert is_sound(here / "log.db.0")
    assert [len(rows_of(here / name)) for name in ("log.db.0", "log.db.1")] == [60, 40]


@pytest.mark.parametrize("mode", ["DELETE", "WAL"])
def test_what_stays_has_all_that_belongs_to_it(here: Path, mode: str) -> None:
    assert logged(here).returncode == 0
    kill_a_writer(here / "log.db", mode)
    before = {one.name: one.read_bytes() for one in here.glob("log.db*")}
    assert len(before) > 1
    done = logged(here, "--force", "--from-time", "4.97s")
    assert (done.returncode, "log.db: what was there stays" in done.stderr) == (0, True)
    assert {one.name: one.read_bytes() for one in here.glob("log.db*")} == before


@pytest.mark.parametrize("mode", ["DELETE", "WAL"])
def test_a_run_goes_on_with_what_was_finished(here: Path, mode: str) -> None:
    assert logged(here).returncode == 0
    kill_a_writer(here / "log.db", mode)
    assert logged(here, "--append").returncode == 0
    assert is_sound(here / "log.db")
    assert len(rows_of(here / "log.db")) == (100 if mode == "DELETE" else 100 << 7) + 100
    assert not os.path.exists(here / "log.db-journal")
