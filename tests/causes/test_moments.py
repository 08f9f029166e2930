"""Moments in which several senders lose, against a walk from one loss to the next."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.causes.gaps import Losses
from nvscope.causes.moments import together
from nvscope.causes.spans import MOMENT_NS
from tests.laws import examples


def walked(losses: list[tuple[int, int]], senders: list[int]) -> list[list[int]]:
    """Return the rows of losses in windows of a moment with so many senders; windows that overlap are one.

    Losses are told by time and node.
    """
    found: list[list[int]] = []
    told = -1
    for last, ((due_ns, _), least) in enumerate(zip(losses, senders, strict=True)):
        window = [place for place in range(last + 1) if due_ns - losses[place][0] <= MOMENT_NS]
        if len({losses[place][1] for place in window}) < max(least, 2):
            continue
        if window[0] > told:
            found.append([])
        found[-1] += [place for place in window if place > told]
        told = last
    return found


@given(st.lists(st.tuples(st.integers(0, 25), st.integers(0, 4), st.integers(0, 3)), max_size=40), st.integers(1, 10))
@examples(200)
def test_moments_are_those_that_a_walk_finds(drawn: list[tuple[int, int, int]], parts: int) -> None:
    drawn.sort(key=lambda one: one[0])
    losses = [(part * MOMENT_NS // parts, node) for part, node, _ in drawn]
    senders = [least for *_, least in drawn]
    due_ns, node = (np.array([one[place] for one in losses], np.int64) for place in (0, 1))
    row, one = np.arange(len(losses)), np.ones(len(losses), np.int64)
    columns = Losses(row, node, 0 * one, due_ns, due_ns, one, one > 0, due_ns, due_ns)
    moments = together(columns, np.array(senders, np.int64))
    found = [moments.place[start:stop].tolist() for start, stop in zip(moments.start, moments.stop, strict=True)]
    assert found == walked(losses, senders)
