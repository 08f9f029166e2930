"""Lists of several telegrams that are sent on events, as fast as these come: each row is of one cycle."""

from __future__ import annotations

import random
import re
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.datalogger.drawn_cycles import EDGE, Cycles, Telegram
from tests.datalogger.drawn_plants import START_NS
from tests.datalogger.oracle_files import Recorder
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import files_of, record_in_batches, told
from tests.datalogger.test_late_telegrams import logged
from tests.laws import examples

COUNTS = ["cycles", "telegrams"]
SEEDS = st.integers(0, 1_000_000)


def drawn_events(seed: int, counts: str) -> Cycles:
    """Draw cycles of a list without an interval, some of whose telegrams are lost."""
    rng = random.Random(seed)
    parts, lost = rng.randint(2, 4), rng.choice([0.01, 0.03])
    shortest, longest = rng.choice([(2, 9), (8, 20), (30, 60)])
    now, sent = START_NS, list[Telegram]()
    for cycle in range(80):
        now += rng.randint(shortest * MS, longest * MS)
        for part in range(parts):
            counter = 500 + (cycle if counts == "cycles" else len(sent))
            sent.append(Telegram(cycle, part, now + part * MS // 10, counter, number=len(sent)))
    came = [one for one in sent if one.cycle < EDGE or rng.random() >= lost]
    return Cycles(parts, 0, came, [], counts)


def may_be_one(cycles: Cycles) -> bool:
    """Tell whether parts of two cycles may be one: others may have been sent between, which are counted, too."""
    if cycles.counts == "cycles":
        return False
    neighbours = pairwise(cycles.telegrams)
    return any(later.cycle > earlier.cycle and later.part > earlier.part for earlier, later in neighbours)


@given(SEEDS, st.sampled_from(COUNTS))
@examples(200)
def test_a_loss_moves_no_telegram_into_the_row_of_another_cycle(seed: int, counts: str) -> None:
    """What comes within 10 ms may be of one cycle: Counters tell that it is not."""
    cycles = drawn_events(seed, counts)
    assume(not may_be_one(cycles))
    with TemporaryDirectory() as name:
        expected = [(time_ns // 100 * 100, *others) for time_ns, *others in cycles.rows()]
        assert logged(Path(name), cycles) == expected, cycles


@given(SEEDS, st.sampled_from(COUNTS), st.sampled_from([1, 2, 3, 7, 100_000]))
@examples(100)
def test_rows_are_those_of_the_rules_in_any_batches(seed: int, counts: str, packets: int) -> None:
    plant = drawn_events(seed, counts).plant()
    with TemporaryDirectory() as name:
        folder = Path(name)
        rows = Recorder(plant.session, plant.lists, folder).take(plant.packets)
        record_in_batches(folder / "plant", plant.write(folder / "plant"), plant, packets)
        assert told(files_of(folder / "plant" / "log.db")) == told(rows)


@pytest.mark.parametrize(("came", "rows"), [
    # Cycle 1 lacks its end, cycle 2 its begin.
    ("0.0:5 0.1:5 1.0:6 2.1:7 3.0:8 3.1:8", ["0 0", "1 0", "1 2", "3 3"]),
    # The other way round, of a sender that counts each telegram.
    ("0.0:5 0.1:6 1.1:8 2.0:9 3.0:11 3.1:12", ["0 0", "0 1", "2 1", "3 3"]),
])  # fmt: skip
def test_two_torn_cycles_make_two_rows(tmp_path: Path, came: str, rows: list[str]) -> None:
    """``came`` are telegrams, each with its cycle, its part and its Counter."""
    telegrams = []
    for number, one in enumerate(came.split()):
        cycle, part, counter = map(int, re.split("[.:]", one))
        telegrams.append(Telegram(cycle, part, START_NS + (2 * cycle + part) * MS, counter, number=number))
    found = logged(tmp_path, Cycles(2, 0, telegrams, []))
    assert [" ".join(map(str, values)) for *_, values in found] == rows
