"""A closed file of a series that is missing: how long values lasted while it was written, nobody knows."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.read_values import meant, value_history
from nvscope.capture.open import open_source
from nvscope.view.documents.read_rows import summary_rows
from tests.datalogger.audit.built import Row, write
from tests.program_here import run_text

DECLARED = {"fast": "INT", "slow": "INT"}
STEP_MS, ROWS = 100, 40
NAMES = ("x.db.0", "x.db.1", "x.db.2", "x.db")


def series(folder: Path, *, changes: bool) -> list[Path]:
    """Write a series of which ``fast`` changes with each row, and ``slow`` in the middle of each file."""
    paths = []
    for part, name in enumerate(NAMES):
        rows = []
        for number in range(part * ROWS, (part + 1) * ROWS):
            fast, slow = number, (number + ROWS // 2) // ROWS
            values: dict[str, Any] = {"fast": fast, "slow": slow}
            counts = {"fast": fast, "slow": slow}
            if changes and number % ROWS not in (0, ROWS // 2):
                del values["slow"], counts["slow"]
            rows.append(Row(number * STEP_MS, values, counts if changes else {}))
        paths.append(write(folder / name, rows, DECLARED, changes=changes))
    return paths


def longest_ms(paths: Sequence[Path], packets: int = 100_000) -> dict[str, float | None]:
    """Return the longest time between two changes of each variable."""
    names = [str(path) for path in paths]
    history = value_history(meant("*"), every=False)
    for _ in Inquiry(names).run(open_source(names, batch_packets=packets), [history]):
        for known in history.known.values():
            for _ in known.entries():
                pass
    rows = {row["name"]: row["longest_ns"] for row in summary_rows(history.known)}
    return {name: None if longest is None else longest / 10**6 for name, longest in rows.items()}


@pytest.mark.parametrize("packets", [7, 100_000])
@pytest.mark.parametrize("changes", [False, True], ids=["every value", "changes"])
@pytest.mark.parametrize("missing", range(1, 4))
def test_no_time_is_told_across_a_missing_file(tmp_path: Path, missing: int, changes: bool, packets: int) -> None:
    paths = series(tmp_path, changes=changes)
    assert longest_ms(paths, packets) == {"fast": STEP_MS, "slow": ROWS * STEP_MS}
    # Of the newest closed ones, no number tells that one was there.
    gone = paths[-1 - missing : -1]
    for path in gone:
        path.unlink()
    left = [path for path in paths if path not in gone]
    # What is another value behind the hole changes there, as far as rows tell.
    slow = {1: ROWS * STEP_MS, 2: ROWS // 2 * STEP_MS, 3: None}[missing]
    assert longest_ms(left, packets) == {"fast": STEP_MS, "slow": slow}


@pytest.mark.parametrize("changes", [False, True], ids=["every value", "changes"])
def test_people_see_no_time_across_it_either(tmp_path: Path, changes: bool) -> None:
    *_, last_closed, newest = series(tmp_path, changes=changes)
    last_closed.unlink()
    words = ["vars", *(tmp_path / name for name in NAMES[:2]), newest, "--history", "slow", "--json"]
    done = run_text(*words)
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(done.stdout)["logged_variables"]
    assert row["longest_ns"] == ROWS * STEP_MS * 10**6
