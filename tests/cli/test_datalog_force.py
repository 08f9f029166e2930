"""``nvscope datalog --force`` and ``--append``: what becomes of files that are there."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from tests.cli.test_datalog import datalog, here, logged
from tests.datalogger.plants import configuration, gvl, rows_of

__all__ = ["here"]


def invoices(path: Path) -> bytes:
    """Make somebody's database, and return what it holds."""
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE invoices (number INTEGER)")
        database.commit()
    return path.read_bytes()


def test_force_takes_the_place_of_a_series(here: Path) -> None:
    assert logged(here).returncode == 0
    shutil.copy(here / "log.db", here / "log.db.3")
    assert logged(here, "--force").returncode == 0
    assert sorted(one.name for one in here.glob("log.db*")) == ["log.db"]
    assert len(rows_of(here / "log.db")) == 100


@pytest.mark.parametrize("option", ["--force", "--append"])
@pytest.mark.parametrize("foreign", ["table", "empty"])
def test_what_is_no_closed_file_is_nobodys_to_remove(here: Path, option: str, foreign: str) -> None:
    assert logged(here).returncode == 0
    path = here / "log.db.2024"
    before = invoices(path) if foreign == "table" else b"SQLite format 3\0"
    path.write_bytes(before)
    done = logged(here, option)
    assert done.returncode == 2
    assert (
        "log.db.2024: it has the name of a closed file of log.db, and is no whole database of a DataLogger"
        in done.stderr
    )
    assert path.read_bytes() == before
    assert len(rows_of(here / "log.db")) == 100


def test_what_was_there_stays_where_no_row_comes(here: Path) -> None:
    assert logged(here).returncode == 0
    shutil.copy(here / "log.db", here / "log.db.0")
    before = (here / "log.db").read_bytes()
    (here / "list3.gvl").write_text(gvl(3, ["dwThird"]), encoding="utf-8")
    (here / "other.xml").write_text(configuration(["a/dwThird"], 'taskContext="list3"'), encoding="utf-8")
    done = datalog(here, "plant.pcap", "--config", "other.xml", "--gvl", ".", "--force")
    assert done.returncode == 0
    assert "log.db: what was there stays: no row came to take its place" in done.stderr
    assert {one.name: one.read_bytes() for one in here.glob("log.db*")} == {"log.db": before, "log.db.0": before}


def test_what_was_there_stays_where_none_can_be_made(here: Path) -> None:
    (here / "log.db").symlink_to(here / "nowhere" / "log.db")
    done = logged(here, "--force")
    assert (here / "log.db").exists() or (here / "log.db").is_symlink()
    assert done.returncode in (0, 4)
    assert not list(here.glob("*.replaced*"))
