"""A recording that is killed at any step of a rollover leaves a series that is whole, and can be gone on with."""

from __future__ import annotations

import os
import sqlite3
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from nvscope.capture.datalogger.names import parted
from nvscope.datalogger.audit.audit import audited
from nvscope.findings.kind import Severity
from tests.datalogger.drawn_plants import START_NS, Plant
from tests.datalogger.oracle import DefinedList, Session
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import opened, record_in_batches, table_in
from tests.program_here import run_text

AXIS = DefinedList("axis", 1, (("VarA", "UINT"),), 10 * MS)
BLOCK = 10
"""Each block fills a file."""

KILLED = 9
_CALLS = ("os.rename", "os.remove", "sqlite3.connect")


def plant(first: int, stop: int, max_files: int, *, changes_only: bool = False) -> Plant:
    """Return telegrams whose values are numbers that follow each other."""
    packets = [
        Packet(START_NS + 10 * MS * number, "10.0.0.1", 1, 0, 1, number + 1, number.to_bytes(2, "little"))
        for number in range(first, stop)
    ]
    session = Session(
        {"VarA": (1, "VarA")}, 10 * MS, 10 * MS, rollover=True, max_files=max_files, max_file_size=1,
        write_interval=BLOCK, changes_only=changes_only,
    )  # fmt: skip
    return Plant([AXIS], packets, session)


class Killed:
    """Lets this process end, without a chance to do anything, in front of its n-th step that touches a file."""

    def __init__(self, folder: Path, steps: int) -> None:
        self._folder, self._left = str(folder), steps

    def step(self) -> None:
        if not self._left:
            os._exit(KILLED)
        self._left -= 1

    def begin(self) -> None:
        connect = sqlite3.connect
        killed = self

        class Stepwise(sqlite3.Connection):
            def execute(self, *statement: Any) -> sqlite3.Cursor:
                killed.step()
                return super().execute(*statement)

        sqlite3.connect = lambda *place, **options: connect(*place, **options, factory=Stepwise)
        sys.addaudithook(self._watch)

    def _watch(self, event: str, about: Any) -> None:
        if event in _CALLS and str(about[0]).startswith(self._folder):
            self.step()


def killed_at(step: int, folder: Path, captures: list[Path], logged: Plant, *, append: bool = False) -> bool:
    """Record in a process that is killed in front of a step; return whether it was, or came to its end before."""
    child = os.fork()
    if not child:
        try:
            Killed(folder, step).begin()
            record_in_batches(folder, captures, logged, 1000, append=append)
            os._exit(0)
        finally:
            os._exit(1)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert code in (0, KILLED)
    return code == KILLED


def series(folder: Path) -> list[Path]:
    """Return the files of the series, the oldest first."""
    found = [(parted(str(path))[1], path) for path in folder.iterdir() if parted(path.name)[0] == "log.db"]
    return [path for _, path in sorted(found, key=lambda one: (one[0] is None, one[0]))]


def values(paths: Iterable[Path]) -> list[int]:
    """Return what SQLite finds in files, when what was unfinished is undone."""
    found = []
    for path in paths:
        sqlite3.connect(path).execute("SELECT count(*) FROM sqlite_master").connection.close()
        connection = opened(path)
        found += [value for (value,) in connection.execute(f"SELECT VarA FROM {table_in(connection)[0]}")]
        connection.close()
    return found


def errors(folder: Path) -> list[str]:
    audit = audited([str(folder / "log.db")])
    assert not audit.is_unreadable
    return [one.message for one in audit.findings if one.severity is not Severity.NOTE]


def assert_is_whole(folder: Path, max_files: int) -> list[int]:
    """Assert that nobody finds fault with a series, and that all of its last rows are there; return their values."""
    assert errors(folder) == []
    paths = series(folder)
    assert all(path.stat().st_size for path in paths)
    told = run_text("vars", *paths)
    found = values(paths)
    if found:
        assert told.returncode == 0
        assert all("/log.db: log.db-journal " in line for line in told.stderr.splitlines())
    else:
        assert (told.returncode, told.stderr.splitlines()[0][-10:]) == (2, "has no row")
    written = found[-1] + 1 if found else 0
    assert found == list(range(written - len(found), written))
    assert len(found) >= (written if max_files < 0 else min(written, BLOCK * (max_files - 1)))
    return found


@pytest.mark.long
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a process that can be copied")
@pytest.mark.parametrize(("max_files", "blocks"), [(-1, 2), (2, 3)])
def test_a_rollover_that_is_killed_at_any_step_loses_nothing(tmp_path: Path, max_files: int, blocks: int) -> None:
    first, second = plant(0, BLOCK * blocks, max_files), plant(1000, 1000 + BLOCK * blocks, max_files)
    captures, again = first.write(tmp_path / "first"), second.write(tmp_path / "second")
    written, step, without_newest = [0], 0, 0
    looked_at: list[tuple[str, int]] = []
    while True:
        folder = tmp_path / str(step)
        first.write(folder)
        if not killed_at(step, folder, captures, first):
            break
        step += 1
        without_newest += bool(series(folder)) and not (folder / "log.db").exists()
        sizes = sorted((path.name, path.stat().st_size) for path in folder.iterdir())
        if not series(folder) or sizes == looked_at:
            continue
        stood, looked_at = assert_is_whole(folder, max_files), sizes
        written.append(len(stood) and stood[-1] + 1)
        record_in_batches(folder, again, second, 1000, append=True)
        left = values(series(folder))
        assert errors(folder) == []
        assert [path.name for path in folder.iterdir() if "begun" in path.name or "journal" in path.name] == []
        fresh = list(range(1000, 1000 + BLOCK * blocks))
        if max_files < 0:
            assert left == [*stood, *fresh]
        else:
            assert left == [*stood, *fresh][-len(left) :]
            assert len(left) >= BLOCK * (max_files - 1)
            assert len(series(folder)) <= max_files
    assert step > 20 * blocks
    assert without_newest == blocks
    # Rows are never fewer than at an earlier step.
    assert written == sorted(written)
    assert written[-1] == BLOCK * blocks
