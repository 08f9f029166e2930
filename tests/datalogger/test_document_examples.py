"""The examples of the DataLogger's reference, row by row, from telegrams that hold the values of its tables."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from pathlib import Path

import pytest

from tests.datalogger.drawn_plants import START_NS, Plant
from tests.datalogger.oracle import DefinedList, Session
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import files_of, record

TASK_10 = DefinedList("Task10ms", 1, (("VarA", "INT"), ("VarB", "INT")), 10 * MS)
TASK_20 = DefinedList("Task20ms", 2, (("VarC", "INT"),), 20 * MS)

TWO_VARIABLES = [(10, 0, 0), (20, 1, 0), (30, 2, 2), (40, 3, 2), (50, 4, 4), (60, 5, 4)]
"""At which millisecond, VarA, VarB."""


def sent(defined: DefinedList, telegrams: Iterable[tuple[int, ...]], lost: Sequence[int] = ()) -> list[Packet]:
    """Return telegrams: at which millisecond, and the values; those ``lost`` are only counted."""
    return [
        Packet(
            START_NS + at * MS, "192.168.1.10", defined.index, 0, len(values), counter,
            struct.pack(f"<{len(values)}h", *values),
        )
        for counter, (at, *values) in enumerate(telegrams, 1)
        if at not in lost
    ]  # fmt: skip


def recorded(folder: Path, packets: Iterable[Packet], session: Session, task: str = "") -> list[tuple[object, ...]]:
    """Return the rows of a session: at which millisecond, ConsistentDataSeries, and the columns of its variables."""
    in_order = sorted(packets, key=lambda packet: packet.time_ns)
    plant = Plant([TASK_10, TASK_20], in_order, session, task)
    record(folder, plant.write(folder), plant)
    ((_, rows),) = files_of(folder / "log.db").items()
    assert [row.rowid for row in rows] == list(range(1, len(rows) + 1))
    times = [(int(row.timestamp) & ((1 << 62) - 1)) * 100 - 62_135_596_800 * 10**9 - START_NS for row in rows]
    return [(time // MS, row.consistent, *row.columns) for time, row in zip(times, rows, strict=True)]


def first_says_zero(rows: Sequence[tuple[object, ...]]) -> list[tuple[object, ...]]:
    """Return rows of an example as its reference says elsewhere: "The first data series always has the value 0".

    Three of its examples have 1 there, as databases of controllers do, and one has 0. All else of them is equal.
    """
    (at, consistent, *columns), *others = rows
    assert consistent == 1
    return [(at, 0, *columns), *others]


BOTH = {"Task10ms/VarA": (1, "VarA"), "Task10ms/VarB": (1, "VarB")}


@pytest.mark.parametrize("document_style", [False, True])
def test_of_two_variables_of_one_task_all_values_are_stored(tmp_path: Path, *, document_style: bool) -> None:
    """Attribute storeChangesOnly="false"."""
    session = Session(BOTH, task=1, document_style=document_style)
    rows = [
        (10, 1, 0, 0),
        (20, 1, 1, 0),
        (30, 1, 2, 2),
        (40, 1, 3, 2),
        (50, 1, 4, 4),
        (60, 1, 5, 4),
    ]
    expected = first_says_zero(rows) if document_style else rows
    assert recorded(tmp_path / "x", sent(TASK_10, TWO_VARIABLES), session, "Task10ms") == expected


def test_of_two_variables_of_one_task_changes_are_stored_with_the_counters_of_both(tmp_path: Path) -> None:
    """Attribute storeChangesOnly="true"."""
    session = Session(BOTH, task=1, changes_only=True, document_style=True)
    expected = first_says_zero(
        [
            (10, 1, 0, 0, 0, 0),
            (20, 1, 1, 1, None, 0),
            (30, 1, 2, 2, 2, 1),
            (40, 1, 3, 3, None, 1),
            (50, 1, 4, 4, 4, 2),
            (60, 1, 5, 5, None, 2),
        ]
    )
    assert recorded(tmp_path / "x", sent(TASK_10, TWO_VARIABLES), session, "Task10ms") == expected


def test_controllers_store_no_counter_where_nothing_has_changed(tmp_path: Path) -> None:
    session = Session(BOTH, task=1, changes_only=True)
    assert recorded(tmp_path / "x", sent(TASK_10, TWO_VARIABLES), session, "Task10ms") == [
        (10, 1, 0, 0, 0, 0),
        (20, 1, 1, 1, None, None),
        (30, 1, 2, 2, 2, 1),
        (40, 1, 3, 3, None, None),
        (50, 1, 4, 4, 4, 2),
        (60, 1, 5, 5, None, None),
    ]


@pytest.mark.parametrize("document_style", [False, True])
def test_variables_of_different_tasks_have_rows_of_their_own(tmp_path: Path, *, document_style: bool) -> None:
    """Attribute storeChangesOnly="false" and variables from different tasks."""
    names = {"Task10ms/VarA": (1, "VarA"), "Task20ms/VarB": (2, "VarC")}
    session = Session(names, tasks={"Task10ms/VarA": 1, "Task20ms/VarB": 2}, document_style=document_style)
    fast = sent(TASK_10, [(at, value, 0) for value, at in enumerate(range(10, 70, 10))])
    slow = sent(TASK_20, [(21, 1), (41, 2), (61, 3)])
    rows = [
        (10, 1, 0, None),
        (20, 1, 1, None),
        (21, 1, None, 1),
        (30, 1, 2, None),
        (40, 1, 3, None),
        (41, 1, None, 2),
        (50, 1, 4, None),
        (60, 1, 5, None),
        (61, 1, None, 3),
    ]
    expected = first_says_zero(rows) if document_style else rows
    assert recorded(tmp_path / "x", [*fast, *slow], session) == expected


def test_a_gap_is_told_in_the_row_behind_it(tmp_path: Path) -> None:
    """Example from a database with an indicated data gap."""
    telegrams = [(10 * value, value, 0) for value in range(6, 19)]
    session = Session({"VarA": (1, "VarA")}, task=1, document_style=True)
    rows = recorded(tmp_path / "x", sent(TASK_10, telegrams, lost=(140, 150)), session, "Task10ms")
    assert [(consistent, value) for _, consistent, value in rows] == [
        (0, 6),
        (1, 7),
        (1, 8),
        (1, 9),
        (1, 10),
        (1, 11),
        (1, 12),
        (1, 13),
        (0, 16),
        (1, 17),
        (1, 18),
    ]


def test_a_telegram_that_comes_late_is_in_no_row(tmp_path: Path) -> None:
    """What was, stands behind nothing that is: it is lost, as if it had not come."""
    telegrams = sent(TASK_10, [(10 * value, value, 0) for value in range(6, 19)])
    telegrams[5].time_ns += 15 * MS  # 11 comes behind 12
    session = Session({"VarA": (1, "VarA")}, task=1)
    rows = recorded(tmp_path / "x", telegrams, session, "Task10ms")
    assert [value for *_, value in rows] == [6, 7, 8, 9, 10, 12, 13, 14, 15, 16, 17, 18]
    assert [value for _, consistent, value in rows if not consistent] == [12]


def test_a_late_telegram_is_behind_the_gap_that_it_was_missing_in(tmp_path: Path) -> None:
    """8 comes behind the gap of 11: each of them is one."""
    telegrams = sent(TASK_10, [(10 * value, value, 0) for value in range(6, 19)], lost=(110,))
    telegrams[2].time_ns += 45 * MS
    session = Session({"VarA": (1, "VarA")}, task=1)
    rows = recorded(tmp_path / "x", telegrams, session, "Task10ms")
    assert [value for *_, value in rows] == [6, 7, 9, 10, 12, 13, 14, 15, 16, 17, 18]
    assert [value for _, consistent, value in rows if not consistent] == [9, 12]


def test_a_late_telegram_of_another_list_fills_the_gap_of_a_sender_that_counts_all_its_telegrams(
    tmp_path: Path,
) -> None:
    both = [
        Packet(
            START_NS + 10 * number * MS, "192.168.1.10", 1 + number % 2, 0, 2 - number % 2, number,
            struct.pack("<hh", number, 0)[: 4 - 2 * (number % 2)],
        )
        for number in range(1, 31)
    ]  # fmt: skip
    both[10].time_ns += 15 * MS  # number 11, of the list that no variable of the session is in
    session = Session({"VarA": (1, "VarA")}, task=1)
    rows = recorded(tmp_path / "x", both, session, "Task10ms")
    assert [value for *_, value in rows] == list(range(2, 31, 2))
    assert {consistent for _, consistent, _ in rows} == {1}
    del both[10]
    rows = recorded(tmp_path / "y", both, session, "Task10ms")
    assert [value for _, consistent, value in rows if not consistent] == [12]


def test_what_was_lost_while_capturing_is_lost_in_front_of_the_packet_that_says_so(tmp_path: Path) -> None:
    telegrams = sent(TASK_10, [(10 * value, value, 0) for value in range(1, 31)])
    telegrams[7].drops = 3
    session = Session({"VarA": (1, "VarA")}, task=1)
    plant = Plant([TASK_10, TASK_20], telegrams, session, "Task10ms", pcapng=True)
    folder = tmp_path / "x"
    assert "1 row says that something is missing in front of it" in record(folder, plant.write(folder), plant)
    rows = files_of(folder / "log.db")[""]
    assert [row.columns[0] for row in rows if not row.consistent] == [8]


def test_behind_hours_in_which_nobody_captured_the_first_row_of_a_task_says_so_too(tmp_path: Path) -> None:
    telegrams = sent(TASK_10, [(10 * value, value, 0) for value in range(1, 21)])
    for late in telegrams[12:]:
        late.time_ns += 7_200_000 * MS
    session = Session({"VarA": (1, "VarA")}, task=1)
    rows = recorded(tmp_path / "x", telegrams, session, "Task10ms")
    assert [value for _, consistent, value in rows if not consistent] == [13]


def test_cycles_beside_samples_are_not_overwritten_in_the_ring_buffer(tmp_path: Path) -> None:
    names = {"Task10ms/VarA": (1, "VarA"), "Other/VarC": (2, "VarC")}
    session = Session(names, 20 * MS, 100 * MS, 2, tasks={"Task10ms/VarA": 1})
    fast = sent(TASK_10, [(5 + 10 * value, value, 0) for value in range(20)])
    slow = sent(TASK_20, [(1 + 20 * value, value) for value in range(10)])
    rows = recorded(tmp_path / "x", [*fast, *slow], session)
    assert [value for *_, value in rows if value is not None] == list(range(20))
    assert [value for _, _, value, _ in rows if value is not None] == [3, 4, 7, 8]
    assert [time for time, *_ in rows] == sorted(time for time, *_ in rows)
