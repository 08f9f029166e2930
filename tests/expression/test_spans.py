"""Bytes searched for in many spans at once, against Python's own search in each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.expression.spans import contains
from nvscope.expression.typed_columns import BytesColumn

BYTES = st.one_of(
    st.lists(st.sampled_from([0, 1, 0xFF]), max_size=80).map(bytes),
    st.builds(lambda part, times: part * times, st.binary(min_size=1, max_size=4), st.integers(1, 30)),
)


@given(BYTES, st.data())
def test_spans_contain_what_their_bytes_contain(data: bytes, draw: st.DataObject) -> None:
    places = st.integers(0, len(data))
    bounds = [sorted(pair) for pair in draw.draw(st.lists(st.tuples(places, places), max_size=12))]
    begin, end = sorted(draw.draw(st.tuples(places, places)))
    wanted = draw.draw(st.one_of(st.just(data[begin:end]), BYTES, st.just(data[begin:end] + b"\1")))
    start, stop = (np.array([pair[side] for pair in bounds], np.int64) for side in (0, 1))
    column = BytesColumn(np.frombuffer(data, np.uint8), start, stop)
    assert contains(column, wanted).tolist() == [wanted in data[first:last] for first, last in bounds]


class Counted(np.ndarray[Any, Any]):
    """Bytes that count how many of them are taken."""

    taken = 0

    def __getitem__(self, place: Any) -> Any:
        found = super().__getitem__(place)
        Counted.taken += int(np.size(found))
        return found


@pytest.mark.parametrize("fill", [0, 65])
@pytest.mark.parametrize("size", [20, 200, 1_000])
def test_long_bytes_are_searched_for_without_looking_at_each_of_them_everywhere(size: int, fill: int) -> None:
    rows, width = 50, 1_000
    start = np.arange(rows, dtype=np.int64) * width
    column = BytesColumn(np.full(rows * width, fill, np.uint8).view(Counted), start, start + width)
    for wanted, expected in ((bytes([fill]) * size, True), (bytes([fill]) * (size - 1) + b"\7", False)):
        Counted.taken = 0
        assert contains(column, wanted).tolist() == [expected] * rows
        assert Counted.taken < 20 * rows * width
