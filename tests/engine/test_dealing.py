"""Law 8: the state folded in parts, split by the accumulators' keys, and joined is the state folded at once."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition
from nvscope.definition.pdos import Pdos
from nvscope.engine.dealing import SplitBy, deal
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.findings.judge import judge
from nvscope.tracker.figures import figures_of
from nvscope.tracker.parted import PartedState
from nvscope.tracker.state import TrackerState
from nvscope.tracker.subjects import subjects
from nvscope.tracker.summary import summarize
from nvscope.tracker.variables.values import Values
from nvscope.view.documents.variables import variables_document
from tests.engine.traffic import (
    CAN_DEFINITION,
    CAN_LAYOUTS,
    CHANNELS,
    LAYOUTS,
    batches_of,
    can_batches,
    reading_of,
    with_holes,
)  # fmt: skip
from tests.laws import examples, some
from tests.packets import Batches, cut, document_of
from tests.simulate.simulation import project_of, simulated
from tests.tracker.can.bus_traffic import bus_traffic
from tests.tracker.can.test_state import batch

SCENARIOS = sorted((Path(__file__).parents[1] / "scenarios").glob("*.toml"))


def at_once_and_joined(
    batches: Sequence[PacketBatch],
    parts: int,
    reading: Reading,
    layouts: Layouts = LAYOUTS,
    channels: Sequence[str] = CHANNELS,
) -> tuple[TrackerState, TrackerState]:
    """Return a state that was folded at once, and one that was folded in parts, of the same batches."""
    whole = TrackerState(values=Values(layouts), recent=True)
    parted = PartedState(parts, values=lambda: Values(layouts), recent=True)
    for _ in run(Batches(batches, channels), reading, [whole, parted]):
        pass
    return whole, parted.join()


def shown(state: TrackerState, definition: Definition | None = None) -> tuple[Any, ...]:
    """Return all that a state says."""
    assert state.values is not None
    assert state.senders.recent is not None
    recent = state.senders.recent.percentiles((50, 99))
    of_streams = [column.tolist() for column in (recent.stream, recent.count, recent.least_ns, recent.most_ns)]
    percentiles = {percent: column.tolist() for percent, column in recent.at_ns.items()}
    end_ns = state.capture.end_ns
    overdue = judge(state, at_ns=None if end_ns is None else end_ns + 10_000_000_000, definition=definition)
    faults = state.buses.faults
    of_frames = sorted(zip(*faults.keys.words, faults.rows.column("count"), strict=True))
    measured = [
        (one.list, one.node, one.subindex, [figure.read(one.measured) for figure in figures_of(one.of)])
        for one in subjects(summarize(state))
    ]
    variables = variables_document(state, state.values)
    return document_of(state), overdue, of_frames, variables, of_streams, percentiles, measured


@given(st.integers(0, 10_000), st.integers(1, 5), st.sampled_from([None, "nv.index == 7", "frame.number % 3 != 0"]))
@examples(60)
def test_parts_joined_are_the_state_folded_at_once(seed: int, parts: int, expression: str | None) -> None:
    chance = random.Random(seed)
    batches = with_holes(batches_of(seed, chance), chance)
    whole, joined = at_once_and_joined(batches, parts, reading_of(expression))
    assert shown(joined) == shown(whole)


@given(st.integers(0, 10_000), st.integers(2, 5))
@examples(30)
def test_a_joined_state_goes_on_as_if_it_had_been_one(seed: int, parts: int) -> None:
    chance = random.Random(seed)
    batches = with_holes(batches_of(seed, chance), chance)
    begun, rest = batches[: len(batches) // 2], batches[len(batches) // 2 :]
    whole = TrackerState(values=Values(LAYOUTS), recent=True)
    parted = PartedState(parts, values=lambda: Values(LAYOUTS), recent=True)
    joined: TrackerState | None = None
    for number, told in enumerate(run(Batches([*begun, *rest]), reading_of(None), [whole])):
        if number < len(begun):
            parted.observe(told)
            continue
        joined = joined or parted.join()
        joined.observe(told)
    assert shown(joined or parted.join()) == shown(whole)


@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(1, 5))
@examples(40)
def test_channels_joined_are_the_state_folded_at_once(seed: int, parts: int, channels: int) -> None:
    reading = Reading(pdos=Pdos(CAN_DEFINITION).rules())
    chance = random.Random(seed)
    batches = with_holes(can_batches(chance, channels), chance)
    whole, joined = at_once_and_joined(batches, parts, reading, CAN_LAYOUTS)
    assert shown(joined) == shown(whole)


@pytest.mark.parametrize("path", some(SCENARIOS), ids=lambda path: path.stem)
def test_parts_of_scenarios_joined_are_the_state_folded_at_once(path: Path, tmp_path: Path) -> None:
    simulation = simulated(path)
    definition = project_of(simulation.scenario, tmp_path).definition or Definition()
    reading, layouts = Reading(pdos=Pdos(definition).rules()), Layouts(definition)
    whole, joined = at_once_and_joined(simulation.batches, 3, reading, layouts, simulation.channels)
    assert shown(joined, definition) == shown(whole, definition)


@pytest.mark.parametrize("parts", [2, 3])
def test_bit_rates_are_found_of_each_channel(parts: int) -> None:
    rates = [125_000, 500_000, 1_000_000]
    frames = [frame for channel, rate in enumerate(rates) for frame in bus_traffic(rate, 0.8, 600, channel=channel)]
    whole, joined = at_once_and_joined(cut(batch(sorted(frames)), 500), parts, reading_of(None))
    assert [bus["bit_rate"]["nominal"] for bus in shown(whole)[0]["buses"]] == rates
    assert shown(joined) == shown(whole)


@given(st.integers(0, 10_000), st.integers(2, 5), st.sampled_from([SplitBy.LIST, SplitBy.SENDER]))
@examples(30)
def test_every_telegram_is_dealt_to_one_part(seed: int, parts: int, by: SplitBy) -> None:
    batches = batches_of(seed, random.Random(seed))
    for told in run(Batches(batches), reading_of(None), [TrackerState()]):
        dealt = [own for _, own in deal(told, by, parts)]
        assert sum(own.count for own in dealt).tolist() == told.count.tolist()
        for name in ("data", "pdos"):
            packets = [packet for own in dealt for packet in getattr(own.laid, name).packet.tolist()]
            assert sorted(packets) == sorted(getattr(told.laid, name).packet.tolist())


@pytest.mark.parametrize("by", [SplitBy.LIST, SplitBy.SENDER, SplitBy.BUS])
def test_telegrams_are_dealt_to_several_parts(by: SplitBy) -> None:
    busy: set[int] = set()
    for seed in range(20):
        if busy == {0, 1, 2}:
            break
        chance = random.Random(seed)
        for told in run(
            Batches([*batches_of(seed, chance), *can_batches(chance, 3)]), reading_of(None), [TrackerState()]
        ):
            for share, own in deal(told, by, 3):
                if own.can is not None if by is SplitBy.BUS else len(own.laid.data) or len(own.laid.pdos):
                    busy.add(share.part)
    assert busy == {0, 1, 2}
