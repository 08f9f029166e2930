"""Rows of databases as rows of a table, held to what SQLite answers."""

from __future__ import annotations

import csv
import io
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.program import run_text
from tests.tracker.datalogger.logs import Row, Value, at_ms, write_log

VARIABLES = (("Arp.Plc/run", "TINYINT"), ("Arp.Plc/speed", "DOUBLE"), ("Arp.Plc/text", "TEXT"), ("frame.time", "INT"))
NUMBERS = st.integers(-(2**63), 2**63 - 1)
VALUES = st.none() | NUMBERS | st.floats(allow_nan=False) | st.text(max_size=20) | st.binary(max_size=5)


def exported(path: str, *words: str) -> pl.DataFrame:
    """Return what an export of databases as wide Parquet holds."""
    with TemporaryDirectory() as folder:
        target = f"{folder}/out.parquet"
        done = run_text("export", path, "--form", "wide", "-w", target, *words)
        assert done.returncode == 0, done.stderr
        return pl.read_parquet(target)


def stored(path: str, table: str = "log_1") -> list[tuple[Value, ...]]:
    with closing(sqlite3.connect(path)) as database:
        return database.execute(f"SELECT * FROM {table} ORDER BY rowid").fetchall()


def in_place(value: Value, declared: str) -> Value:
    """Return a value where a column of its declared type can hold it."""
    holds = {"DOUBLE": float, "TEXT": str}.get(declared, int)
    if holds is float and isinstance(value, int):
        return float(value)
    return value if isinstance(value, holds) else None


@settings(max_examples=30)
@given(
    st.lists(st.tuples(*[VALUES] * len(VARIABLES)), min_size=1, max_size=20),
    st.lists(st.integers(0, 1), min_size=20, max_size=20),
)
def test_each_row_holds_what_is_stored(values: Sequence[tuple[Value, ...]], consistent: Sequence[int]) -> None:
    with TemporaryDirectory() as folder:
        rows = [Row(100 * at, row, consistent[at]) for at, row in enumerate(values)]
        path = write_log(Path(folder, "x.db"), VARIABLES, rows)
        frame = exported(path)
        # A variable that is called like a column in front of it has a prefix.
        assert frame.columns == [
            "frame.time", "frame.number", "db.row", "db.consistent", "Arp.Plc/run", "Arp.Plc/speed", "Arp.Plc/text",
            "var.frame.time",
        ]  # fmt: skip
        for at, (row, (time, told, *own)) in enumerate(zip(frame.iter_rows(named=True), stored(path), strict=True)):
            assert row["frame.time"].strftime("%Y-%m-%dT%H:%M:%S.%f") == time
            assert (row["frame.number"], row["db.row"], row["db.consistent"]) == (at + 1, at + 1, told != 0)
            assert [*row.values()][4:] == [
                in_place(value, declared) for value, (_, declared) in zip(own, VARIABLES, strict=True)
            ]  # fmt: skip


def test_values_of_another_type_than_their_column_are_counted(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT"), ("b", "INT")], [Row(0, ("no number", 7)), Row(1, (None, b"x"))])
    done = run_text("export", path, "--form", "wide", "-w", "-")
    assert [row["a"] + row["b"] for row in csv.DictReader(io.StringIO(done.stdout))] == ["7", ""]
    assert "2 values of another type" in done.stderr


def test_what_is_unchanged_stays_null_where_only_changes_are_stored(tmp_path: Path) -> None:
    rows = [Row(0, (1, 5)), Row(100, (1, 6)), Row(200, (2, 6))]
    path = write_log(tmp_path / "x.db", [("a", "INT"), ("b", "INT")], rows, only_changes=True)
    assert exported(path).select("a", "b").rows() == [(1, 5), (None, 6), (2, None)]


def test_each_table_has_a_file_and_a_series_one(tmp_path: Path) -> None:
    write_log(tmp_path / "x.db.0", [("a", "INT")], [Row(0, (1,))])
    write_log(tmp_path / "x.db", [("a", "INT")], [Row(100, (2,))])
    write_log(tmp_path / "y.db", [("b", "INT")], [Row(50, (3,))], table="log_2")
    write_log(tmp_path / "y.db", [("c", "INT")], [Row(60, (4,))], table="log_3")
    out = tmp_path / "out.csv"
    names = [str(tmp_path / name) for name in ("x.db.0", "x.db", "y.db")]
    done = run_text("export", *names, "--form", "wide", "-w", str(out))
    assert done.returncode == 0, done.stderr
    found = {path.name: [*csv.DictReader(path.open())] for path in sorted(tmp_path.glob("out*"))}
    assert [*found] == ["out.x.csv", "out.y.log_2.csv", "out.y.log_3.csv"]
    assert [row["a"] for row in found["out.x.csv"]] == ["1", "2"]
    # Frames are counted over all tables, in the order of time.
    assert [row["frame.number"] for rows in found.values() for row in rows] == ["1", "4", "2", "3"]
    assert f"{tmp_path}/out.y.log_2.csv: 1 row of databases" in done.stderr
    assert run_text("export", *names, "--form", "wide", "-w", "-").returncode == 2


def test_a_table_without_rows_has_its_columns(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [])
    assert exported(path).columns[4:] == ["a"]


def test_what_says_neither_that_data_was_lost_nor_that_none_was_is_null(tmp_path: Path) -> None:
    told = [1, 0, None, 5, 1]
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(1000 * at, (at,), one) for at, one in enumerate(told)])
    assert exported(path)["db.consistent"].to_list() == [True, False, None, None, True]


def test_a_filter_and_a_part_in_time_choose_among_rows(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(1000 * at, (at,), at != 3) for at in range(6)])
    assert exported(path, "-Y", "db.consistent == 0")["a"].to_list() == [3]
    assert exported(path, "--from-time", "2s", "--to-time", "4s")["a"].to_list() == [2, 3, 4]


def test_beside_lists_rows_have_a_file_of_their_own(tmp_path: Path) -> None:
    root = Path(__file__).parents[2]
    capture, gvl = str(root / "captures" / "peers" / "peers.pcap"), str(root / "captures" / "peers")
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(0, (1,)), Row(100, (2,))])
    out = str(tmp_path / "values.csv")
    done = run_text("export", path, capture, "--gvl", gvl, "--form", "wide", "-w", out)
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "values.db.csv") as file:
        assert [row["a"] for row in csv.DictReader(file)] == ["1", "2"]
    assert len([*tmp_path.glob("values.*.csv")]) > 1


@pytest.mark.parametrize("words", [("--rows", "cycle"), ("--form", "wide", "--rows", "telegram")])
def test_rows_of_tables_have_no_cycles(words: Sequence[str], tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(0, (1,))])
    done = run_text("export", path, *words, "-w", str(tmp_path / "out.csv"))
    assert (done.returncode, done.stderr.splitlines()[0]) == (
        2, "nvscope: --rows: telegrams of lists have cycles, and nothing else",
    )  # fmt: skip


def test_times_are_those_of_the_rows(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(1234, (1,))])
    done = run_text("export", path, "--form", "wide", "-w", "-")
    assert done.stdout.splitlines()[1].startswith(f"{at_ms(1234)}000Z,1,1,true,1")
