"""Spans of any length arrive whole and touch nothing beside them."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.spans import copy_spans, stretches

_lengths = st.one_of(st.integers(0, 70), st.sampled_from((127, 128, 255, 256, 511, 512, 513, 1023, 1024, 1500, 5000)))


@given(lengths=st.lists(_lengths, max_size=30), gaps=st.lists(st.integers(0, 3), min_size=60, max_size=60))
def test_spans_are_copied_exactly(lengths: list[int], gaps: list[int]) -> None:
    count = len(lengths)
    length = np.array(lengths, np.int64)
    source_at = np.cumsum(length + gaps[:count]) - length
    target_at = np.cumsum(length + gaps[30 : 30 + count]) - length
    total = sum(lengths) + sum(gaps)
    source = np.random.default_rng(count).integers(0, 255, total, np.uint8)
    target = np.full(total, 255, np.uint8)
    expected = target.copy()
    for at, begin, size in zip(target_at, source_at, lengths, strict=True):
        expected[at : at + size] = source[begin : begin + size]
    copy_spans(target, target_at, source, source_at, length)
    assert np.array_equal(target, expected)


@given(lengths=st.lists(st.integers(0, 50), max_size=30), rows=st.integers(1, 10), size=st.integers(0, 100))
def test_stretches_cover_all_rows_within_the_limits(lengths: list[int], rows: int, size: int) -> None:
    slices = list(stretches(np.array(lengths, np.int64), rows, size))
    assert [n for each in slices for n in range(each.start, each.stop)] == list(range(len(lengths)))
    for each in slices:
        assert 1 <= each.stop - each.start <= rows
        assert each.stop - each.start == 1 or sum(lengths[each]) <= size
