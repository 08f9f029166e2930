"""Octets in stretches of data are as many as one counts in each of them."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.visu.counted_octets import count_of

_PARTS = st.sampled_from([b"", b"|", b"||", b"a", b"1|2", b"|" * 254, b"|" * 255, b"|" * 256, b"|" * 600, b"a" * 5000])
_MUCH = b"|ab||" * (1 << 19)


@given(
    st.lists(_PARTS, max_size=12)
    .map(b"".join)
    .flatmap(
        lambda data: st.tuples(
            st.just(data), st.lists(st.tuples(st.integers(0, len(data)), st.integers(0, len(data))), max_size=12)
        )
    )
)
def test_octets_are_counted_in_each_stretch_whatever_the_order_and_the_others(
    drawn: tuple[bytes, list[tuple[int, int]]],
) -> None:
    data, bounds = drawn
    stretches = [(min(one), max(one)) for one in bounds if one[0] != one[1]]
    start, stop = (np.array([one[place] for one in stretches], np.int64) for place in (0, 1))
    found = count_of(ord("|"), np.frombuffer(data, np.uint8), start, stop)
    assert found.tolist() == [data.count(b"|", begin, end) for begin, end in stretches]


@given(st.lists(st.tuples(st.integers(0, 1 << 21), st.integers(1, 1 << 21)), min_size=1, max_size=6))
def test_octets_are_counted_in_long_stretches_of_much_data(drawn: list[tuple[int, int]]) -> None:
    stretches = [(begin, min(begin + size, len(_MUCH))) for begin, size in drawn]
    start, stop = (np.array([one[place] for one in stretches], np.int64) for place in (0, 1))
    found = count_of(ord("|"), np.frombuffer(_MUCH, np.uint8), start, stop)
    assert found.tolist() == [_MUCH.count(b"|", begin, end) for begin, end in stretches]
