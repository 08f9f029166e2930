"""Sums of squares of intervals are exact, whichever way they are made."""

from __future__ import annotations

from itertools import chain

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.timing import _LARGE_NS, _LIMB_BITS, _SHORT_NS, _squares, _squares_of_short
from tests.laws import examples

RUNS = st.lists(st.lists(st.integers(0, _LARGE_NS - 1), min_size=1, max_size=20), min_size=1, max_size=5)


@given(RUNS)
@examples(100)
def test_limbs_are_the_sum_of_squares(runs: list[list[int]]) -> None:
    start = np.cumsum([0, *map(len, runs[:-1])])
    ways = [(_squares, runs), (_squares_of_short, [[size % _SHORT_NS for size in run] for run in runs])]
    for squares, sizes in ways:
        limbs = zip(*(part.tolist() for part in squares(np.array([*chain(*sizes)]), start)), strict=True)
        found = [low + (middle << _LIMB_BITS) + (high << 2 * _LIMB_BITS) for low, middle, high in limbs]
        assert found == [sum(size * size for size in run) for run in sizes]


def test_no_limb_overflows_in_the_largest_batch() -> None:
    for squares, size in ((_squares, _LARGE_NS - 1), (_squares_of_short, _SHORT_NS - 1)):
        (low,), (middle,), (high,) = (part.tolist() for part in squares(np.full(1 << 17, size), np.zeros(1, np.int64)))
        assert low + (middle << _LIMB_BITS) + (high << 2 * _LIMB_BITS) == size * size << 17
