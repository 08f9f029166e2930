"""Of a full file, the oldest rows make room, whichever table they are of; what a run has just written goes last."""

from __future__ import annotations

import sqlite3
from collections import Counter
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.datalogger.tables import LoggedVariable, LogTable, statement
from dissectors.datalogger.timestamps import iso_texts, raw_of
from nvscope.datalogger.begun_files import begin_file
from nvscope.datalogger.oldest_rows import Deleted, OldestRows
from tests.datalogger.plants import configuration, gvl, plant, simulated
from tests.program_here import run_text

SECOND_NS = 10**9


def table(name: str, *, raw: bool = True, variable: str = "a") -> LogTable:
    return LogTable(name, raw, (LoggedVariable(variable, "INT", 2),))


def fill(connection: sqlite3.Connection, one: LogTable, seconds: list[int]) -> None:
    """Write rows at some times, of whose value each has the number it was written as."""
    times_ns = np.array(seconds, np.int64) * SECOND_NS
    if one.raw or not seconds:
        stamps = raw_of(times_ns).tolist()
    else:
        stamps = [text.tobytes().decode() for text in iso_texts(times_ns)]
    connection.executemany(
        f"INSERT INTO {one.name} VALUES (?, 1, ?)", [(stamp, number) for number, stamp in enumerate(stamps)]
    )


def left_of(connection: sqlite3.Connection, one: LogTable) -> list[int]:
    rows = connection.execute(f'SELECT "{one.variables[0].name}" FROM {one.name} ORDER BY 1').fetchall()
    return [number for (number,) in rows]


