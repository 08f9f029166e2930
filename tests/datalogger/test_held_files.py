"""While another program holds the file, rows wait for it; those that wait too long are lost, and that is told."""

from __future__ import annotations

from collections.abc import Container
from itertools import count
from pathlib import Path

import pytest

from nvscope.datalogger.audit.audit import audited
from nvscope.datalogger.database import Database, DatabaseLocked
from tests.datalogger.drawn_plants import START_NS, Plant
from tests.datalogger.oracle import DefinedList, Session
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import files_of, record_in_batches

LISTS = [
    DefinedList(name, index, ((name[0] + "Value", "UINT"),), 50 * MS) for index, name in enumerate(("ax", "by"), 1)
]
VARIABLES = {"a/T1/aValue": (1, "aValue"), "a/T2/bValue": (2, "bValue")}
TASKS = {"a/T1/aValue": 1, "a/T2/bValue": 2}
KEPT = 4
"""So many blocks wait, here of a row each."""


def rows_while_held(
    folder: Path, session: Session, held: Container[int], monkeypatch: pytest.MonkeyPatch
) -> list[tuple[int | None, ...]]:  # fmt: skip
    """Record telegrams that count from 0, while some attempts to write fail; return rows without times."""
    attempts, write = count(), Database.write

    def try_to_write(self: Database, *block: object) -> None:
        if next(attempts) in held:
            raise DatabaseLocked
        write(self, *block)  # type: ignore[arg-type]

    packets = [
        Packet(START_NS + 50 * MS * number + 10 * MS * one.index, f"10.0.0.{one.index}", one.index, 0, 1, number + 1,
               number.to_bytes(2, "little"))
        for number in range(40) for one in LISTS
    ]  # fmt: skip
    plant = Plant(LISTS, packets, session)
    captures = plant.write(folder)
    with monkeypatch.context() as context:
        context.setattr(Database, "write", try_to_write)
        record_in_batches(folder, captures, plant, 1)
    return [(row.consistent, *row.columns) for row in files_of(folder / "log.db")[""]]


@pytest.mark.parametrize("held", [range(20), range(20, 40)])
def test_each_task_says_so(held: range, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = Session(VARIABLES, tasks=TASKS, write_interval=1)
    rows = rows_while_held(tmp_path / "x", session, held, monkeypatch)
    told = [place for place, row in enumerate(rows) if not row[0]]
    lost = 80 - len(rows)
    assert lost == len(held) - KEPT
    assert told == [held.start, held.start + 1]
    assert "NV952" not in {one.kind.code for one in audited([str(tmp_path / "x" / "log.db")]).findings}


@pytest.mark.parametrize("held", [range(20), range(20, 40)])
def test_counters_tell_how_many_changes_it_took(
    held: range, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    session = Session(VARIABLES, tasks=TASKS, write_interval=1, changes_only=True)
    rows = rows_while_held(tmp_path / "x", session, held, monkeypatch)
    behind = rows[held.start]
    assert behind[0] == 0
    # In front of the first row, there is nothing that was counted.
    assert {counter for counter in behind[2::2] if counter is not None} == {18 if held.start else 0}
    assert {one.severity.word for one in audited([str(tmp_path / "x" / "log.db")]).findings} <= {"note"}


def test_in_the_end_each_block_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody who takes the file between any two blocks gives it back in time."""
    session = Session(VARIABLES, tasks=TASKS, write_interval=1)
    held = {number for number in range(76, 100) if number % 3}
    rows = rows_while_held(tmp_path / "x", session, held, monkeypatch)
    assert len(rows) == 80
    assert all(row[0] for row in rows)
