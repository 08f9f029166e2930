"""KeyTable against a dict: numbers are those of first appearance, whatever the keys and the cuts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.keys import KeyTable

WORD = st.one_of(st.integers(0, 3), st.integers(0, 2**64 - 1), st.sampled_from([1 << 63, 1 << 32, 2**64 - 1]))


@st.composite
def columns(draw: st.DrawFn) -> list[tuple[int, ...]]:
    """Keys of one width, some of which come again."""
    width = draw(st.integers(1, 6))
    pool = draw(st.lists(st.tuples(*[WORD] * width), min_size=1, max_size=30))
    return draw(st.lists(st.sampled_from(pool), max_size=80))


def words(keys: list[tuple[int, ...]], width: int) -> list[np.ndarray]:
    return [np.array([key[word] for key in keys], np.uint64) for word in range(width)]


@given(columns(), st.integers(1, 80))
def test_numbers_are_given_in_order_of_first_appearance(keys: list[tuple[int, ...]], cut: int) -> None:
    width = len(keys[0]) if keys else 1
    known: dict[tuple[int, ...], int] = {}
    expected = [known.setdefault(key, len(known)) for key in keys]
    table = KeyTable(width)
    numbers: list[int] = []
    for begin in range(0, len(keys), cut):
        numbers += table.numbers(*words(keys[begin : begin + cut], width)).tolist()
    assert numbers == expected
    assert len(table) == len(known)
    assert table.find(*words(list(known), width)).tolist() == list(known.values())


def test_keys_that_are_not_there_are_not_found() -> None:
    table = KeyTable(2)
    high = np.arange(5000, dtype=np.uint64)
    table.numbers(high, high)
    assert (table.find(high, high + np.uint64(1)) == -1).all()


@pytest.mark.parametrize("shift", [0, 20, 32, 44, 51])
def test_many_keys_that_differ_in_few_bits(shift: int) -> None:
    """More keys than the table starts with room for, of a kind that a poor hash sends to the same places."""
    bits = np.arange(1 << 12, dtype=np.uint64) << np.uint64(shift)
    table = KeyTable(3)
    nothing = np.zeros_like(bits)
    assert (table.numbers(nothing, bits, bits) == np.arange(len(bits))).all()
    assert (table.numbers(nothing, bits[::-1], bits[::-1]) == np.arange(len(bits))[::-1]).all()


@given(columns(), st.integers(1, 80))
def test_keys_rise_by_their_first_word_however_they_came(keys: list[tuple[int, ...]], cut: int) -> None:
    width = len(keys[0]) if keys else 1
    table = KeyTable(width)
    for begin in range(0, len(keys), cut):
        table.numbers(*words(keys[begin : begin + cut], width))
        rising = table.rising()
        assert sorted(rising.tolist()) == list(range(len(table)))
        first = table.high[rising]
        assert (first[1:] >= first[:-1]).all()
