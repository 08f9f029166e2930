"""Since: what one state counts from a moment on is what a window that begins then counts, and nothing else changes."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.run import run
from nvscope.tracker.counted import Counted
from nvscope.tracker.since import Since
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.tracker.windows import Windows
from tests.engine.traffic import CHANNELS, reading_of, traffic, with_holes
from tests.laws import examples
from tests.packets import Batches
from tests.tracker.counted_tables import all_figures, named, tables
from tests.tracker.test_windows import watched

_LONG_NS = 1 << 61


@given(st.integers(0, 10_000))
@examples(40)
def test_it_is_the_window_that_begins_then(seed: int) -> None:
    chance, state, plain = random.Random(seed), TrackerState(), TrackerState()
    batches = with_holes(traffic(seed), chance)
    times = sorted(int(one) for batch in batches for one in batch.ts_ns)
    start_ns = chance.choice(times)
    since = Since(state, start_ns)
    for _ in run(since.cut(Batches(batches, CHANNELS)), reading_of(None), [state, since]):
        pass
    # What numbers nodes depends on batches: the other state is told the same ones.
    for _ in run(Since(plain, start_ns).cut(Batches(batches, CHANNELS)), reading_of(None), [plain]):
        pass
    *_, window = watched(Windows(_LONG_NS, start_ns), batches)
    assert since.has_begun
    assert named(since.counted()) == named(window.counted)
    with since.as_of_all():
        assert all_figures(summarize(state)) == all_figures(summarize(plain))
        assert tables(Counted.of(state)) == tables(Counted.of(plain))
    assert named(since.counted()) == named(window.counted)


def test_before_the_moment_nothing_is_counted() -> None:
    state = TrackerState()
    batches = traffic(1)
    since = Since(state, _LONG_NS)
    for _ in run(since.cut(Batches(batches, CHANNELS)), reading_of(None), [state, since]):
        pass
    assert not since.has_begun
    with since.as_of_all(), pytest.raises(ValueError, match="nothing has come"):
        since.counted()
