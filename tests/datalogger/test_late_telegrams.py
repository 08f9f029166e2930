"""What is lost, late or sent once more: no row has values of the past, and each loss is one 0, in its row."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.datalogger.drawn_cycles import Cycles, Telegram, drawn_cycles
from tests.datalogger.drawn_plants import START_NS
from tests.datalogger.oracle import EPOCH_TICKS, UTC_KIND
from tests.datalogger.oracle_files import Recorder
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import files_of, record_in_batches, rows_in, told
from tests.laws import crossed, examples
from tests.program_here import run

COUNTS = ["cycles", "telegrams", "all lists"]
SEEDS = st.integers(0, 1_000_000)


def logged(folder: Path, cycles: Cycles, packets: int = 100_000) -> list[tuple[int, int, tuple[object, ...]]]:
    """Return the rows that are logged of cycles, read so many packets at a time."""
    plant = cycles.plant()
    record_in_batches(folder, plant.write(folder), plant, packets)
    rows = rows_in(folder / "log.db")
    return [(100 * ((int(row.timestamp) ^ UTC_KIND) - EPOCH_TICKS), row.consistent, row.columns) for row in rows]


def can_be_told(cycles: Cycles) -> bool:
    """Tell whether what is sent once more can be told from a cycle: it is, if nothing newer came before it."""
    newest: Telegram | None = None
    for one in cycles.telegrams:
        if one.is_copy and newest is not None and newest.cycle <= one.cycle and newest.time_ns + MS < one.time_ns:
            return False
        newest = one if newest is None or one.cycle >= newest.cycle else newest
    return True


@given(SEEDS, st.sampled_from(COUNTS))
@examples(600)
def test_rows_are_those_that_are_true(seed: int, counts: str) -> None:
    cycles = drawn_cycles(seed, counts)
    assume(can_be_told(cycles))
    with TemporaryDirectory() as name:
        expected = [(time_ns // 100 * 100, *others) for time_ns, *others in cycles.rows()]
        assert logged(Path(name), cycles) == expected, cycles


@given(SEEDS, st.sampled_from(COUNTS))
@examples(100)
def test_rows_are_those_of_the_rules(seed: int, counts: str) -> None:
    """Also where it cannot be told what is true."""
    plant = drawn_cycles(seed, counts).plant()
    with TemporaryDirectory() as name:
        folder = Path(name)
        rows = Recorder(plant.session, plant.lists, folder).take(plant.packets)
        record_in_batches(folder / "plant", plant.write(folder / "plant"), plant, 100_000)
        assert told(files_of(folder / "plant" / "log.db")) == told(rows)


@given(SEEDS, st.sampled_from(COUNTS), st.sampled_from([1, 2, 3, 7]))
@examples(100)
def test_any_cut_into_batches_gives_the_same_file(seed: int, counts: str, packets: int) -> None:
    cycles = drawn_cycles(seed, counts)
    with TemporaryDirectory() as name:
        logged(Path(name) / "whole", cycles)
        logged(Path(name) / "parts", cycles, packets)
        files = [(Path(name) / folder / "log.db").read_bytes() for folder in ("whole", "parts")]
        assert files[0] == files[1], cycles


CASES = {
    "a whole cycle between two others": "5.0 5.1 5.2 3.0 3.1 3.2",
    "a whole cycle, two later, in the middle of another": "4.0 4.1 4.2 5.0 3.0 3.1 3.2 5.1 5.2",
    "a telegram, two later": "3.0 3.2 4.0 4.1 4.2 5.0 5.1 3.1 5.2",
    "a whole cycle between two others, then one in the middle": (
        "4.0 4.1 4.2 3.0 3.1 3.2 6.0 6.1 5.0 5.1 5.2 6.2 7.0 7.1 7.2"
    ),
    "a telegram behind the gap that the next one is in": "3.0 3.2 4.0 3.1 4.2",
    "a cycle of which a part was in time": "3.0 4.0 3.1 3.2 4.1 4.2",
}


@pytest.mark.parametrize(
    ("part", "counts", "packets"), crossed(list(CASES), ["cycles", "telegrams"], [1, 2, 3, 7, 100_000])
)
def test_a_loss_is_told_once_where_something_late_is_missing(
    tmp_path: Path, part: str, counts: str, packets: int
) -> None:  # fmt: skip
    cycles = placed(CASES[part], counts)
    rows = logged(tmp_path, cycles, packets)
    assert rows == cycles.rows()
    for before, behind in pairwise(cycles.rows()):
        assert all(was <= now for was, now in zip(before[2], behind[2], strict=True))


@pytest.mark.parametrize("counts", ["cycles", "telegrams"])
@pytest.mark.parametrize("part", CASES.values(), ids=CASES)
def test_an_audit_finds_the_losses_and_nothing_else(tmp_path: Path, part: str, counts: str) -> None:
    cycles = placed(part, counts)
    rows = logged(tmp_path, cycles)
    done = run("audit", "log.db", "--json", cwd=tmp_path)
    found = {one["code"]: one["rows"] for one in json.loads(done.stdout)["findings"]}
    assert found == {"NV951": [place + 1 for place, row in enumerate(rows) if not row[1]]}


@pytest.mark.parametrize(("late", "counts", "packets"), crossed([1, 2], ["cycles", "telegrams"], [1, 2, 3, 7, 100_000]))
def test_what_comes_later_than_half_an_interval_is_of_its_cycle_by_its_counter(
    tmp_path: Path, late: int, counts: str, packets: int
) -> None:  # fmt: skip
    telegrams = []
    for number in range(36):
        cycle, part = divmod(number, 3)
        time_ns = START_NS + 20 * MS * cycle + part * MS + 13 * MS * (cycle == 5 and part >= late)
        telegrams.append(Telegram(cycle, part, time_ns, 9 + (cycle if counts == "cycles" else number), number=number))
    cycles = Cycles(3, 20 * MS, telegrams, [], counts)
    assert logged(tmp_path, cycles, packets) == cycles.rows()
    assert {row[1] for row in cycles.rows()} == {1}


@pytest.mark.parametrize("packets", [1, 2, 3, 7, 100_000])
def test_what_is_left_of_a_cycle_is_not_mixed_with_the_next_one_that_it_comes_shortly_before(
    tmp_path: Path, packets: int
) -> None:  # fmt: skip
    telegrams = []
    for number in range(36):
        cycle, part = divmod(number, 3)
        time_ns = START_NS + 20 * MS * cycle + part * MS + 17 * MS * (cycle == 5)
        if cycle != 5 or part == 1:
            telegrams.append(Telegram(cycle, part, time_ns, 9 + number, number=number))
    cycles = Cycles(3, 20 * MS, telegrams, [], "telegrams")
    rows = logged(tmp_path, cycles, packets)
    assert rows == cycles.rows()
    assert [row[1:] for row in rows[4:7]] == [(1, (4, 4, 4)), (0, (4, 5, 4)), (0, (6, 6, 6))]


@pytest.mark.parametrize("packets", [1, 2, 3, 7, 100_000])
def test_what_is_late_of_a_cycle_is_not_mixed_with_the_next_one_though_others_are_sent_between(
    tmp_path: Path, packets: int
) -> None:  # fmt: skip
    telegrams, others = [], []
    for number in range(36):
        cycle, part = divmod(number, 3)
        one = Telegram(cycle, part, START_NS + 20 * MS * cycle + part * MS, 9 + number, number=number)
        if part == 1:
            others.append(one)
        else:
            late_ns = 14 * MS if (cycle, part) == (5, 2) else 0
            telegrams.append(replace(one, part=part // 2, time_ns=one.time_ns + late_ns))
    rows = logged(tmp_path, Cycles(2, 20 * MS, telegrams, [], "all lists", others), packets)
    # Nobody knows that it is not of a cycle of its own.
    assert [row[1:] for row in rows[4:8]] == [(1, (4, 4)), (1, (5, 4)), (1, (5, 5)), (1, (6, 6))]


@pytest.mark.parametrize(
    "part", ["3.0 3.1 3.2 4.0 ~3.1 4.1 4.2", "3.0 3.1 4.0 ~3.1 4.1 4.2", "3.0 3.1 3.2 4.0 4.1 4.2 ~3.1"]
)
@pytest.mark.parametrize("packets", [1, 2, 100_000])
def test_what_is_sent_once_more_is_in_no_later_row(tmp_path: Path, part: str, packets: int) -> None:
    cycles = placed(part)
    assert logged(tmp_path, cycles, packets) == cycles.rows()


def placed(part: str, counts: str = "cycles") -> Cycles:
    """Return cycles whose telegrams come in this order from the third on, as CYCLE.PART, with ``~`` once more.

    Each cycle has its time; what is late comes behind what is in front of it.
    """
    middle = [(one.startswith("~"), *map(int, one.strip("~").split("."))) for one in part.split()]
    until = max(cycle for _, cycle, _ in middle) + 1
    order = [(False, cycle, part) for cycle in range(3) for part in range(3)] + middle
    order += [(False, cycle, part) for cycle in range(until, until + 30) for part in range(3)]
    telegrams, time_ns = [], START_NS
    for is_copy, cycle, number in order:
        time_ns = max(time_ns + MS, START_NS + 20 * MS * cycle)
        sent = 3 * cycle + number
        counter = 100 + (cycle if counts == "cycles" else sent)
        telegrams.append(Telegram(cycle, number, time_ns, counter, is_copy, sent))
    return Cycles(3, 20 * MS, telegrams, [part], counts)
