"""The strip of a table's time: rows that come as usual leave no holes in it, whatever its cells are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.datalogger.audit.time_strip import Mark, TimeStrip, drawn, legend

MS = 1_000_000


def strip_of(times_ms: list[int]) -> TimeStrip:
    strip = TimeStrip()
    strip.take(np.array(times_ms, np.int64) * MS)
    return strip


@given(st.integers(2, 300), st.integers(1, 5_000), st.integers(1, 120))
def test_rows_at_an_interval_leave_no_hole(rows: int, interval_ms: int, cells: int) -> None:
    marks = strip_of([number * interval_ms for number in range(rows)]).cells(cells)
    assert set(marks) == {Mark.ROWS}


@pytest.mark.parametrize("cells", [20, 40, 98])
def test_where_nothing_changed_for_long_nothing_is_drawn(cells: int) -> None:
    times = [*range(0, 3_000, 100), *range(7_000, 10_000, 100)]
    marks = strip_of(times).cells(cells)
    assert len(marks) == cells
    assert marks[0] == marks[-1] == Mark.ROWS
    assert marks[cells // 2] == Mark.NOTHING
    told = drawn(marks, only_changes=True)
    assert "─" in told
    assert len(told.replace("─", " ").split()) == 2
    assert legend(marks, only_changes=True) == ["─ no change"]
    assert legend(marks, only_changes=False) == []


def test_what_else_happened_stays() -> None:
    strip = strip_of(list(range(0, 10_000, 100)))
    strip.mark(Mark.GAP, 4_000 * MS, 4_999 * MS)
    marks = strip.cells(98)
    assert set(marks) == {Mark.ROWS, Mark.GAP}
    assert 9 <= marks.count(Mark.GAP) <= 12
    assert legend(marks, only_changes=True) == ["× rows missing, not told"]
