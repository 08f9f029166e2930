"""A run that goes on with a database says so where it begins, whatever it knows by then.

List 2 is sent 10 ms behind list 1, every 50 ms: the first row of each run does not know it yet. The values of the lists
count their telegrams from 0.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from nvscope.datalogger.audit.audit import Audit, audited
from nvscope.datalogger.audit.time_strip import Mark
from tests.datalogger.audit.built import Row, only_changes, write
from tests.datalogger.audit.test_planted import told
from tests.datalogger.plants import configuration, gvl, plant, rows_of, simulated
from tests.program_here import run_text

CHANGES = 'storeChangesOnly="true"'
CYCLES = 'taskContext="list1"'
LOST = ("NV951", "note", None)
STARTED = ("NV954", "note", None)


def of_runs(folder: Path, general: str, sink: str = "", *, uris: tuple[str, ...] = ("a/dwFirst", "a/dwSecond")) -> None:
    """Record two captures, a minute apart, one by one into one database."""
    for index, name in enumerate(("dwFirst", "dwSecond"), 1):
        (folder / f"list{index}.gvl").write_text(gvl(index, [name]), encoding="utf-8")
    (folder / "c.xml").write_text(configuration(uris, general, sink), encoding="utf-8")
    for minute in range(2):
        run_at(folder, minute)


def run_at(folder: Path, minute: int) -> None:
    simulated(folder, plant(lists=2).replace("seed = 3", f"start = 2024-01-01T00:0{minute}:00+00:00"))
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "--append", cwd=folder)
    assert done.returncode == 0, done.stderr


def cells(rows: list[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
    """Return ConsistentDataSeries and what stands behind it."""
    return [row[2:] for row in rows]


def kinds(audit: Audit) -> list[tuple[str, str, str | None]]:
    return [one[:3] for one in told(audit)]


def test_what_is_not_known_yet_begins_anew_too(tmp_path: Path) -> None:
    of_runs(tmp_path, CYCLES, CHANGES)
    rows = cells(rows_of(tmp_path / "log.db"))
    assert rows[99:103] == [(1, 99, 99, 98, 98), (0, 0, 0, None, 0), (1, 1, 1, 0, 1), (1, 2, 2, 1, 2)]
    # Nobody has recorded anything in front of the first run.
    assert rows[:2] == [(1, 0, 0, None, None), (1, 1, 1, 0, 0)]
    audit = audited([str(tmp_path / "log.db")])
    assert told(audit) == [(*LOST, (101,)), (*STARTED, (101,))]
    (table,) = audit.tables
    assert (table.audit.restarts, table.audit.coverage.gaps[Mark.TOLD]) == (1, 0)
    assert table.audit.coverage.missing_ns == table.audit.coverage.off_ns == 55_050_000_000
    assert [one.unknown for one in table.audit.figures] == [0, 2]
    assert [one.changes for one in table.audit.figures] == [199, 197]


def test_counters_begin_with_the_first_row_that_the_ring_buffer_has_left(tmp_path: Path) -> None:
    general = 'samplingInterval="50ms" publishInterval="200ms" bufferCapacity="1"'
    of_runs(tmp_path, general, CHANGES, uris=("a/dwSecond",))
    rows = cells(rows_of(tmp_path / "log.db"))
    half = len(rows) // 2
    # Of four samples the last one is left, in front of the first row, too.
    assert rows[:3] == rows[half : half + 3] == [(0, 3, 0), (0, 7, 4), (0, 11, 8)]
    assert kinds(audited([str(tmp_path / "log.db")])) == [("NV951", "note", None), STARTED]


@pytest.mark.parametrize("sink", ["", CHANGES])
def test_each_task_says_it(tmp_path: Path, sink: str) -> None:
    (tmp_path / "nvscope.toml").write_text('[datalogger.tasks]\nT1 = "list1"\nT2 = "list2"\n', encoding="utf-8")
    of_runs(tmp_path, "", sink, uris=("a/T1/dwFirst", "a/T2/dwSecond"))
    rows = cells(rows_of(tmp_path / "log.db"))
    audit = audited([str(tmp_path / "log.db")])
    if sink:
        assert rows[200:203] == [(0, 0, 0, None, 0), (1, None, None, 0, 1), (1, 1, 1, None, None)]
        assert told(audit) == [(*LOST, (201,)), (*STARTED, (201,))]
    else:
        assert rows[200:203] == [(0, 0, None), (0, None, 0), (1, 1, None)]
        assert told(audit) == [("NV951", "note", None, (201, 202))]
    assert all(row[0] for row in [*rows[:200], *rows[202:]])


@pytest.mark.parametrize("is_there", [True, False])
def test_a_run_may_begin_a_file(tmp_path: Path, *, is_there: bool) -> None:
    """A row in which all counters are 0 may be what a file goes on with; whether the file before it is there or not."""
    sink = f'{CHANGES} rollover="true" maxFileSize="1" writeInterval="100"'
    of_runs(tmp_path, CYCLES, sink, uris=("a/dwFirst",))
    if not is_there:
        (tmp_path / "log.db").unlink()
        run_at(tmp_path, 2)
    closed = [rows_of(tmp_path / f"log.db.{number}") for number in range(2 if is_there else 3)]
    assert [rows[0][2:] for rows in closed] == [(1, 0, 0), *[(0, 0, 0)] * (len(closed) - 1)]
    audit = audited([str(tmp_path / "log.db")])
    assert told(audit) == [(*LOST, (1,))] * (len(closed) - 1)
    assert audit.tables[0].audit.coverage.missing_ns == (len(closed) - 1) * 55_050_000_000


def test_a_start_that_knows_not_all_is_told_once(tmp_path: Path) -> None:
    rows = only_changes(10)
    start = Row(60_000, {"a": 7}, {"a": 0, "b": 0, "c": 0}, consistent=0)
    behind = [Row(60_250, {"a": 8, "b": rows[-2].values["b"]}, {"a": 1, "b": 1})]
    write(tmp_path / "x.db", [*rows, start, *behind], {"a": "SMALLINT", "b": "FLOAT", "c": "TINYINT"}, changes=True)
    audit = audited([str(tmp_path / "x.db")])
    assert told(audit) == [(*LOST, (11,)), (*STARTED, (11,))]
    assert [one.unknown for one in audit.tables[0].audit.figures] == [0, 1, 2]


def test_a_value_without_its_counter_is_none_where_nothing_was_lost(tmp_path: Path) -> None:
    rows = [*only_changes(10), Row(60_000, {"a": 7, "b": 0.1}, {"a": 0, "b": 0, "c": 0})]
    write(tmp_path / "x.db", rows, {"a": "SMALLINT", "b": "FLOAT", "c": "TINYINT"}, changes=True)
    assert told(audited([str(tmp_path / "x.db")])) == [(*STARTED, (11,)), ("NV957", "note", "c", (11,))]
