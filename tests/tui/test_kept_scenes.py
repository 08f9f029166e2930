"""The looks that are kept to go back in time: of all ages, within a budget that is about what they take."""

from __future__ import annotations

import gc
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene, scenes_by_second
from nvscope.tui.kept_scenes import KeptScenes
from nvscope.tui.look import STRIP_NS
from nvscope.tui.table_view import LONGEST_STRIP
from tests.records import replace

CAPTURES = Path(__file__).parents[2] / "captures"
PLANT = str(CAPTURES / "plant.pcapng.gz")
S_NS = 1_000_000_000


@cache
def scenes(path: str) -> tuple[Scene, ...]:
    return tuple(scenes_by_second(Inquiry([path])))


def at(scene: Scene, time_ns: int) -> Scene:
    """Return a scene as if it were of another time."""
    summary = scene.snapshot.summary
    capture = replace(summary.capture, clock_ns=time_ns)
    return replace(scene, snapshot=replace(scene.snapshot, summary=replace(summary, capture=capture)))


def size_of(scene: Scene) -> int:
    """Return how many bytes a scene has that nobody else has."""
    seen, found, total = {id(scene.inquiry)}, [scene], 0
    while found:
        value: Any = found.pop()
        if id(value) in seen or isinstance(value, type) or callable(value):
            continue
        seen.add(id(value))
        total += sys.getsizeof(value)
        found += [value.base] if isinstance(value, np.ndarray) and value.base is not None else gc.get_referents(value)
    return total


def test_the_budget_is_about_what_they_take() -> None:
    budget = 1 << 20
    kept = KeptScenes(budget)
    for number in range(60):
        kept.add(at(scenes(PLANT)[-1], number * S_NS))
    assert kept.first_ns == 0
    assert 5 < len(kept) < 60
    each = size_of(kept.at(59 * S_NS) or scenes(PLANT)[-1])
    assert budget // 2 < each * len(kept) < budget * 3 // 2


@given(st.integers(20, 400), st.integers(10, 40))
def test_those_of_old_are_fewer_and_those_of_now_are_all_there(seconds: int, room: int) -> None:
    scene = scenes(PLANT)[0]
    one = KeptScenes()
    one.add(scene)
    kept = KeptScenes(room * one.size_bytes)
    for number in range(seconds):
        kept.add(at(scene, number * S_NS))
    times = [time_ns // S_NS for time_ns in kept.times_ns]
    assert len(times) == min(seconds, room)
    assert times[0] == 0
    assert times[-2:] == [seconds - 2, seconds - 1]
    # Wherever one goes back to, there is one that is not much older than what was asked for.
    for asked in range(seconds):
        shown = kept.at(asked * S_NS)
        assert shown is not None
        assert shown.at_ns is not None
        late = asked - shown.at_ns // S_NS
        assert 0 <= late <= 8 * (seconds - asked) * max(np.log2(seconds), 1) // room + 1


def test_a_scene_that_has_no_room_is_not_kept() -> None:
    kept = KeptScenes(1000)
    kept.add(scenes(PLANT)[-1])
    assert kept.at(0) is None
    assert kept.first_ns is None


def test_scenes_of_one_second_are_one() -> None:
    kept = KeptScenes()
    for time_ns in (0, S_NS // 2, S_NS, S_NS + 1, 0):
        kept.add(at(scenes(PLANT)[-1], time_ns))
    assert kept.times_ns == [0, S_NS, 0]  # a clock that was set back


@pytest.mark.parametrize("path", [PLANT, str(CAPTURES / "can" / "press.log")])
def test_strips_of_what_is_past_are_what_they_were(path: str) -> None:
    for scene in scenes(path):
        kept = KeptScenes()
        kept.add(scene)
        then = kept.at(scene.at_ns or 0)
        if then is None or scene.chronicle is None:
            continue
        assert then.chronicle is not None
        keys = list(scene.chronicle.numbers)
        for cells in (1, 7, 10, 33, LONGEST_STRIP):
            assert then.chronicle.strips(keys, cells) == scene.chronicle.last(STRIP_NS).strips(keys, cells)
        assert not len(then.recent)
