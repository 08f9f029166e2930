"""The newest file of a series in which nothing is yet, or that is not there: no row is missing, and that is told."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from tests.cli.test_series_as_sources import rolled
from tests.program_here import run_text

NOTHING = "nothing is in it: its logger had only begun it when it had closed the file before, or it was emptied"
CLOSED = ["x.db.0", "x.db.1", "x.db.2"]


def empty(path: Path) -> None:
    path.write_bytes(b"")


def without_table(path: Path) -> None:
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("VACUUM")
        connection.execute("CREATE TABLE log_1 (a INT)")
        connection.execute("DROP TABLE log_1")
        connection.commit()
    assert path.stat().st_size


def undone(path: Path) -> None:
    """Leave what a writer leaves that was killed while it made its table: nothing of it counts."""
    path.write_bytes(b"")
    path.with_name(f"{path.name}-journal").write_bytes(bytes.fromhex("d9d505f920a163d7") + bytes(504))


@pytest.fixture(params=[empty, without_table, undone])
def begun(request: pytest.FixtureRequest, tmp_path: Path) -> list[str]:
    """Return the files of a series of which the last one has nothing in it."""
    make: Callable[[Path], None] = request.param
    paths = rolled(tmp_path, CLOSED)
    make(tmp_path / "x.db")
    return [*paths, str(tmp_path / "x.db")]


def test_a_file_that_was_only_begun_is_no_damage(begun: list[str], tmp_path: Path) -> None:
    for named in ([begun[-1]], [str(tmp_path)]):
        done = run_text("audit", *named, "--json")
        found = json.loads(done.stdout)
        assert (done.returncode, found["findings"]) == (0, [])
        last = found["files"][-1]
        assert (last["path"], last["status"], last["rows"], last["notes"]) == (begun[-1], "read", 0, [NOTHING])
    assert NOTHING in " ".join(run_text("audit", begun[-1]).stdout.split())
    for named in (begun, [str(tmp_path)]):
        for words in (["vars"], ["report"], ["packets"]):
            done = run_text(*words, *named)
            assert (done.returncode, done.stderr) == (0, f"nvscope: {begun[-1]}: {NOTHING}.\n")
        assert " 29 " in run_text("vars", *named).stdout


def test_alone_it_has_no_row_and_its_closed_files_are_named(begun: list[str]) -> None:
    done = run_text("vars", begun[-1])
    assert done.returncode == 2
    assert done.stderr == f"nvscope: the database has no row\n  name its 3 closed files, up to {begun[2]}\n"


def test_a_file_that_is_missing_before_it_is_told(begun: list[str]) -> None:
    Path(begun[1]).unlink()
    done = run_text("vars", begun[0], *begun[2:])
    assert (done.returncode, "file 1 of its series is missing" in done.stderr) == (3, True)
    assert run_text("audit", begun[-1]).returncode == 1


def test_a_closed_file_without_anything_is_damage(tmp_path: Path) -> None:
    paths = rolled(tmp_path, [*CLOSED, "x.db"])
    empty(Path(paths[1]))
    done = run_text("audit", paths[-1], "--json")
    (finding,) = [one for one in json.loads(done.stdout)["findings"] if one["code"] == "NV959"]
    assert (done.returncode, finding["message"]) == (1, "It cannot be read: empty.")
    assert run_text("vars", *paths).returncode == 4


def test_a_database_alone_without_a_byte_cannot_be_read(tmp_path: Path) -> None:
    empty(tmp_path / "x.db")
    done = run_text("audit", tmp_path / "x.db")
    assert (done.returncode, "x.db: empty" in " ".join(done.stdout.split())) == (4, True)
    done = run_text("vars", tmp_path / "x.db")
    assert (done.returncode, "empty (0 bytes)" in " ".join(done.stderr.split())) == (4, True)


def test_closed_files_whose_newest_one_is_not_there(tmp_path: Path) -> None:
    paths = rolled(tmp_path, CLOSED)
    done = run_text("audit", tmp_path / "x.db", "--json")
    found = json.loads(done.stdout)
    assert (done.returncode, found["findings"]) == (0, [])
    assert [one["path"] for one in found["files"]] == paths
    told = " ".join(run_text("audit", tmp_path / "x.db").stdout.split())
    why = "its logger had only closed x.db.2 and not begun another file yet, or somebody took it away"
    assert f"x.db is not there: {why}" in told
    assert "3 closed files of x.db taken along" in told
    assert "is not there" not in run_text("audit", tmp_path).stdout
    done = run_text("vars", tmp_path / "x.db")
    assert done.returncode == 4
    assert done.stderr.endswith(f"No such file or directory\n  name its 3 closed files, up to {paths[-1]}\n")


def test_what_was_begun_beside_it_is_of_the_series(tmp_path: Path) -> None:
    paths = rolled(tmp_path, [*CLOSED, "x.db"])
    with closing(sqlite3.connect(tmp_path / "x.db.begun")) as connection:
        for (statement,) in sqlite3.connect(paths[0]).execute("SELECT sql FROM sqlite_master"):
            connection.execute(statement)
    done = run_text("vars", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert [line for line in done.stdout.splitlines() if line.startswith("db/")] == [
        "db/x.db, 1 variable logged, changed on 2026-01-31"
    ]
    assert [one["path"] for one in json.loads(run_text("audit", tmp_path, "--json").stdout)["files"]] == paths


def test_a_file_of_that_name_with_rows_is_a_database_of_its_own(tmp_path: Path) -> None:
    rolled(tmp_path, [*CLOSED, "x.db"])
    alone = run_text("vars", tmp_path).stdout
    rolled(tmp_path, ["x.db.begun"])
    told = run_text("vars", tmp_path).stdout
    assert told.startswith(alone)
    assert "db/x.db.begun, 1 variable logged" in told
