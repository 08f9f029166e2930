"""A capture that is played: each packet when it is due, by whatever rate; and where somebody wants it to be."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from itertools import pairwise
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.played import Played
from nvscope.capture.player import MOST_RATE, Player
from nvscope.capture.source import Source
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.packets import Batches, batch_of

MS = 1_000_000
TICK_MS = 50


class Clock:
    """A clock that goes on where somebody sleeps, and a little whenever it is looked at."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.looks = 0

    def __call__(self) -> float:
        self.looks += 1
        assert self.looks < 100_000, "it looks at the clock for ever"
        return self.now_s

    def sleep(self, _: threading.Condition, time_s: float) -> None:
        assert time_s > 0
        self.now_s += time_s


def capture(times_ns: Sequence[int], cuts: Sequence[int] = ()) -> Source:
    """Return packets at some times, in batches cut at some of them."""
    edges = sorted({0, len(times_ns), *(cut for cut in cuts if cut < len(times_ns))})
    batches = [
        batch_of([Frame(time_ns, 1, b"x", 1) for time_ns in times_ns[begin:end]]) for begin, end in pairwise(edges)
    ]
    return cast(Source, Batches(batches))


def played(player: Player, clock: Clock, times_ns: Sequence[int], cuts: Sequence[int] = ()) -> list[tuple[int, float]]:
    """Return when each packet passed, in seconds since the beginning, with its time; all that a source has once."""
    began_s, passed = clock.now_s, []
    for batch in Played(capture(times_ns, cuts), player):
        passed += [(time_ns, clock.now_s - began_s) for time_ns in batch.ts_ns.tolist()]
    return passed


steps_ns = st.lists(st.integers(0, 3000 * MS), min_size=1, max_size=40)


@examples(200)
@given(steps_ns, st.lists(st.integers(0, 40)), st.sampled_from([0.1, 0.5, 1.0, 2.0, 20.0, 100.0]))
def test_each_packet_passes_when_it_is_due(steps: list[int], cuts: list[int], rate: float) -> None:
    times = [10**18 + int(time_ns) for time_ns in np.cumsum(steps)]
    clock = Clock()
    player = Player(rate, clock=clock, sleep=clock.sleep)
    passed = played(player, clock, times, cuts)
    assert [time_ns for time_ns, _ in passed] == times
    for time_ns, at_s in passed:
        due_s = (time_ns - times[0]) / 1e9 / rate
        assert due_s - 1e-3 <= at_s <= due_s + 1e-3
    assert player.place.at_end
    assert player.place.frames == len(times)


def test_time_passes_where_nothing_comes() -> None:
    clock = Clock()
    player = Player(2.0, clock=clock, sleep=clock.sleep)
    told = []
    for batch in Played(capture([0, 1000 * MS]), player):
        told.append((len(batch), batch.until_ns))
    silences = [until_ns for packets, until_ns in told if not packets]
    assert silences
    assert all(until_ns is not None and 0 < until_ns < 1000 * MS for until_ns in silences)
    assert silences == sorted(silences)  # type: ignore[type-var]
    steps = np.diff([0, *silences])  # type: ignore[list-item]
    assert steps.max() <= 2 * 2 * TICK_MS * MS


def test_pauses_are_skipped_where_that_is_wanted() -> None:
    clock = Clock()
    player = Player(1.0, skips_gaps=True, clock=clock, sleep=clock.sleep)
    passed = played(player, clock, [0, 3_600_000 * MS, 3_600_500 * MS])
    assert [at_s for _, at_s in passed] == pytest.approx([0, 1, 1.5], abs=0.01)


def test_a_clock_that_was_set_back_keeps_the_order() -> None:
    clock = Clock()
    player = Player(clock=clock, sleep=clock.sleep)
    times = [5000 * MS, 5100 * MS, 100 * MS, 5200 * MS]
    passed = played(player, clock, times)
    assert [time_ns for time_ns, _ in passed] == times
    assert [at_s for _, at_s in passed] == pytest.approx([0, 0.1, 0.1, 0.2], abs=0.01)


