"""Shapes of rows: alike where the same columns have a value."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.datalogger.row_shapes import RowShapes


@given(st.lists(st.lists(st.booleans(), min_size=7, max_size=7), min_size=1, max_size=40))
def test_rows_have_the_same_shape_where_the_same_columns_have_a_value(rows: list[list[bool]]) -> None:
    filled = np.array(rows, np.bool_).T
    shapes = RowShapes(len(filled)).of(len(rows), enumerate(filled)).tolist()
    for row, shape in zip(rows, shapes, strict=True):
        assert [other for other, own in zip(rows, shapes, strict=True) if own == shape] == [row] * rows.count(row)


def test_columns_without_any_value_may_be_left_out() -> None:
    filled = np.array([[True, False], [False, False], [True, True]], np.bool_)
    shapes = RowShapes(3)
    some = [(column, filled[column]) for column in (2, 0)]
    assert shapes.of(2, some).tolist() == shapes.of(2, enumerate(filled)).tolist()


def test_no_two_of_all_shapes_of_many_columns_are_the_same() -> None:
    columns = 996
    filled = np.concatenate([np.eye(columns, dtype=np.bool_), np.tri(columns, dtype=np.bool_)[1:]])
    shapes = RowShapes(columns).of(len(filled), enumerate(filled.T))
    assert len(set(shapes.tolist())) == len(filled)
