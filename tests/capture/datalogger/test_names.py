"""What files of a series are called is one rule, for whoever reads, audits, writes and removes them."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.datalogger.names import (
    closed_files,
    closed_names,
    is_called_database,
    number_of,
    parted,
    series_of,
    to_close,
)
from nvscope.datalogger.audit.series import series_of as audited_series
from tests.datalogger.plants import configuration, gvl, plant, rows_of, simulated
from tests.program_here import run_text

FAR = 10**19 - 1
CLOSED = {f"x.db.{number}": number for number in (0, 7, 10, FAR, FAR + 1, 10**60)}
OTHERS = [
    "x.db", "x.db.007", "x.db.00", "x.db.-1", "x.db.+1", "x.db.1.0x", "x.db.1 ", "x.db.1\n", "x.db.", "x.db.1_0",
    "x.db.\u0663", "x.db.\u00b2", "x.db.replaced", "x.db-wal", "x.db.0-wal", "y.db.0", "X.db.0", ".0",
    "ax.db.0", "x.db.0.1",
]  # fmt: skip


def test_closed_files_are_numbered_as_controllers_count(tmp_path: Path) -> None:
    for name in [*CLOSED, *OTHERS, "x.db.3.gz"]:
        (tmp_path / name).touch()
    path = str(tmp_path / "x.db")
    wanted = [(number, str(tmp_path / name)) for name, number in CLOSED.items()]
    assert closed_files(path) == wanted
    assert closed_names(path, [str(one) for one in tmp_path.iterdir()]) == wanted
    assert to_close(path) == (wanted, f"{path}.{10**60 + 1}")
    (series,) = audited_series([path])
    assert [(one.number, one.path) for one in series.members] == [*wanted, (None, path)]


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_called_otherwise_is_a_file_of_its_own(name: str) -> None:
    assert parted(name)[0] != "x.db" or name == "x.db"
    if name != "x.db.0.1":
        assert number_of(name) in {None, 0}


def test_one_number_is_one_name() -> None:
    """Two files of one series have never one number, whose rows would be taken for those of the other."""
    assert [parted(name) for name in ("x.db.007", "x.db.7")] == [("x.db.007", None), ("x.db", 7)]
    assert [parted(name) for name in ("x.db.0.1", ".0", "a/.0")] == [("x.db.0", 1), (".0", None), ("a/.0", None)]


@given(number=st.integers(0, 10**40), front=st.sampled_from(["", "a/", "a//", "./", "/"]))
def test_a_name_that_was_made_is_read(number: int, front: str) -> None:
    assert parted(f"{front}x.db.{number}") == (f"{front}x.db", number)
    for ending in ("", ".gz", ".zst", ".lz4"):
        assert number_of(f"{front}x.db.{number}{ending}") == number
        assert series_of(f"{front}x.db.{number}{ending}") == series_of(f"{front}x.db")
    assert is_called_database(f"x.db.{number}")


@pytest.mark.parametrize(
    ("name", "is_one"),
    [("x.db", True), ("x.db.0", True), (f"x.db.{FAR}", True), ("x.db.00", False), (".db", False), (".db.0", False),
     ("x.csv.0", False), ("x.db.0.gz", False)],
)  # fmt: skip
def test_databases_of_a_folder(name: str, is_one: bool) -> None:
    assert is_called_database(name) == is_one


@pytest.mark.parametrize("form", ["x.db", "./x.db", "{0}/x.db", "{0}//x.db", "{0}/./x.db"])
def test_a_folder_may_be_written_in_any_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("x.db", "x.db.0", "x.db.4"):
        (tmp_path / name).touch()
    path = form.format(tmp_path)
    assert closed_files(path) == [(0, f"{path}.0"), (4, f"{path}.4")]
    assert to_close(path) == (closed_files(path), f"{path}.5")


def test_a_number_that_a_compressed_file_has_is_not_given_again(tmp_path: Path) -> None:
    for name in ("x.db", "x.db.0", "x.db.1.gz", "x.db.2.zst"):
        (tmp_path / name).touch()
    path = str(tmp_path / "x.db")
    assert closed_files(path) == [(0, f"{path}.0")]
    assert to_close(path)[1] == f"{path}.3"


def test_no_folder_has_no_closed_files(tmp_path: Path) -> None:
    path = str(tmp_path / "none" / "x.db")
    assert to_close(path) == ([], f"{path}.0")


@pytest.mark.parametrize("target", ["{0}/log.db", "{0}//log.db"])
@pytest.mark.parametrize("before", ["log.db.9", "log.db.999999999", f"log.db.{FAR}", "log.db.2.gz"])
def test_files_that_were_closed_stay_as_they_are(tmp_path: Path, before: str, target: str) -> None:
    """A run goes on behind them, whatever their numbers are; none is written over."""
    simulated(tmp_path, plant())
    (tmp_path / "list1.gvl").write_text(gvl(1, ["dwFirst"]), encoding="utf-8")
    sink = 'rollover="true" writeInterval="30" maxFileSize="1"'
    (tmp_path / "c.xml").write_text(configuration(["a/dwFirst"], 'taskContext="list1"', sink), encoding="utf-8")
    words = ("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "-w", target.format(tmp_path), "--append")
    assert run_text(*words, cwd=tmp_path).returncode == 0
    kept = tmp_path / before
    if before.endswith(".gz"):
        kept.write_bytes(gzip.compress((tmp_path / "log.db.2").read_bytes()))
        (tmp_path / "log.db.2").unlink()
    else:
        os.rename(tmp_path / "log.db.2", kept)
    content = kept.read_bytes()
    done = run_text(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert kept.read_bytes() == content
    number = number_of(before)
    assert number is not None
    first = max(number, 3) + 1
    assert {number_of(path.name) for path in tmp_path.glob("log.db.*")} == {0, 1, 3, number, *range(first, first + 4)}
    assert len(rows_of(tmp_path / f"log.db.{first + 3}")) == 10
