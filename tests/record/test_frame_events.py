"""The events of a trigger do not depend on how a capture is cut into batches, whatever it asks for."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.project import Project
from nvscope.engine.reading import Reading
from nvscope.engine.ring import FrameRing
from nvscope.engine.run import run
from nvscope.record.frame_events import FrameEvents
from nvscope.simulate.scenario_file import load_scenario
from nvscope.simulate.simulator import traffic
from nvscope.tracker.state import TrackerState
from tests.laws import examples, sizes_in_turn
from tests.packets import Batches

SCENARIOS = Path(__file__).parents[1] / "scenarios"
NAMES = ("acknowledgement-missing", "loss", "restart", "boot-up", "counter-node-telegram", "malformed", "duplicate")
TRIGGERS = (
    "list.lost > 0", "list.missing_acknowledgements > 0", "list.bootup_unanswered > 0", "node.restarts > 0",
    "list.malformed > 0 || list.duplicates > 0", "list.missing_acknowledgements > 0 && nv.index == 7",
    "rose(nv.flags.ack)", "nv.counter - last(nv.counter) > 1", "age(list.lost > 0) > 1s", "held(nv.index == 7, 300ms)",
)  # fmt: skip


@cache
def batches_of(name: str) -> tuple[PacketBatch, ...]:
    return tuple(traffic(load_scenario(str(SCENARIOS / f"{name}.toml"))))


def cut(batches: tuple[PacketBatch, ...], sizes: list[int]) -> Iterator[PacketBatch]:
    number = 0
    for batch in batches:
        begin = 0
        while begin < len(batch):
            size = sizes[number % len(sizes)]
            yield batch[begin : begin + size]
            begin, number = begin + size, number + 1


def events(name: str, trigger: str, sizes: list[int] | None = None) -> list[tuple[int, str]]:
    """Return when the events of a trigger happen, and in which list."""
    whole = batches_of(name)
    ring, found = FrameRing(), []
    events = FrameEvents(
        trigger, Inquiry([], Project()).fields, Reading(),
        lambda frame: next((one.packets for one in ring.recent().pieces(frame, frame + 1)), None),
    )  # fmt: skip
    source = Batches(list(whole) if sizes is None else list(cut(whole, sizes)))
    for told in run(source, Reading(), [TrackerState()]):  # type: ignore[arg-type]
        found += [(event.time_ns, event.name) for event in events.of(told)]
        ring.observe(told)
    return found


@examples(150)
@given(
    st.sampled_from(NAMES),
    st.sampled_from(TRIGGERS),
    sizes_in_turn(10),
)
def test_the_cut_does_not_matter(name: str, trigger: str, sizes: list[int]) -> None:
    assert events(name, trigger, sizes) == events(name, trigger)


@pytest.mark.parametrize(
    ("name", "trigger"),
    [
        ("acknowledgement-missing", "list.missing_acknowledgements > 0"),
        ("loss", "list.lost > 0"),
        ("restart", "node.restarts > 0"),
        ("boot-up", "list.bootup_unanswered > 0"),
        ("malformed", "list.malformed > 0 || list.duplicates > 0"),
    ],
)
def test_there_are_some(name: str, trigger: str) -> None:
    assert events(name, trigger)
