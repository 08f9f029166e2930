"""Which values come late: by what was usual before each, however they are cut."""

from __future__ import annotations

from itertools import pairwise
from statistics import median_high

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.readings.cadence import USUAL_OF, Cadence
from tests.laws import examples

PERCENT = 150


def by_the_rule(times: list[int]) -> list[bool]:
    lengths = [later - earlier for earlier, later in pairwise(times)]
    late = [False]
    for place, length in enumerate(lengths):
        before = lengths[max(place - USUAL_OF, 0) : place]
        if length < 0 or len(before) < 4:
            late.append(length < 0)
            continue
        usual = median_high(before)
        alike = sum(abs(one - usual) * 4 <= usual for one in before)
        late.append(length * 100 > usual * PERCENT and alike * 3 >= len(before))
    return late


@examples(200)
@given(
    st.lists(st.sampled_from([100, 100, 100, 100, 98, 103, 149, 151, 260, 1_000, -50, 0]), max_size=80),
    st.lists(st.integers(0, 80), max_size=5),
)
def test_late_is_what_the_rule_says_in_any_pieces(lengths: list[int], cuts: list[int]) -> None:
    times = np.cumsum([0, *lengths])
    cadence = Cadence(PERCENT)
    found = [late for piece in np.split(times, sorted(cuts)) for late in cadence.late(piece).tolist()]
    assert found == by_the_rule(times.tolist())
