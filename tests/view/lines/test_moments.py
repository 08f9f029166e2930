"""Times as text, exactly."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.view.lines import moments


@given(st.lists(st.integers(-(2**62) + 1, 2**62 - 1), max_size=20), st.integers(1, 9))
def test_times_are_exact(times: list[int], digits: int) -> None:
    column = np.array(times, np.int64)
    assert [int(text.replace(".", "")) for text in moments.seconds(column)] == times
    epoch = datetime(1970, 1, 1, tzinfo=UTC)
    stamps = [
        (epoch + timedelta(seconds=value // 10**9)).strftime("%Y-%m-%d %H:%M:%S") + f".{value % 10**9:09}"
        for value in times
    ]
    assert moments.iso(column) == [stamp.replace(" ", "T") + "Z" for stamp in stamps]
    assert moments.clock(column, digits, utc=True, date=True) == [stamp[: 20 + digits] for stamp in stamps]
    assert moments.clock(column, digits, utc=True, date=False) == [stamp[11 : 20 + digits] for stamp in stamps]
