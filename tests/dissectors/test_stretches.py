"""Stretches that are copied one behind the other are the bytes of their buffer, whatever their lengths."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors import stretches
from dissectors.stretches import copy_stretches, together
from tests.laws import examples

_SIZES = st.lists(st.one_of(st.integers(0, 9), st.integers(0, 700), st.sampled_from([191, 192, 193, 384, 9000])))


@given(sizes=_SIZES, rest=st.integers(0, 400), seed=st.integers(0, 99), at_a_time=st.sampled_from([1, 500, 1 << 20]))
@examples(300)
def test_stretches_are_copied_to_their_places(sizes: list[int], rest: int, seed: int, at_a_time: int) -> None:
    chance = random.Random(seed)
    data = chance.randbytes(max(sizes, default=0) + rest)
    starts = [chance.randint(0, len(data) - size) for size in sizes]
    gaps = [chance.choice([0, 0, 3]) for _ in sizes]
    at = [sum(sizes[:place]) + sum(gaps[: place + 1]) for place in range(len(sizes))]
    into = np.zeros(sum(sizes) + sum(gaps), np.uint8)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stretches, "_BYTES_AT_A_TIME", at_a_time)
        columns = (np.array(column, np.int64) for column in (starts, sizes, at))
        copy_stretches(np.frombuffer(data, np.uint8), *columns, into)
    for begin, size, place in zip(starts, sizes, at, strict=True):
        assert into[place : place + size].tobytes() == data[begin : begin + size]


@pytest.mark.parametrize(
    ("start", "size", "at"), [(-1, 5, 0), (0, 5, -1), (98, 3, 0), (0, 5, 96), (0, 101, 0), (500, 1, 0)]
)
def test_a_stretch_that_is_not_within_its_buffer_is_an_error(start: int, size: int, at: int) -> None:
    into = np.zeros(100, np.uint8)
    with pytest.raises(IndexError):
        copy_stretches(np.ones(100, np.uint8), *(np.array([one]) for one in (start, size, at)), into)
    assert not into.any()


def test_nothing_is_copied_of_no_stretches() -> None:
    none = np.empty(0, np.int64)
    copy_stretches(np.empty(0, np.uint8), none, none, none, np.empty(0, np.uint8))
    assert not together([]).copied().nbytes
