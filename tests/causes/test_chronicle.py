"""Strips of a chronicle: what they show by definition, however few stretches it is told by."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.causes.chronicle import Chronicle
from nvscope.causes.mark import Mark
from nvscope.tracker.evidence.long_pauses import PauseColumns

END = 1_000
MARKS = st.lists(st.tuples(st.integers(0, 1), st.integers(0, END), st.integers(0, 120), st.integers(2, 6)), max_size=30)
NO_PAUSES = PauseColumns(*[np.empty(0, np.int64)] * 5)


class AlwaysThere:
    """A list with one stream that was never silent."""

    def __init__(self, number: int) -> None:
        self.key = f"list {number}"
        self.streams: list[Any] = [Stream()]


class Stream:
    telegrams, stream, node, subindex = 1, 0, 0, 0
    first_ns, last_ns = 0, END

    class intervals:  # noqa: N801
        nominal, p99 = 2 * END, None


def chronicle_of(drawn: list[tuple[int, int, int, int]]) -> Chronicle:
    rows = sorted((number, since, min(since + length, END), mark) for number, since, length, mark in drawn)
    columns = np.array(rows, np.int64).reshape(-1, 4).T
    lists: Any = {number: AlwaysThere(number) for number in range(2)}
    return Chronicle(0, END, lists, tuple(columns), NO_PAUSES, {})  # type: ignore[arg-type]


def by_definition(drawn: list[tuple[int, int, int, int]], number: int, cells: int) -> list[Mark]:
    edges = [place * END // cells for place in range(cells + 1)]

    def cell(time_ns: int) -> int:
        return min(max(place for place in range(cells + 1) if edges[place] <= time_ns), cells - 1)

    found = [Mark.USUAL] * cells
    for own, since, length, mark in drawn:
        if own == number:
            for place in range(cell(since), cell(min(since + length, END)) + 1):
                found[place] = max(found[place], Mark(mark))
    return found


@given(MARKS, st.integers(1, 60))
def test_a_cell_has_the_worst_mark_that_touches_it(drawn: list[tuple[int, int, int, int]], cells: int) -> None:
    told = chronicle_of(drawn).strips(["list 0", "list 1"], cells)
    assert told == [by_definition(drawn, number, cells) for number in range(2)]


@given(MARKS, st.integers(1, 60), st.integers(0, 59))
def test_an_outline_has_the_same_strips(drawn: list[tuple[int, int, int, int]], cells: int, fewer: int) -> None:
    whole = chronicle_of(drawn)
    outlined = whole.outlined(cells)
    shown = max(cells - fewer, 1)
    assert outlined.strips(["list 0", "list 1"], shown) == whole.strips(["list 0", "list 1"], shown)
    assert len(outlined.marks[0]) <= min(len(drawn), 2 * len(Mark) * (cells + 1))
