"""Lists on CAN, which have no Counter: what of a cycle that does not come is in the database, and in its audit."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.datalogger.plants import configuration, rows_of
from tests.program_here import run_text
from tests.test_captures_index import CAPTURES

GONE = (30, 60, 61)
"""Frames of the list of 100 ms that are taken away, as they come from 1."""


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """Return a folder with a log in which three frames of a list are missing."""
    kept, number = [], 0
    for line in (CAPTURES / "can" / "press.log").read_text(encoding="utf-8").splitlines(keepends=True):
        number += " 120#" in line
        if " 120#" not in line or number not in GONE:
            kept.append(line)
    (tmp_path / "lost.log").write_text("".join(kept), encoding="utf-8")
    (tmp_path / "level.gvl").write_bytes((CAPTURES / "can" / "level.gvl").read_bytes())
    return tmp_path


@pytest.mark.parametrize("general", ['taskContext="level"', 'samplingInterval="100ms" publishInterval="100ms"'])
def test_a_cycle_without_a_counter_is_a_row_that_is_missing_or_an_old_value(here: Path, general: str) -> None:
    (here / "c.xml").write_text(configuration(["a/level.v0"], general), encoding="utf-8")
    done = run_text("datalog", "lost.log", "--config", "c.xml", "--gvl", "level.gvl", cwd=here)
    assert done.returncode == 0, done.stderr
    rows = rows_of(here / "log.db")
    assert {row[2] for row in rows} == {1}
    told = json.loads(run_text("audit", "log.db", "--json", cwd=here).stdout)
    missing = [(one["code"], one["severity"], one["count"], one["rows"]) for one in told["findings"]]
    if "task" not in general:
        assert missing == []
        return
    assert len(rows) == 100 - len(GONE) - 1
    behind = [place + 1 for place in range(1, len(rows)) if rows[place][3] - rows[place - 1][3] > 1]
    assert len(behind) == 3
    assert missing == [("NV952", "error", 3, behind)]
