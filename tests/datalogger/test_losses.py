"""Where the network lost something, the first row behind it says so, and no other row does.

The values of the lists count the telegrams from 0, so that a row tells of which telegram it is.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.datalogger.plants import configuration, gvl, plant, rows_of, simulated
from tests.program_here import run_text

LOST_40 = '[[loss]]\nlist = "list1"\ntelegrams = [40]\n'
LOST_70_TO_72 = '[[loss]]\nlist = "list1"\ntelegrams = [70]\nrun = 3\n'
OVERTAKEN = '[[overtaken]]\nlist = "list1"\ntelegrams = [30]\nby = 4\n'
DUPLICATE = '[[duplicate]]\nlist = "list1"\ntelegrams = [20, 50]\n'
RESTART = '[[restart]]\nnode = "press"\nat = "2s"\noutage = "200ms"\n'
LONG_RESTART = RESTART.replace("200ms", "900ms")
PAUSE = '[[pause]]\nlist = "list1"\nat = "2s"\nby = "{}"\n'
UNSEEN = '[[capture_loss]]\nat = ["2s"]\nlasting = "120ms"\ndrops = 3\n'


def logged(folder: Path, scenario: str, general: str, *, lists: int = 1, only: int = 1) -> list[tuple[int, ...]]:
    """Return the rows of a session of the first lists: ConsistentDataSeries, and the values."""
    simulated(folder, scenario)
    for number in range(1, lists + 1):
        (folder / f"list{number}.gvl").write_text(gvl(number, [f"dwValue{number}"]), encoding="utf-8")
    names = [f"Arp.Plc.Eclr/dwValue{number}" for number in range(1, only + 1)]
    (folder / "c.xml").write_text(configuration(names, general), encoding="utf-8")
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "--force", cwd=folder)
    assert done.returncode == 0, done.stderr
    return [row[2:] for row in rows_of(folder / "log.db")]


@pytest.mark.parametrize(
    ("faults", "behind"),
    [
        ([], []),
        ([LOST_40], [40]),
        ([LOST_40, LOST_70_TO_72], [40, 72]),
        ([OVERTAKEN], [30]),
        ([LOST_40, OVERTAKEN, DUPLICATE], [30, 40]),
        ([DUPLICATE], []),
        ([RESTART], []),
        ([LONG_RESTART], [None]),
        ([PAUSE.format("400ms")], []),
        ([PAUSE.format("600ms")], [40]),
    ],
)
def test_each_cycle_of_a_list(tmp_path: Path, faults: list[str], behind: list[int | None]) -> None:
    rows = logged(tmp_path, plant(*faults), 'taskContext="list1"')
    told = [value for consistent, value in rows if not consistent]
    # How a sender counts on in its data behind a restart is its own matter.
    assert len(told) == len(behind)
    assert all(known is None or known == value for known, value in zip(behind, told, strict=True))


@pytest.mark.parametrize("counter", ["stream", "telegram", "send"])
def test_whatever_the_counter_counts(tmp_path: Path, counter: str) -> None:
    scenario = plant(LOST_40, LOST_70_TO_72, lists=2, counter=counter)
    rows = logged(tmp_path, scenario, 'taskContext="list1"', lists=2, only=2)
    told = [place for place, row in enumerate(rows) if not row[0]]
    # A lost telegram of one list shows in the next one of its node, which is that of the other list.
    assert [rows[place][1] for place in told] == [40, 72]


def test_a_list_of_another_session_is_not_its_loss(tmp_path: Path) -> None:
    lost = LOST_40.replace("list1", "list2")
    rows = logged(tmp_path, plant(lost, lists=2), 'taskContext="list1"', lists=2, only=1)
    assert [row for row in rows if not row[0]] == []


def test_a_sample_behind_a_loss_says_so_once(tmp_path: Path) -> None:
    general = 'samplingInterval="10ms" publishInterval="100ms" bufferCapacity="10"'
    rows = logged(tmp_path, plant(LOST_40), general)
    told = [place for place, row in enumerate(rows) if not row[0]]
    assert len(told) == 1
    assert (rows[told[0] - 1][1], rows[told[0]][1]) == (38, 40)


def test_a_ring_that_is_too_small_loses_all_but_the_last(tmp_path: Path) -> None:
    general = 'samplingInterval="10ms" publishInterval="100ms" bufferCapacity="3"'
    simulated(tmp_path, plant())
    (tmp_path / "list1.gvl").write_text(gvl(1, ["dwValue1"]), encoding="utf-8")
    (tmp_path / "c.xml").write_text(configuration(["a/dwValue1"], general), encoding="utf-8")
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", cwd=tmp_path)
    rows = rows_of(tmp_path / "log.db")
    # In the end, what is in the buffer is written.
    assert {int(row[1][20:23]) % 100 for row in rows[:-3]} == {80, 90, 0}
    assert (rows[0][1][20:23], rows[0][2]) == ("000", 1)
    assert [row[0] for row in rows if not row[2]] == list(range(2, len(rows), 3))
    assert "the ring buffer had no room for " in done.stderr
    assert "bufferCapacity is 3, and up to 10 come in a publishInterval" in done.stderr


def test_files_between_which_nobody_captured(tmp_path: Path) -> None:
    (tmp_path / "list1.gvl").write_text(gvl(1, ["dwValue1"]), encoding="utf-8")
    (tmp_path / "c.xml").write_text(configuration(["a/dwValue1"], 'taskContext="list1"'), encoding="utf-8")
    simulated(tmp_path, plant(), "first.pcap")
    simulated(tmp_path, plant().replace("seed = 3", "start = 2024-01-01T01:00:00+00:00"), "second.pcap")
    done = run_text("datalog", "first.pcap", "second.pcap", "--config", "c.xml", "--gvl", ".", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = rows_of(tmp_path / "log.db")
    assert [row[0] for row in rows if not row[2]] == [101]
    assert len(rows) == 200


def test_what_the_capture_lost_is_lost(tmp_path: Path) -> None:
    simulated(tmp_path, plant(UNSEEN), "plant.pcapng")
    (tmp_path / "list1.gvl").write_text(gvl(1, ["dwValue1"]), encoding="utf-8")
    (tmp_path / "c.xml").write_text(configuration(["a/dwValue1"], 'taskContext="list1"'), encoding="utf-8")
    done = run_text("datalog", "plant.pcapng", "--config", "c.xml", "--gvl", ".", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = rows_of(tmp_path / "log.db")
    # The telegrams that are missing, and nothing else: that some were dropped is said behind all of them.
    assert [row[3] for row in rows if not row[2]] == [43]


def logged_by_tasks(folder: Path, scenario: str, *captures: str) -> list[tuple[int, ...]]:
    """Return the rows of two lists, each in cycles of its own: ConsistentDataSeries, and the values."""
    if scenario:
        simulated(folder, scenario)
    for number in (1, 2):
        (folder / f"list{number}.gvl").write_text(gvl(number, [f"dwValue{number}"]), encoding="utf-8")
    (folder / "nvscope.toml").write_text('[datalogger.tasks]\nT1 = "list1"\nT2 = "list2"\n', encoding="utf-8")
    (folder / "c.xml").write_text(configuration(["a/T1/dwValue1", "a/T2/dwValue2"]), encoding="utf-8")
    done = run_text("datalog", *(captures or ["plant.pcap"]), "--config", "c.xml", "--gvl", ".", cwd=folder)
    assert done.returncode == 0, done.stderr
    return [row[2:] for row in rows_of(folder / "log.db")]


def test_a_loss_is_told_in_the_next_row_of_its_task(tmp_path: Path) -> None:
    rows = logged_by_tasks(tmp_path, plant(LOST_40, LOST_70_TO_72.replace("list1", "list2"), lists=2))
    assert [row for row in rows if not row[0]] == [(0, 40, None), (0, None, 72)]


def test_a_time_in_which_nobody_captured_is_told_by_each_task(tmp_path: Path) -> None:
    simulated(tmp_path, plant(lists=2), "first.pcap")
    simulated(tmp_path, plant(lists=2).replace("seed = 3", "start = 2024-01-01T01:00:00+00:00"), "second.pcap")
    rows = logged_by_tasks(tmp_path, "", "first.pcap", "second.pcap")
    assert [row for row in rows if not row[0]] == [(0, 0, None), (0, None, 0)]


def test_a_lost_cycle_of_the_task_is_a_loss_of_all_that_it_takes(tmp_path: Path) -> None:
    """A row is missing there, whatever list the variables come from."""
    simulated(tmp_path, plant(LOST_40, lists=2))
    for number in (1, 2):
        (tmp_path / f"list{number}.gvl").write_text(gvl(number, [f"dwValue{number}"]), encoding="utf-8")
    (tmp_path / "c.xml").write_text(configuration(["a/dwValue2"], 'taskContext="list1"'), encoding="utf-8")
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert [row[2:] for row in rows_of(tmp_path / "log.db") if not row[2]] == [(0, 39)]


@pytest.mark.parametrize("counter", ["telegram", "send"])
def test_what_one_counter_lost_may_be_of_any_list_of_its_sender(tmp_path: Path, counter: str) -> None:
    """A lost telegram of one list shows in the next one of the other: the rows of both are behind the loss."""
    rows = logged_by_tasks(tmp_path, plant(LOST_40, LOST_70_TO_72, lists=2, counter=counter))
    shown = [(0, None, place) for place in (69, 70, 71)]
    assert [row for row in rows if not row[0]] == [(0, None, 39), (0, 40, None), *shown, (0, 72, None)]


@pytest.mark.parametrize("counter", ["telegram", "send"])
def test_a_loss_that_shows_in_a_list_of_nobody_is_one(tmp_path: Path, counter: str) -> None:
    """The cycle that is missing in the rows is told in them, and an audit finds nothing that is not."""
    rows = logged(tmp_path, plant(LOST_40, lists=2, counter=counter), 'taskContext="list1"', lists=2)
    assert [row for row in rows if not row[0]] == [(0, 40)]
    done = run_text("audit", "log.db", cwd=tmp_path)
    assert done.returncode == 0, done.stdout
