"""Moments in which several senders lose, against a walk from one loss to the next."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nvscope.causes.case import MOMENT_NS
from nvscope.causes.incomplete import _together
from nvscope.causes.losses import Loss
from tests.laws import examples


def walked(losses: list[Loss], senders: list[int]) -> list[list[int]]:
    """Return the rows of losses in windows of a moment with so many senders; windows that overlap are one."""
    found: list[list[int]] = []
    told = -1
    for last, (loss, least) in enumerate(zip(losses, senders, strict=True)):
        window = [place for place in range(last + 1) if loss.due_ns - losses[place].due_ns <= MOMENT_NS]
        if len({losses[place].node for place in window}) < max(least, 2):
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
    losses = [
        Loss(row, node, 0, time_ns, time_ns, 1, is_cyclic=True, may_be_ns=(time_ns, time_ns))
        for row, (part, node, _) in enumerate(drawn)
        for time_ns in [part * MOMENT_NS // parts]
    ]
    senders = [least for *_, least in drawn]
    assert [[loss.row for loss in group] for group in _together(losses, senders)] == walked(losses, senders)
