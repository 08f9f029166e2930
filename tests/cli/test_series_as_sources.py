"""Series of databases as sources: a file that lacks between others is told, and nothing is concluded across it."""

from __future__ import annotations

import gzip
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.program_here import run_text
from tests.tracker.datalogger.logs import Row, write_log

MISSING = "offset 0: file 1 of its series is missing before it"


def rolled(folder: Path, names: Sequence[str], *, only_changes: bool = False) -> list[str]:
    """Write files of a series, of ten rows each, in which a value changes each 100 ms; return their paths."""
    return [
        write_log(
            folder / name, [("a", "INT")], [Row(100 * n, (n,)) for n in range(10 * place, 10 * place + 10)],
            only_changes=only_changes,
        )
        for place, name in enumerate(names)
    ]  # fmt: skip


def longest(told: str) -> list[str]:
    """Return what a history says of the variable: rows, changes, shortest and longest time between two."""
    (line,) = [line for line in told.splitlines() if line.startswith("a ") and line.endswith(" ms")]
    return line.split()[2:]


@pytest.mark.parametrize("only_changes", [False, True])
@pytest.mark.parametrize("order", [[0, 2, 3], [3, 2, 0], []])
def test_a_file_that_is_missing_is_told_and_nothing_is_concluded_across_it(
    tmp_path: Path, order: list[int], only_changes: bool
) -> None:
    paths = rolled(tmp_path, ["x.db.0", "x.db.1", "x.db.2", "x.db"], only_changes=only_changes)
    Path(paths[1]).unlink()
    named = [paths[place] for place in order] or [str(tmp_path)]
    done = run_text("vars", *named, "--history", "a")
    assert done.returncode == 3
    assert done.stderr == f"nvscope: {paths[2]}, {MISSING}\n"
    assert longest(done.stdout) == ["30", "29", "100.0", "ms", "100.0", "ms"]
    for words in (["report"], ["packets"], ["vars"]):
        done = run_text(*words, *named)
        assert (done.returncode, done.stderr) == (3, f"nvscope: {paths[2]}, {MISSING}\n")
    assert "0" in next(line for line in run_text("report", *named).stdout.splitlines() if "db/x.db" in line).split()[-1]


def test_several_files_that_are_missing_are_told_in_numbers(tmp_path: Path) -> None:
    paths = rolled(tmp_path, ["x.db.2", "x.db.6", "x.db.8", "x.db"])
    assert run_text("vars", *paths).stderr.splitlines() == [
        f"nvscope: {paths[1]}, offset 0: files 3 to 5 of its series are missing before it",
        f"nvscope: {paths[2]}, offset 0: file 7 of its series is missing before it",
    ]
    far = rolled(tmp_path, ["y.db.0", "y.db.999999999"])
    assert "files 1 to 999999998 of its series are missing before it" in run_text("vars", *far).stderr


@pytest.mark.parametrize("names", [["x.db.0", "x.db.1", "x.db"], ["x.db.8", "x.db.9", "x.db.10"], ["x.db.7", "x.db"]])
def test_a_series_that_goes_on_is_whole_wherever_it_begins(tmp_path: Path, names: list[str]) -> None:
    paths = rolled(tmp_path, names)
    done = run_text("vars", *paths, "--history", "a")
    assert (done.returncode, done.stderr) == (0, "")
    rows = 10 * len(names)
    assert longest(done.stdout)[:2] == [str(rows), str(rows - 1)]


@pytest.mark.parametrize("last", ["x.db", "x.db.3"])
def test_a_file_that_nobody_named_is_no_damage_and_nothing_is_concluded_across_it(tmp_path: Path, last: str) -> None:
    paths = rolled(tmp_path, ["x.db.0", "x.db.1", "x.db.2", last])
    done = run_text("vars", paths[0], paths[2], paths[3], "--history", "a")
    told = f"1 closed file of its series beside it, such as {paths[1]}, was not named, and is not read."
    assert (done.returncode, done.stderr) == (0, f"nvscope: {paths[3]}: {told}\n")
    assert longest(done.stdout)[-2:] == ["100.0", "ms"]


def test_the_newest_closed_file_that_nobody_named_is_missing_in_front_of_the_last_one(tmp_path: Path) -> None:
    paths = rolled(tmp_path, ["x.db.0", "x.db.1", "x.db"])
    done = run_text("vars", paths[0], paths[2], "--history", "a")
    assert done.returncode == 0
    assert longest(done.stdout)[-2:] == ["100.0", "ms"]


def test_a_file_of_a_folder_that_cannot_be_read_is_missing(tmp_path: Path) -> None:
    paths = rolled(tmp_path, ["x.db.0", "x.db.1", "x.db"])
    Path(paths[1]).write_bytes(b"no database")
    done = run_text("vars", tmp_path, "--history", "a")
    assert done.returncode == 3
    assert f"{paths[2]}, offset 0: x.db.1, which comes before it, cannot be read\n" in done.stderr
    assert longest(done.stdout)[-2:] == ["100.0", "ms"]


def test_each_series_of_a_folder_is_one_by_itself(tmp_path: Path) -> None:
    rolled(tmp_path, ["x.db.0", "x.db.1", "x.db"])
    broken = rolled(tmp_path, ["y.db.0", "y.db.2"])
    done = run_text("vars", tmp_path)
    assert (done.returncode, done.stderr) == (3, f"nvscope: {broken[1]}, {MISSING}\n")


def test_files_that_were_compressed_are_of_their_series(tmp_path: Path) -> None:
    paths = rolled(tmp_path, ["x.db.0", "x.db.1", "x.db.2"])
    packed = []
    for path in paths:
        with open(path, "rb") as file, gzip.open(f"{path}.gz", "wb") as target:
            shutil.copyfileobj(file, target)
        Path(path).unlink()
        packed.append(f"{path}.gz")
    assert run_text("vars", *packed).stderr == ""
    Path(packed[1]).unlink()
    assert MISSING in run_text("vars", packed[0], packed[2]).stderr
