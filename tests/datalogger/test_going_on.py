"""``--append`` to a database that cannot be gone on with: why not, and what to do."""

from __future__ import annotations

import re
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from tests.datalogger.plants import configuration, gvl, plant, rows_of, simulated
from tests.program_here import run_text


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """Return a folder with a capture, and a database of it."""
    simulated(tmp_path, plant())
    (tmp_path / "list1.gvl").write_text(gvl(1, ["dwFirst"]), encoding="utf-8")
    (tmp_path / "c.xml").write_text(configuration(["a/dwFirst"], 'taskContext="list1"'), encoding="utf-8")
    assert logged(tmp_path)[0] == 0
    return tmp_path


def logged(folder: Path, *words: str) -> tuple[int, list[str]]:
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", *words, cwd=folder)
    return done.returncode, done.stderr.splitlines()


def test_times_of_another_form(here: Path) -> None:
    text = configuration(["a/dwFirst"], 'taskContext="list1"', 'tsfmt="Raw"')
    (here / "c.xml").write_text(text, encoding="utf-8")
    code, told = logged(here, "--append")
    assert code == 2
    assert told[0].startswith("nvscope: log.db: the table of these variables has its times as texts there, and ")
    assert told[1:] == ['  write tsfmt="Iso8601" in the configuration, or log to another file']
    assert len(rows_of(here / "log.db")) == 100


def test_a_variable_of_another_type(here: Path) -> None:
    (here / "list1.gvl").write_text(gvl(1, ["dwFirst"]).replace("DWORD", "REAL"), encoding="utf-8")
    code, told = logged(here, "--append")
    assert (code, told[0]) == (2, "nvscope: log.db: 'a/dwFirst' is INT in the table there, and FLOAT in its list")


@pytest.mark.parametrize(
    ("name", "sink", "why"),
    [
        ("a/dwFirst", 'storeChangesOnly="true"', "stores every value"),
        ("b/dwFirst", "", "has no 'b/dwFirst' and has 'a/dwFirst', too"),
    ],
)
def test_a_table_of_its_own_is_told_with_what_differs(here: Path, name: str, sink: str, why: str) -> None:
    (here / "c.xml").write_text(configuration([name], 'taskContext="list1"', sink), encoding="utf-8")
    code, told = logged(here, "--append")
    assert code == 0
    assert re.search(rf"; in a table of its own, log_\w+, beside log_\d+, which {re.escape(why)}\.$", told[0])


def test_a_file_that_is_cut_off(here: Path) -> None:
    """SQLite would take the bytes that are missing for zeros, and go on behind them."""
    whole = (here / "log.db").read_bytes()
    (here / "log.db").write_bytes(whole[:-1])
    code, told = logged(here, "--append")
    assert (code, told[0]) == (2, "nvscope: log.db: the file is cut off in the middle of a page")
    assert (here / "log.db").read_bytes() == whole[:-1]


def test_a_table_of_somebody_else(here: Path) -> None:
    with closing(sqlite3.connect(here / "log.db")) as connection:
        connection.execute("CREATE TABLE messages (ts REAL)")
    code, told = logged(here, "--append")
    assert (code, told[0]) == (2, "nvscope: log.db: the file holds what is no DataLogger's: the table messages")


def test_a_database_that_another_program_holds(here: Path) -> None:
    with closing(sqlite3.connect(here / "log.db", isolation_level=None)) as connection:
        connection.execute("BEGIN EXCLUSIVE")
        code, told = logged(here, "--append")
        connection.execute("ROLLBACK")
    assert (code, told[0]) == (5, "nvscope: log.db: another program holds the database; nothing was written")
    assert told[1].startswith("  close it there, and start again")
    assert len(rows_of(here / "log.db")) == 100
