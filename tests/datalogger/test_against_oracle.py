"""Databases of drawn plants hold the rows that the rules give, packet by packet (``oracle.py``)."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.datalogger.drawn_plants import Plant, drawn_plant
from tests.datalogger.oracle import FORMATS
from tests.datalogger.oracle_files import Recorder
from tests.datalogger.oracle_losses import NOBODY_NS, Doubt
from tests.datalogger.recording import (
    Told,
    assert_table_is_as_controllers_have_it,
    files_of,
    record,
    record_in_batches,
    told,
)
from tests.laws import examples
from tests.records import replace

SEEDS = st.integers(0, 100_000)


def expected(plant: Plant, folder: Path) -> Told:
    recorder = Recorder(plant.session, plant.lists, folder)
    try:
        return told(recorder.take(plant.packets))
    except Doubt:
        assume(False)
        raise


@given(SEEDS)
@examples(250)
def test_rows_are_those_of_the_rules(seed: int) -> None:
    plant = drawn_plant(seed)
    with TemporaryDirectory() as name:
        folder = Path(name)
        rows = expected(plant, folder)
        record(folder / "plant", plant.write(folder / "plant"), plant)
        assert told(files_of(folder / "plant" / "log.db")) == rows, seed
        if rows:
            assert_table_is_as_controllers_have_it(folder / "plant" / "log.db", plant.session, plant)


@given(SEEDS, st.sampled_from([1, 2, 7, 30]))
@examples(100)
def test_any_cut_into_batches_gives_the_same_rows(seed: int, packets: int) -> None:
    plant = drawn_plant(seed)
    plant.packets = plant.packets[:120]
    with TemporaryDirectory() as name:
        folder = Path(name)
        rows = expected(plant, folder)
        record_in_batches(folder / "plant", plant.write(folder / "plant"), plant, packets)
        assert told(files_of(folder / "plant" / "log.db")) == rows, seed


@given(SEEDS)
@examples(60)
def test_captures_cut_into_files_give_the_same_rows(seed: int) -> None:
    plant = drawn_plant(seed)
    # Files are put in the order of their times.
    assume(plant.packets == sorted(plant.packets, key=lambda packet: packet.time_ns))
    # Where nobody captured for long between two files, each is of its own: nothing in one is late in the other.
    cuts = [len(plant.packets) * part // 3 for part in (1, 2)]
    assume(all(plant.packets[cut].time_ns - plant.packets[cut - 1].time_ns < NOBODY_NS for cut in cuts))
    with TemporaryDirectory() as name:
        folder = Path(name)
        rows = expected(plant, folder)
        record(folder / "plant", plant.write(folder / "plant", parts=3), plant)
        assert told(files_of(folder / "plant" / "log.db")) == rows, seed


@given(SEEDS)
@examples(60)
def test_a_database_that_is_gone_on_with_has_the_rows_of_both(seed: int) -> None:
    plant = drawn_plant(seed)
    middle = len(plant.packets) // 2
    with TemporaryDirectory() as name:
        folder = Path(name)
        recorder = Recorder(plant.session, plant.lists, folder)
        try:
            recorder.take(plant.packets[:middle])
            rows = told(recorder.take(plant.packets[middle:]))
        except Doubt:
            assume(False)
        first, second = plant.write(folder / "plant", parts=2)
        record(folder / "plant", [first], plant)
        record(folder / "plant", [second], plant, "--append")
        assert told(files_of(folder / "plant" / "log.db")) == rows, seed


def test_plants_show_what_there_is_to_go_wrong() -> None:
    """The laws above are worth something only if what is drawn has everything in it."""
    plants = [drawn_plant(seed) for seed in range(100)]
    sessions = [plant.session for plant in plants]
    for name in ("rollover", "changes_only", "iso", "document_style"):
        assert {getattr(session, name) for session in sessions} == {False, True}
    assert {session.max_files for session in sessions} == {-1, 0, 1, 2, 3}
    assert {session.task is None for session in sessions} == {bool(session.tasks) for session in sessions}
    assert {len(plant.lists) for plant in plants} == {1, 2, 3}
    lists = [one for plant in plants for one in plant.lists]
    assert {one.packed for one in lists} == {one.interval_ns is None for one in lists} == {False, True}
    assert any(len(one.telegrams) > 2 for one in lists)
    assert {packet.drops > 0 for plant in plants for packet in plant.packets} == {False, True}
    kinds = {kind.partition("(")[0] for one in lists for _, kind in one.fields}
    assert kinds == {*FORMATS, "STRING", "WSTRING"}


@pytest.mark.parametrize("changes_only", [False, True])
def test_a_configuration_says_when_values_are_taken_and_not_what_they_are(
    *, changes_only: bool, tmp_path: Path
) -> None:
    """The same packets, sampled ten times as often: each row that both have is the same."""
    plant = drawn_plant(11)
    plant.session = replace(
        plant.session, changes_only=changes_only, sampling_ns=100_000_000, capacity=1000, max_file_size=None,
        document_style=False, task=None, tasks={},
    )  # fmt: skip
    plant.task_name = ""
    rarely = told(files_of_recorded(plant, tmp_path / "rarely"))[""]
    plant.session = replace(plant.session, sampling_ns=10_000_000)
    often = told(files_of_recorded(plant, tmp_path / "often"))[""]
    if not changes_only:
        values = {row[1]: row[3:] for row in often}
        assert rarely
        assert all(values[row[1]] == row[3:] for row in rarely)
    assert len(often) > len(rarely)


def files_of_recorded(plant: Plant, folder: Path) -> dict[str, list]:  # type: ignore[type-arg]
    record(folder, plant.write(folder), plant)
    return files_of(folder / "log.db")
