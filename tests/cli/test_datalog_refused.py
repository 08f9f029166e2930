"""``nvscope datalog`` where it would not begin: what it says, what ``--dry-run`` says of it before, and what stays."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from tests.cli.test_datalog import here, logged

__all__ = ["here"]


def made(path: Path, script: str) -> None:
    with closing(sqlite3.connect(path)) as database:
        database.executescript(script)


def others(path: Path) -> None:
    made(path, "CREATE TABLE invoices (number INTEGER)")


def with_trigger(path: Path) -> None:
    assert logged(path.parent, "-w", path.name).returncode == 0
    with closing(sqlite3.connect(path)) as database:
        ((table,),) = database.execute("SELECT name FROM sqlite_master")
        database.execute(f"CREATE TRIGGER emptied AFTER INSERT ON {table} BEGIN DELETE FROM {table}; END")
        database.commit()


FILES = {
    "nothing": (lambda path: None, None, None),
    "no byte": (lambda path: path.touch(), "the file exists", None),
    "own": (lambda path: logged(path.parent, "-w", path.name), "the file exists", None),
    "others": (others, "the file exists", "the table invoices"),
    "trigger": (with_trigger, "the file exists", "the trigger emptied"),
    "text": (lambda path: path.write_text("hello" * 100), "the file exists", "no SQLite database"),
    "folder": (lambda path: path.mkdir(), "is a directory", "is a directory"),
    "closed": (lambda path: others(path.with_name("x.db.0")), "the file exists", "no whole database of a DataLogger"),
}  # fmt: skip


@pytest.mark.parametrize("append", [False, True], ids=["new", "append"])
@pytest.mark.parametrize("kind", FILES)
def test_a_dry_run_says_what_a_run_would_be_refused_for(here: Path, kind: str, append: bool) -> None:
    make, *reasons = FILES[kind]
    make(here / "x.db")
    before = {path.name: path.read_bytes() for path in here.glob("x.db*") if path.is_file()}
    words = ["-w", "x.db", *["--append"] * append]
    dry = logged(here, *words, "--dry-run")
    assert dry.returncode == 0
    assert {path.name: path.read_bytes() for path in here.glob("x.db*") if path.is_file()} == before
    done = logged(here, *words)
    told = reasons[append]
    assert (done.returncode in {2, 5}, told is not None) == ("It would be refused as it is: " in dry.stdout,) * 2
    if told is not None:
        assert told in dry.stdout
        assert told in done.stderr
        assert {path.name: path.read_bytes() for path in here.glob("x.db*") if path.is_file()} == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-w", ""], "-w is empty"),
        (["--folder", ""], "--folder is empty"),
        (["-w", "-"], "a database is a file, and cannot be written to stdout"),
    ],
)
def test_a_name_that_is_none_is_refused(here: Path, words: list[str], said: str) -> None:
    before = sorted(here.iterdir())
    for option in ("-q", "--dry-run"):
        done = logged(here, *words, option)
        assert (done.returncode, said in done.stderr) == (2, True)
    assert sorted(here.iterdir()) == before


def test_rows_of_a_database_with_an_index_go_on(here: Path) -> None:
    assert logged(here).returncode == 0
    with closing(sqlite3.connect(here / "log.db")) as database:
        ((table,),) = database.execute("SELECT name FROM sqlite_master")
        database.execute(f"CREATE INDEX by_time ON {table} (Timestamp)")
        database.commit()
    assert logged(here, "--append").returncode == 0
    with closing(sqlite3.connect(here / "log.db")) as database:
        assert database.execute(f"SELECT count(*) FROM {table}").fetchone() == (200,)
        assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def test_a_dry_run_puts_nothing_beside_a_database_in_wal_mode(here: Path) -> None:
    assert logged(here, "-w", "x.db").returncode == 0
    with closing(sqlite3.connect(here / "x.db")) as database:
        database.execute("PRAGMA journal_mode = WAL")
    before = sorted(path.name for path in here.iterdir())
    dry = logged(here, "-w", "x.db", "--append", "--dry-run")
    assert dry.returncode == 0
    assert "It would be refused" not in dry.stdout
    assert sorted(path.name for path in here.iterdir()) == before


def test_a_database_is_not_called_like_what_keeps_loggers_apart(here: Path) -> None:
    done = logged(here, "-w", "x.db.lock")
    assert done.returncode == 2
    assert "x.db.lock: files of such names keep loggers apart" in done.stderr
    assert not (here / "x.db.lock").exists()
