"""The rule for counters, line by line, and the law that the bulk walk is the same rule."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.sequence import walk
from nvscope.tracker.steps import Step, walk_one
from tests.laws import in_turn


@pytest.mark.parametrize(
    ("counters", "steps"),
    [
        ([7], [Step.NONE]),
        ([7, 8, 9], [Step.NONE, Step.REGULAR, Step.REGULAR]),
        ([65535, 0], [Step.NONE, Step.REGULAR]),
        ([255, 0], [Step.NONE, Step.REGULAR]),
        ([65534, 0], [Step.NONE, Step.REGULAR]),
        ([65533, 0], [Step.NONE, Step.RESTART]),
        ([65534, 1], [Step.NONE, Step.GAP]),
        ([7, 7], [Step.NONE, Step.SAME]),
        ([7, 9, 8], [Step.NONE, Step.GAP, Step.OVERTAKEN]),
        ([7, 9, 8, 8], [Step.NONE, Step.GAP, Step.OVERTAKEN, Step.LATE]),
        ([7, 8, 7], [Step.NONE, Step.REGULAR, Step.LATE]),
        ([20, 21, 1], [Step.NONE, Step.REGULAR, Step.RESTART]),
        ([65535, 3, 1], [Step.NONE, Step.GAP, Step.OVERTAKEN]),
        ([65535, 3, 1, 1], [Step.NONE, Step.GAP, Step.OVERTAKEN, Step.RESTART]),
        ([100, 32867], [Step.NONE, Step.GAP]),
        ([100, 32868], [Step.NONE, Step.RESTART]),
        ([165, 101], [Step.NONE, Step.LATE]),
        ([166, 101], [Step.NONE, Step.RESTART]),
        ([100, 165, 101], [Step.NONE, Step.GAP, Step.OVERTAKEN]),
        ([100, 166, 101], [Step.NONE, Step.GAP, Step.RESTART]),
    ],
)
def test_rule(counters: list[int], steps: list[Step]) -> None:
    assert walk_one(counters, None, 0)[0] == steps


FAR = st.integers(0, 65535)
NEAR = st.one_of(st.integers(-70, 70), st.integers(-3, 3), st.sampled_from([-64, -65, -63, 64, 65, 32767, 32768]))


@st.composite
def sequences(draw: st.DrawFn) -> list[tuple[list[int], int | None, int]]:
    """Some sequences of counters that keep to one neighbourhood, jump, and pass 0, with what they had before."""
    drawn = []
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.sampled_from([0, 1, 2, 40, 66, 255, 300, 65500, 65534, 65535, 30000]))
        counters = []
        for move in draw(st.lists(st.one_of(st.just(1), NEAR, st.none(), st.just("zero"), st.just("one")), min_size=1)):
            if move is None:
                at = draw(FAR)
            elif isinstance(move, str):
                at = 0 if move == "zero" else 1
            else:
                at = (at + move) % 65536
            counters.append(at)
        current = draw(st.one_of(st.none(), st.just((counters[0] + draw(NEAR)) % 65536)))
        missing = 0 if current is None else draw(st.integers(0, 2**64 - 1))
        drawn.append((counters, current, missing))
    return drawn


def check_same(parts: list[tuple[list[int], int | None, int]]) -> None:
    counter = np.array([c for counters, _, _ in parts for c in counters], np.uint16)
    start = np.cumsum([0] + [len(counters) for counters, _, _ in parts])[:-1]
    bulk = walk(
        counter,
        start,
        np.array([current or 0 for _, current, _ in parts], np.uint16),
        np.array([missing for _, _, missing in parts], np.uint64),
        np.array([current is None for _, current, _ in parts]),
    )
    steps, distances, currents, words = [], [], [], []
    for counters, current, missing in parts:
        step, distance, after, word = walk_one(counters, current, missing)
        steps += step
        distances += distance
        currents.append(after)
        words.append(word)
    assert bulk.step.tolist() == steps
    assert bulk.distance.tolist() == distances
    assert bulk.current.tolist() == currents
    assert bulk.missing.tolist() == words
    assert bulk.irregular.tolist() == [i for i, step in enumerate(steps) if step != Step.REGULAR]


@given(sequences())
def test_bulk_walk_is_the_rule(parts: list[tuple[list[int], int | None, int]]) -> None:
    check_same(parts)


@pytest.mark.parametrize("seed", in_turn(range(60), 0, 4))
def test_bulk_walk_is_the_rule_on_long_interleaved_counters(seed: int) -> None:
    """Several counters in one sequence, close to each other: most places are held, in long chains."""
    random = np.random.default_rng(seed)
    parts: list[tuple[list[int], int | None, int]] = []
    for _ in range(3):
        at = random.integers(0, 65536) + random.integers(0, random.choice([2, 20, 90, 3000]), random.integers(1, 6))
        counters = []
        for _ in range(400):
            stream = random.integers(0, len(at))
            at[stream] += random.choice(
                [1, 1, 1, 1, 1, 2, 0, -1, 5, 70, -80], p=[0.15] * 5 + [0.05] * 3 + [0.04, 0.03, 0.03]
            )
            counters.append(int(at[stream]) % 65536)
        parts.append((counters, None, 0))
    check_same(parts)
