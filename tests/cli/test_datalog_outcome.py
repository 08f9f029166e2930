"""``nvscope datalog``: what it says at its end is what is there."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.datalogger.plants import configuration, gvl, plant, rows_of, simulated
from tests.program import run_text

CYCLES = 'taskContext="list1"'
FULL = 'writeInterval="10" maxFileSize="12000"'


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """Return a folder with a capture of a hundred cycles of a list, and its definition."""
    simulated(tmp_path, plant())
    (tmp_path / "list1.gvl").write_text(gvl(1, ["dwFirst"]), encoding="utf-8")
    return tmp_path


def told(folder: Path, general: str, sink: str, *words: str) -> str:
    """Log the capture as a configuration says, and return what is told of it at the end."""
    (folder / "c.xml").write_text(configuration(["a/dwFirst"], general, sink), encoding="utf-8")
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", *words, cwd=folder)
    assert done.returncode == 0, done.stderr
    return next(line for line in done.stderr.splitlines() if line.startswith("nvscope: session: "))


def test_rows_that_were_deleted_are_told(here: Path) -> None:
    assert told(here, CYCLES, FULL) == (
        "nvscope: session: 100 rows of 1 variable, of which none is left in log.db: 100 rows deleted, the oldest ones "
        "(maxFileSize 12.0 kB)."
    )
    assert rows_of(here / "log.db") == []


def test_what_is_left_is_told(here: Path) -> None:
    general = 'samplingInterval="10ms" publishInterval="1s" bufferCapacity="100"'
    line = told(here, general, 'writeInterval="10" maxFileSize="20000" deleteRatio="50"')
    left = len(rows_of(here / "log.db"))
    assert 0 < left < 496
    assert f", of which {left} are left in log.db: {496 - left} rows deleted, the oldest ones (" in line
    assert line.startswith("nvscope: session: 496 rows of 1 variable, ")


def test_full_files_that_were_removed_are_told(here: Path) -> None:
    line = told(here, CYCLES, f'{FULL} rollover="true" maxFiles="3"')
    assert line == (
        "nvscope: session: 100 rows of 1 variable, of which 20 are left in log.db and 2 closed files: "
        "8 full files removed, the oldest ones (maxFiles 3)."
    )
    assert [len(rows_of(path)) for path in sorted(here.glob("log.db*"))] == [0, 10, 10]


@pytest.mark.parametrize("option", ["", "-w"])
def test_what_is_volatile_is_kept_where_a_file_is_named(option: str, here: Path) -> None:
    line = told(here, CYCLES, 'type="volatile"', *([option, "v.db"] if option else []))
    assert (" in memory; gone with the end of the session" in line) == (not option)
    assert (" in v.db." in line) == bool(option)
    assert (here / "v.db").exists() == bool(option)
    if option:
        assert len(rows_of(here / "v.db")) == 100


@pytest.mark.parametrize(("sink", "each"), [(FULL, "is deleted as soon"), (f'{FULL} rollover="true"', "fills a file")])
def test_a_size_below_that_of_an_empty_database_is_a_warning(sink: str, each: str, here: Path) -> None:
    told(here, CYCLES, sink)
    words = ("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".")
    for option in ("--force", "--dry-run"):
        done = run_text(*words, option, cwd=here)
        assert done.returncode == 0
        assert "nvscope: c.xml, line 1, column " in done.stderr
        assert f"an empty database of these variables has 12288; each block of rows {each}" in done.stderr
    told(here, CYCLES, FULL.replace("12000", "12289"), "--force")
    assert "empty database" not in run_text(*words, "--force", cwd=here).stderr


def test_a_forecast_tells_a_folder_that_is_not_there(here: Path) -> None:
    told(here, CYCLES, "")
    done = run_text(
        "datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "-w", "no/x.db", "--dry-run", cwd=here
    )  # fmt: skip
    assert "  Its folder does not exist, and none is made: no" in done.stdout.splitlines()
