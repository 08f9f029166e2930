"""When none of several streams was heard: what each of them says, put together second by second."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.causes.silent_spans import SilentSpans, within_ns

END = 30
SPANS = st.tuples(st.integers(0, 3), st.integers(-5, END + 5), st.integers(-5, END + 5))


@given(st.lists(SPANS, max_size=30), st.lists(st.integers(0, 2), max_size=4))
def test_groups_are_silent_where_each_of_their_streams_is(drawn: list[tuple[int, int, int]], group: list[int]) -> None:
    drawn = [one for one in drawn if one[0] < len(group)]
    spans = SilentSpans(*np.array(drawn, np.int64).reshape(-1, 3).T)
    found = spans.of_groups(np.array(group, np.int64), 3, 0, END)
    silent = [
        {at for own, first, last in drawn if own == one for at in range(first, last)} for one in range(len(group))
    ]
    for number in range(3):
        since, until = (column[found.stream == number] for column in (found.since_ns, found.until_ns))
        told = {at for first, last in zip(since.tolist(), until.tolist(), strict=True) for at in range(first, last)}
        streams = (silent[stream] for stream, of in enumerate(group) if of == number)
        assert told == set(range(END)).intersection(*streams)
        assert since.tolist() == sorted(since.tolist())
        assert (since[1:] >= until[:-1]).all()


@given(st.sets(st.integers(0, END), max_size=12), st.sets(st.integers(0, END), min_size=2))
def test_what_lies_between_edges_is_counted_once(borders: set[int], edges: set[int]) -> None:
    rising = sorted(borders)[: len(borders) // 2 * 2]
    since, until = np.array(rising[::2], np.int64), np.array(rising[1::2], np.int64)
    covered = [at for first, last in zip(since.tolist(), until.tolist(), strict=True) for at in range(first, last)]
    edge = sorted(edges)
    found = within_ns(since, until, np.array(edge))
    assert found.tolist() == [sum(first <= at < last for at in covered) for first, last in pairwise(edge)]
