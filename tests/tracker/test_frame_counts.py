"""What frames add to figures, added up, is the figure; and it does not depend on how they are cut into batches."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.simulate.scenario_file import load_scenario
from nvscope.simulate.simulator import traffic
from nvscope.tracker.frame_counts import STEPS, FrameCounts
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from tests.laws import examples, sizes_in_turn, some
from tests.packets import observed

SCENARIOS = sorted(Path(__file__).parents[1].joinpath("scenarios").rglob("*.toml"))
BUSES = ("error_frames", "bus_off")

Added = dict[str, Counter[int]]


class Sum(FrameCounts):
    """Keeps what every frame adds to each figure."""

    def __init__(self) -> None:
        super().__init__()
        self.added: Added = {}

    def observe(self, told: object) -> None:
        super().observe(told)  # type: ignore[arg-type]
        for parts in (self.own, self.late):
            for figure, (frames, amounts) in parts.items():
                kept = self.added.setdefault(figure, Counter())
                for frame, amount in zip(frames.tolist(), amounts.tolist(), strict=True):
                    kept[frame] += amount


def batches_of(path: Path) -> list[PacketBatch]:
    return list(traffic(load_scenario(str(path))))


def cut(batches: Iterable[PacketBatch], sizes: Iterator[int]) -> Iterator[PacketBatch]:
    for batch in batches:
        begin = 0
        while begin < len(batch):
            size = next(sizes)
            yield batch[begin : begin + size]
            begin += size


@pytest.mark.parametrize("path", some(SCENARIOS), ids=lambda path: path.stem)
def test_what_frames_add_is_the_figure(path: Path) -> None:
    batches, channels = batches_of(path), load_scenario(str(path)).channels
    added = observed(Sum(), batches, channels=channels).added
    summary = summarize(observed(TrackerState(), batches, channels=channels))
    expected: Counter[str] = Counter()
    for entry in summary.lists:
        believed = all(not stream.erratic for stream in entry.streams)
        for figure, value in entry.counters.items():
            if figure in STEPS and (believed or figure not in ("lost", "gaps", "longest_gap", "restarts")):
                expected[figure] = (
                    max(expected[figure], value or 0) if figure == "longest_gap" else expected[figure] + (value or 0)
                )
    for bus in summary.can.buses:
        expected["error_frames"] += bus.errors.count if bus.errors else 0
        expected["bus_off"] += bus.errors.bus_offs if bus.errors else 0
    telegrams = sum(stream.telegrams for entry in summary.lists for stream in entry.streams)
    for figure in STEPS:
        amounts = added.get(figure, Counter()).values()
        told = max(amounts, default=0) if figure == "longest_gap" else sum(amounts)
        # What happens to more than every fourth telegram is not told one by one.
        often = figure in ("duplicates", "overtaken") and 4 * expected[figure] > telegrams
        assert (0 < told <= expected[figure]) if often else told == expected[figure], figure


NODES = ("counter-node-telegram", "counter-node-send", "counter-rare-list", "counter-list", "loss", "restart", "burst")


@examples(100)
@given(st.sampled_from(NODES), sizes_in_turn(20))
def test_the_cut_into_batches_does_not_matter(name: str, sizes: list[int]) -> None:
    path = next(one for one in SCENARIOS if one.stem == name)
    batches = batches_of(path)

    def endless() -> Iterator[int]:
        while True:
            yield from sizes

    whole = observed(Sum(), batches).added
    assert observed(Sum(), list(cut(batches, endless()))).added == whole