def rows_that_stay(older: dict[str, list[int]], own: str, fresh: int, percent: int) -> dict[str, list[int]]:
    """Return the numbers of the rows that stay, by table: those of earlier runs go by their times, then the fresh."""
    waiting = []
    for place, (name, seconds) in enumerate(older.items()):
        for number in range(len(seconds)):
            # A row is never older than one in front of it.
            waiting.append((max(seconds[: number + 1]), name != own, place, name, number))
    waiting.sort()
    every = [(name, number) for *_, name, number in waiting]
    every += [(own, len(older[own]) + number) for number in range(fresh)]
    share = max(1, len(every) * percent // 100)
    stays: dict[str, list[int]] = {name: [] for name in older}
    for name, number in every[share:]:
        stays[name].append(number)
    return stays


@given(
    older=st.lists(st.lists(st.integers(0, 40), max_size=30), min_size=3, max_size=3),
    raw=st.lists(st.booleans(), min_size=3, max_size=3), fresh=st.integers(0, 30), percent=st.integers(1, 100),
    vacuum=st.sampled_from(["NONE", "FULL"]),
)  # fmt: skip
def test_rows_of_earlier_runs_go_by_their_times_and_fresh_ones_last(
    older: list[list[int]], raw: list[bool], fresh: int, percent: int, vacuum: str
) -> None:
    tables = [table(f"log_{number}", raw=is_raw) for number, is_raw in enumerate(raw)]
    own = tables[0]
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        connection.execute(f"PRAGMA auto_vacuum = {vacuum}")
        for one, seconds in zip(tables, older, strict=True):
            connection.execute(statement(one))
            fill(connection, one, seconds)
        rows = OldestRows(connection, own, tables)
        values = [(0, len(older[0]) + number) for number in range(fresh)]
        connection.executemany(f"INSERT INTO {own.name} VALUES (?, 1, ?)", values)
        rows._delete(percent)
        told = {one.name: left_of(connection, one) for one in tables}
        named = {one.name: seconds for one, seconds in zip(tables, older, strict=True)}
        assert told == rows_that_stay(named, own.name, fresh, percent)
        gone = {name: len(seconds) - sum(number < len(seconds) for number in told[name])
                for name, seconds in named.items()}  # fmt: skip
        lost = fresh - sum(number >= len(older[0]) for number in told[own.name])
        others = Counter({name: count for name, count in gone.items() if count and name != own.name})
        assert rows.deleted == Deleted(lost, gone[own.name], others)


@pytest.mark.parametrize("vacuum", ["NONE", "INCREMENTAL", "FULL"])
def test_a_file_that_does_not_shrink_is_not_emptied(vacuum: str) -> None:
    """Room in the file is room, whether or not the disk gets it back."""
    own = table("log_1")
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        connection.execute(f"PRAGMA auto_vacuum = {vacuum}")
        connection.execute(statement(own))
        fill(connection, own, list(range(5_000)))
        rows = OldestRows(connection, own, [own])
        before = rows.used_bytes
        rows.make_room(before, 30)
        assert (rows.deleted.before, len(left_of(connection, own))) == (1_500, 3_500)
        assert rows.used_bytes < before


def test_many_rows_make_room_by_parts() -> None:
    one, other, own = table("log_1"), table("log_2", raw=False), table("log_3")
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        begin_file(connection)
        for each in (one, other, own):
            connection.execute(statement(each))
        fill(connection, one, list(range(0, 40_000, 2)))
        fill(connection, other, list(range(1, 40_000, 2)))
        rows = OldestRows(connection, own, [one, other, own])
        fill(connection, own, list(range(100)))
        rows._delete(25)
        share = 40_100 // 4
        assert share - 25 < rows.deleted.count <= share
        assert abs(rows.deleted.others["log_1"] - rows.deleted.others["log_2"]) <= 25
        assert len(left_of(connection, own)) == 100


def test_a_variable_that_is_called_like_the_ids_of_rows_is_none() -> None:
    own, other = table("log_1", variable="rowid"), table("log_2", variable="ROWID")
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        for one in (own, other):
            connection.execute(statement(one))
            connection.executemany(f"INSERT INTO {one.name} VALUES (0, 1, ?)", [(-number,) for number in range(10)])
        rows = OldestRows(connection, own, [own, other])
        rows._delete(25)
        assert rows.deleted == Deleted(0, 5)
        assert left_of(connection, own) == [-9, -8, -7, -6, -5]


def test_a_table_whose_rows_have_no_ids_stays() -> None:
    own, other = table("log_1"), table("log_2")
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        connection.execute(statement(own))
        connection.execute(f"{statement(other)[:-1]}, PRIMARY KEY (Timestamp)) WITHOUT ROWID")
        connection.execute("INSERT INTO log_2 VALUES (5, 1, 1)")
        rows = OldestRows(connection, own, [own, other])
        fill(connection, own, [1, 2, 3])
        rows.make_room(1, 50)
        assert (rows.deleted, left_of(connection, other)) == (Deleted(3), [1])


@pytest.fixture
def full(tmp_path: Path) -> Path:
    """Return a folder with a database of one list that is nearly as large as the configuration of the next run says."""
    simulated(tmp_path, plant(lists=2, duration="60s"))
    for index, name in ((1, "dwFirst"), (2, "dwSecond")):
        (tmp_path / f"list{index}.gvl").write_text(gvl(index, [name]), encoding="utf-8")
    told(tmp_path, ["a/dwFirst"], "list1", "")
    return tmp_path


def told(folder: Path, variables: list[str], task: str, sink: str, *words: str) -> str:
    (folder / "c.xml").write_text(configuration(variables, f'taskContext="{task}"', sink), encoding="utf-8")
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", *words, cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stderr.splitlines()[-1] + done.stdout


def counts(database: Path) -> list[int]:
    """Return how many rows each table has, the one that was made first in front."""
    with closing(sqlite3.connect(database)) as connection:
        names = [name for (name,) in connection.execute("SELECT name FROM sqlite_master ORDER BY rowid")]
        return [connection.execute(f"SELECT count(*) FROM {name}").fetchone()[0] for name in names]


def test_rows_of_another_table_go_before_those_of_the_run(full: Path) -> None:
    size = (full / "log.db").stat().st_size * 3 // 2
    sink = f'writeInterval="50" maxFileSize="{size}"'
    line = told(full, ["a/dwSecond"], "list2", sink, "--append")
    older, fresh = counts(full / "log.db")
    assert (fresh, older) == (1_200, 1_200 - int(line.partition("log.db: ")[2].split()[0]))
    assert f"1200 rows of 1 variable in log.db: {1_200 - older} rows of another table (log_" in line
    assert 0 < older < 1_200
    assert " deleted, the oldest ones (maxFileSize " in line
    # Both runs are of one time, and what is left of the first is the end of it.
    line = told(full, ["a/dwSecond"], "list2", sink, "--append")
    then, now = counts(full / "log.db")
    assert then == older
    assert f"1200 rows of 1 variable in log.db: {2_400 - now} rows of earlier runs deleted, the oldest ones" in line


def test_rows_of_the_run_are_told_as_such(full: Path) -> None:
    line = told(full, ["a/dwSecond"], "list2", 'writeInterval="50" maxFileSize="40000"', "--append")
    older, fresh = counts(full / "log.db")
    assert older == 0
    assert f", of which {fresh} are left in log.db: 1200 rows of another table (log_" in line
    assert f" and {1_200 - fresh} rows of this run deleted, the oldest ones (" in line


@pytest.mark.parametrize("size", [16_384, 16_385])
def test_tables_that_leave_no_room_for_a_row_are_told_in_front(full: Path, size: int) -> None:
    sink = f'writeInterval="50" maxFileSize="{size}"'
    (full / "c.xml").write_text(configuration(["a/dwSecond"], 'taskContext="list2"', sink), encoding="utf-8")
    words = ("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".")
    for option in ("--dry-run", "-q"):
        said = run_text(*words, "--append", option, cwd=full).stderr
        told = (
            "an empty database of these variables, with 1 other table that log.db has, has 16384; each block of rows is"
        )
        assert (told in said) == (size == 16_384)
    assert "empty database" not in run_text(*words, "--dry-run", cwd=full).stderr


def test_full_files_of_earlier_runs_are_told(full: Path) -> None:
    rolls = 'rollover="true" writeInterval="50" maxFileSize="20000" maxFiles="{}"'
    told(full, ["a/dwFirst"], "list1", rolls.format(-1), "--force")
    there = len(list(full.glob("log.db.*")))
    line = told(full, ["a/dwSecond"], "list2", rolls.format(2), "--append")
    removed = int(line.partition(" full files removed")[0].split()[-1])
    # The file that was written last gets rows of the run before it is closed.
    assert f" (maxFiles 2), {there} of them of earlier runs; " in line
    assert removed > there
