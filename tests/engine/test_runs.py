"""Laws of what is done with rows by number."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.runs import distinct, first_of_each, rows_by

_NUMBER = st.one_of(st.integers(-2, 3), st.integers(-(1 << 40), 1 << 40))


_ROWS = st.integers(1, 4).flatmap(
    lambda width: st.lists(st.tuples(*[_NUMBER] * width), max_size=40).map(lambda rows: (width, rows))
)


@given(_ROWS)
def test_rows_by_yields_each_row_of_numbers_rising_and_where_it_is(
    given_rows: tuple[int, list[tuple[int, ...]]],
) -> None:
    width, rows = given_rows
    columns = [np.array([row[place] for row in rows], np.int64) for place in range(width)]
    found = [(place, own.tolist()) for place, own in rows_by(columns)]
    assert found == [(place, [row for row, other in enumerate(rows) if other == place]) for place in sorted(set(rows))]


@given(_ROWS)
def test_each_different_row_of_numbers_stands_first_at_one_place(given_rows: tuple[int, list[tuple[int, ...]]]) -> None:
    width, rows = given_rows
    columns = [np.array([row[place] for row in rows], np.int64) for place in range(width)]
    assert first_of_each(columns).tolist() == sorted(rows.index(row) for row in set(rows))


@given(
    st.sampled_from(["int64", "uint64", "int32", "uint16", "uint8"]).flatmap(
        lambda kind: st.tuples(
            st.just(kind),
            st.lists(
                st.one_of(
                    st.integers(np.iinfo(kind).min, np.iinfo(kind).max),
                    st.integers(np.iinfo(kind).max - 3, np.iinfo(kind).max),
                    st.integers(np.iinfo(kind).min, np.iinfo(kind).min + 3),
                ),
                max_size=40,
            ),
        )
    )
)
def test_different_numbers_are_those_of_a_set_rising_of_the_same_kind(drawn: tuple[str, list[int]]) -> None:
    kind, numbers = drawn
    found = distinct(np.array(numbers, kind))
    assert found.tolist() == sorted(set(numbers))
    assert found.dtype == kind
