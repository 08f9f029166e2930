"""CAN frames as records: which fields stand there where nobody names any, of files, of a mixture, and of a pipe."""

from __future__ import annotations

import json
from pathlib import Path

import polars as pl
import pytest

import nvscope
from nvscope.view.fields.frame import DEFAULT_CAN_FIELDS, DEFAULT_FIELDS
from tests.definition.lists import telegram
from tests.export.given import written
from tests.program_here import run, run_text

LOG = "(0000000001.000000) can0 110#0102\n(0000000002.000000) can1 18FF0010#R2\n"
CAN_NAMES = [field.name for field in DEFAULT_CAN_FIELDS]
ALL_NAMES = list(dict.fromkeys([*(field.name for field in DEFAULT_FIELDS), *CAN_NAMES]))


def program(*words: str, stdin: bytes = b"") -> str:
    done = run(*words, stdin=stdin)
    assert (done.returncode, done.stderr) == (0, b"")
    return done.stdout.decode()


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "a.log"
    path.write_text(LOG)
    return path


@pytest.fixture
def ethernet(tmp_path: Path) -> Path:
    """A telegram in front of the frames of the log, so that all of it is read before them."""
    return tmp_path / written(tmp_path, [telegram(b"\1\2", 1, subindex=0, counter=1, ts_ns=0)])


def test_of_can_they_are_those_of_can(log: Path) -> None:
    assert program("packets", str(log), "-T", "csv").splitlines()[0].split(",") == CAN_NAMES


def test_of_can_from_a_pipe_too(log: Path) -> None:
    assert program("packets", "-", "-T", "csv", stdin=LOG.encode()) == program("packets", str(log), "-T", "csv")


@pytest.mark.parametrize("form", ["csv", "ndjson", "json"])
def test_of_a_mixture_they_are_those_of_both(log: Path, ethernet: Path, form: str) -> None:
    shown = program("packets", str(log), str(ethernet), "-T", form)
    if form == "csv":
        assert shown.splitlines()[0].split(",") == ALL_NAMES
        return
    rows = json.loads(shown) if form == "json" else [json.loads(line) for line in shown.splitlines()]
    assert [list(row) for row in rows] == [ALL_NAMES] * 3
    first, second, third = rows
    own = [name for name in ALL_NAMES if not name.startswith("frame.")]
    # None of the fields of the one exists in a row of the other.
    assert all(first[name] is None for name in own if name.startswith("can"))
    assert all(row[name] is None for row in (second, third) for name in own if not name.startswith("can"))
    assert (first["nv.index"], second["can.id"], third["can.channel"]) == (7, 0x110, "can1")


def test_exports_and_notebooks_have_the_same(log: Path, ethernet: Path, tmp_path: Path) -> None:
    path = tmp_path / "out.parquet"
    program("export", str(log), str(ethernet), "-w", str(path), "-q")
    assert pl.read_parquet(path).columns == ALL_NAMES
    assert nvscope.open([log, ethernet]).telegrams().columns == ALL_NAMES
    assert nvscope.open(log).telegrams().columns == CAN_NAMES


def test_dates_of_a_controller_have_no_zone(tmp_path: Path) -> None:
    """That of the capture is in UTC, and says so."""
    declared = "<GVL><Declarations>VAR_GLOBAL d : DT; END_VAR</Declarations><NetvarSettings Protocol='CAN'>"
    (tmp_path / "a.gvl").write_text(f"{declared}<ListIdentifier>5</ListIdentifier></NetvarSettings></GVL>")
    (tmp_path / "a.log").write_text("(1700000000.0) can0 005#00655365\n")
    asked = [tmp_path / "a.log", "--gvl", tmp_path / "a.gvl"]
    wanted = ["-e", "frame.time", "-e", "var.d", "-Y", 'var.d == "2023-11-14 12:16:00"']
    done = run_text("packets", "-q", *asked, "-T", "fields", *wanted)
    assert done.stdout == "2023-11-14T22:13:20.000000000Z\t2023-11-14T12:16:00.000000000\n"
    (row,) = json.loads(run_text("packets", "-q", *asked, "-T", "json", *wanted).stdout)
    assert row["var.d"] == "2023-11-14T12:16:00.000000000"
    exported = run_text("export", *asked, "-w", "-").stdout.splitlines()[1]
    assert exported.split(",")[::4] == ["2023-11-14T22:13:20.000000000Z", "2023-11-14T12:16:00.000000000"]
