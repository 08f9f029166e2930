"""A cycle of a list of several telegrams is one row, in whatever order these come."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from nvscope.capture.open import open_sink
from tests.datalogger.plants import configuration, gvl, rows_of
from tests.definition.lists import telegram
from tests.oracle.builders import MILLISECOND, START
from tests.packets import batch_of
from tests.program_here import run_text


def recorded(
    folder: Path, sent: list[tuple[float, int, int, int]], *, on_change: bool = False
) -> tuple[list[tuple[object, ...]], str]:  # fmt: skip
    """Log a list of three telegrams (when in ms, SubIndex, Counter, value) in cycles; return rows, and what is said."""
    names = ["dwA", "dwB", "dwC"]
    defined = gvl(1, names, pack=False)
    if on_change:
        defined = defined.replace("OnChange>False", "OnChange>True")
    (folder / "list1.gvl").write_text(defined)
    (folder / "c.xml").write_text(configuration([f"Arp.Plc.Eclr/{name}" for name in names], 'taskContext="list1"'))
    frames = [
        telegram(
            struct.pack("<I", value), 1, subindex=subindex, counter=counter, ts_ns=START + round(at * MILLISECOND),
            list_id=1,
        )
        for at, subindex, counter, value in sent
    ]  # fmt: skip
    with open_sink(str(folder / "plant.pcap")) as sink:
        sink.write(batch_of(frames))
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", cwd=folder)
    assert done.returncode == 0, done.stderr
    return [row[3:] if row[2] else ("lost before", *row[3:]) for row in rows_of(folder / "log.db")], done.stderr


def logged(folder: Path, sent: list[tuple[float, int, int, int]]) -> list[tuple[object, ...]]:
    """Return the values of rows alone."""
    return recorded(folder, sent)[0]


ORDERS = [(0, 1, 2), (1, 0, 2), (0, 2, 1), (2, 1, 0), (2, 0, 1), (1, 2, 0)]


@pytest.mark.parametrize("order", ORDERS)
def test_telegrams_that_change_places_are_of_one_cycle(order: tuple[int, ...], tmp_path: Path) -> None:
    sent = [
        (50 * cycle + place / 10, subindex, cycle + 1, cycle)
        for cycle in range(20)
        for place, subindex in enumerate(order if cycle % 3 == 1 else (0, 1, 2))
    ]
    assert logged(tmp_path, sent) == [(cycle,) * 3 for cycle in range(20)]


def test_what_is_lost_of_a_cycle_makes_no_other_of_it(tmp_path: Path) -> None:
    sent = [
        (50 * cycle + place / 10, subindex, cycle + 1, cycle)
        for cycle in range(20)
        for place, subindex in enumerate((1, 0, 2))
        if cycle % 5 != 2 or subindex != cycle % 3
    ]
    # Of what is lost, the value of the cycle before stays; the row behind the gap tells of it.
    assert [row[-3:] for row in logged(tmp_path, sent)] == [
        tuple(cycle - (cycle % 5 == 2 and subindex == cycle % 3) for subindex in range(3)) for cycle in range(20)
    ]


@pytest.mark.parametrize(
    ("late_ms", "behind"),
    [(49.95, 4), (50.05, 4), (50.5, 4)],  # in front of what replaces it, behind that, behind the next cycle
)
def test_what_comes_when_the_next_cycle_has_begun_is_in_no_other(late_ms: float, behind: int, tmp_path: Path) -> None:
    sent = [
        (50 * cycle + place / 10 + late_ms * (cycle == 3 and place == 1), place, cycle + 1, cycle)
        for cycle in range(8)
        for place in range(3)
    ]
    rows, told = recorded(tmp_path, sorted(sent))
    assert (
        "session: 1 telegram came behind newer ones, too late for a row; the first row behind what is missing for that "
        "tells of it." in told
    )
    expected: list[tuple[object, ...]] = [(cycle,) * 3 for cycle in range(8)]
    expected[3] = (3, 2, 3)
    expected[behind] = ("lost before", *expected[behind])
    assert rows == expected


def test_what_comes_of_the_next_cycle_is_not_in_this_one(tmp_path: Path) -> None:
    """Its first telegram is late, and all others come at once with the next."""
    sent = [
        (50 * cycle + place / 10 + 49.85 * (cycle == 3), 2 - place if cycle == 4 else place, cycle + 1, cycle)
        for cycle in range(8)
        for place in range(1 if cycle == 3 else 3)
    ]
    assert [row[-3:] for row in logged(tmp_path, sent)[3:5]] == [(3, 2, 2), (4, 4, 4)]


def test_a_telegram_that_is_sent_alone_on_a_change_begins_no_cycle_that_others_are_late_for(tmp_path: Path) -> None:
    sent = [(50 * cycle + place / 10, place, cycle + 1, cycle) for cycle in range(4) for place in range(3)]
    # One more of the first, and the next cycle: of the others, Counters are one less than its own.
    sent += [(175, 0, 5, 40)]
    sent += [(200 + place / 10, place, 6 - (place > 0), 4) for place in range(3)]
    expected = [*[(cycle,) * 3 for cycle in range(4)], (40, 3, 3), (4, 4, 4)]
    assert recorded(tmp_path, sent, on_change=True)[0] == expected


LATE = {
    "as a whole, in the middle of the next": (
        [(3, 0), (3, 1), (3, 2), (5, 0), (4, 0), (4, 1), (4, 2), (5, 1), (5, 2)],
        [(3, 3, 3), ("lost before", 5, 5, 5), (6, 6, 6)],
    ),
    "as a whole, in part behind the next": (
        [(3, 0), (3, 1), (3, 2), (5, 0), (4, 1), (5, 1), (5, 2), (4, 0), (4, 2)],
        [(3, 3, 3), ("lost before", 5, 5, 5), (6, 6, 6)],
    ),
    "two as a whole": (
        [(3, 0), (3, 1), (3, 2), (6, 0), (4, 0), (5, 0), (4, 1), (4, 2), (5, 1), (5, 2), (6, 1), (6, 2)],
        [(3, 3, 3), ("lost before", 6, 6, 6)],
    ),
    "two, and no whole one between": (
        [(3, 0), (4, 0), (3, 1), (3, 2), (5, 0), (4, 1), (4, 2), (5, 1), (5, 2)],
        [(3, 2, 2), (4, 2, 2), ("lost before", 5, 5, 5), (6, 6, 6)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("first_counter", [1, 65_531])
@pytest.mark.parametrize(("places", "expected"), LATE.values(), ids=LATE)
def test_no_telegram_of_a_cycle_that_is_late_is_in_another(
    tmp_path: Path, places: list[tuple[int, int]], expected: list[tuple[object, ...]], first_counter: int
) -> None:
    order = [(cycle, place) for cycle in range(3) for place in range(3)] + places
    order += [(cycle, place) for cycle in range(max(places)[0] + 1, 9) for place in range(3)]
    sent = [(2 * at, place, (first_counter + cycle) % 65_536, cycle) for at, (cycle, place) in enumerate(order)]
    rows = logged(tmp_path, sent)
    assert rows[:3] == [(cycle,) * 3 for cycle in range(3)]
    assert rows[3 : 3 + len(expected)] == expected
    assert rows[3 + len(expected) :] == [(cycle,) * 3 for cycle in range(9 - len(rows) + 3 + len(expected), 9)]


@pytest.mark.parametrize("restart", [1, 2, 20, 29])
@pytest.mark.parametrize("step", [1, 2, 3])
def test_a_sender_that_counts_anew_is_late_for_nothing(tmp_path: Path, step: int, restart: int) -> None:
    """It may have begun to be captured behind these Counters, or leave some out; its last cycle was torn."""
    counters = [10 + step * cycle for cycle in range(9)]
    order = [(counter, place) for counter in counters for place in range(3)][:-2]
    order += [(restart + step * cycle, place) for cycle in range(9) for place in range(3)]
    sent = [(2 * at, place, counter, at) for at, (counter, place) in enumerate(order)]
    rows, told = recorded(tmp_path, sent)
    assert len(rows) == 18
    assert "too late" not in told
