"""How busy a bus is: in the busiest window, by the time that frames take at the bit rates of the bus."""

from __future__ import annotations

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.check.checks.buses import Window, _offer
from tests.laws import examples

WINDOWS = st.lists(st.tuples(st.integers(0, 60), st.integers(0, 60)), min_size=1, max_size=40)


@given(bits=WINDOWS)
@examples(300)
def test_the_busiest_window_is_kept_whatever_the_bit_rates_are(bits: list[tuple[int, int]]) -> None:
    kept: list[Window] = []
    for place, (nominal, fast) in enumerate(bits):
        _offer(kept, Window(nominal, fast, place, place))
    for slow_us, fast_us in product((1, 2, 5), repeat=2):
        longest = max(nominal * slow_us + fast * fast_us for nominal, fast in bits)
        found = [one.bits * slow_us + one.fast_bits * fast_us for one in kept]
        assert max(found) == longest
    assert len({(one.bits, one.fast_bits) for one in kept}) == len(kept)


@pytest.mark.parametrize("bits", [[(5, 0), (5, 0), (3, 0)], [(1, 9), (9, 1), (1, 9)]])
def test_of_windows_that_are_as_busy_the_first_is_kept(bits: list[tuple[int, int]]) -> None:
    kept: list[Window] = []
    for place, (nominal, fast) in enumerate(bits):
        _offer(kept, Window(nominal, fast, place, place))
    assert [one.frame for one in kept] == sorted(one.frame for one in kept)
    assert {one.frame for one in kept} <= {0, 1}
