"""Databases whose header has a wrong byte: what SQLite refuses is never called good."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from tests.laws import some
from tests.program_here import run_text
from tests.test_captures_index import CAPTURES

GENUINE = (CAPTURES / "datalogger" / "genuine-5min.db").read_bytes()
ROWS = 1080


def spoiled(folder: Path, place: int, value: int) -> Path:
    path = folder / "x.db"
    path.write_bytes(GENUINE[:place] + bytes([value]) + GENUINE[place + 1 :])
    return path


def is_read_by_sqlite(path: Path) -> bool:
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
        try:
            ((table,),) = database.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
            return bool(database.execute(f"SELECT count(*) FROM {table}").fetchone() == (ROWS,))
        except (sqlite3.Error, ValueError):
            return False


@pytest.mark.parametrize("place", [16, 19, 21, 22, 23, 47, 59, *some(range(24, 100))])
def test_what_sqlite_refuses_is_not_trusted(tmp_path: Path, place: int) -> None:
    for value in {GENUINE[place] ^ 1, 33, 255} - {GENUINE[place]}:
        path = spoiled(tmp_path, place, value)
        assert run_text("audit", path).returncode != 0 or is_read_by_sqlite(path)


@pytest.mark.parametrize(
    ("place", "value", "told"),
    [
        (19, 33, "wants version 33 of the format, and 2 is the newest one"),
        (22, 33, "has 40 21 20 at offset 21, where each database has 40 20 20"),
        (47, 9, "wants schema format 9, and 4 is the newest one"),
    ],
)
def test_what_is_wrong_is_told_and_the_rows_are_read(tmp_path: Path, place: int, value: int, told: str) -> None:
    path = spoiled(tmp_path, place, value)
    assert not is_read_by_sqlite(path)
    done = run_text("audit", path, environment={"COLUMNS": "200"})
    assert done.returncode == 1
    assert f"Damaged: its header {told}; SQLite refuses the file." in done.stdout
    done = run_text("vars", path)
    assert done.returncode == 3
    assert f"x.db, offset 0: its header {told}" in done.stderr
    assert "I_2_IN01" in done.stdout