def test_what_is_too_slow_does_not_rush_afterwards() -> None:
    """A look, or a machine that had no time for it, must not make what comes next pass at once."""
    clock = Clock()
    player = Player(clock=clock, sleep=clock.sleep)
    passed, began_s = [], clock.now_s
    for batch in Played(capture([step * 100 * MS for step in range(100)]), player):
        passed += [clock.now_s - began_s] * len(batch)
        if len(passed) == 10 and len(batch):
            clock.now_s += 5
            behind = True
        if len(passed) == 11 and len(batch) and behind:
            assert player.place.is_behind
            behind = False
    assert passed[10] >= 5.9
    assert np.diff(passed[11:]) == pytest.approx(np.full(88, 0.1), abs=0.06)
    assert passed[-1] - passed[10] == pytest.approx(8.9, abs=0.1)


def test_between_a_and_b_it_is_repeated() -> None:
    clock = Clock()
    player = Player(clock=clock, sleep=clock.sleep)
    passed: list[int] = []
    player.repeat(500 * MS, 900 * MS)
    times = [step * 100 * MS for step in range(20)]
    while player.turns < 3:
        for batch in Played(capture(times, [7, 13]), player):
            passed += (batch.ts_ns // (100 * MS)).tolist()
            if player.turns == 2 and player.place.frames > 6:
                player.repeat(None, None)
        if player.place.at_end:
            break
    # What is before A passes at once each time: it is what is known by then.
    assert passed == [*range(10), *range(10), *range(20)]
    assert player.turns == 2


def test_the_whole_is_repeated_until_nobody_wants_that() -> None:
    clock = Clock()
    player = Player(loops=True, clock=clock, sleep=clock.sleep)
    passed = 0
    while not player.place.at_end:
        for batch in Played(capture([0, 100 * MS, 200 * MS]), player):
            passed += len(batch)
            if player.turns == 2:
                player.loop(False)
    assert passed == 9


class Stage:
    """Twenty packets that a thread plays, as the screen does."""

    def __init__(self) -> None:
        self.times = [step * 100 * MS for step in range(20)]
        self.player = Player(rate=MOST_RATE)
        self.player.pause(True)
        self._stopped = False
        self._thread = threading.Thread(target=self._play, daemon=True)
        self._thread.start()

    def _play(self) -> None:
        turns = -1
        while not self._stopped:
            if turns == self.player.turns:
                self.player.wait_for_change(self.player.changes, 0.01)
                continue
            turns = self.player.turns
            for _ in Played(capture(self.times, [7, 13]), self.player):
                pass

    def stands(self) -> tuple[int, bool]:
        """Return how many packets have passed where it stands, and whether that is the end."""
        for _ in range(3000):
            changes, place = self.player.changes, self.player.place
            if not place.is_going and (place.paused or place.at_end):
                return place.frames, place.at_end
            self.player.wait_for_change(changes, 0.01)
        raise AssertionError("it never stands")

    def end(self) -> None:
        self._stopped = True
        self.player.stop()
        self._thread.join(10)
        assert not self._thread.is_alive()


wishes = st.lists(
    st.one_of(
        st.tuples(st.just("step"), st.sampled_from([1, -1, 3, -4, 30])),
        st.tuples(st.just("go"), st.integers(-100, 2300)),
    ),
    max_size=12,
)


@examples(60)
@given(wishes)
def test_it_stands_where_somebody_wants_it(wanted: list[tuple[str, int]]) -> None:
    stage = Stage()
    try:
        frames = 0
        for what, number in wanted:
            if what == "step":
                stage.player.step(number)
                frames = min(max(frames + number, 1), 20)
            else:
                stage.player.go(number * MS)
                frames = sum(time_ns <= number * MS for time_ns in stage.times)
            found, _ = stage.stands()
            assert found == frames
    finally:
        stage.end()
