"""UsualRows against a dict: what is found is right, and the first row of a slot keeps it."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.usual import WORDS, UsualRows

TELLING = 3, 4, 6
WORD = st.one_of(st.integers(0, 3), st.integers(0, 2**64 - 1), st.sampled_from([1 << 63, 1 << 32, 2**64 - 1]))
ROWS = st.lists(st.tuples(*[WORD] * WORDS), min_size=1, max_size=40, unique=True)


@given(ROWS, st.data())
def test_rows_are_found_by_all_their_words(rows: list[tuple[int, ...]], data: st.DataObject) -> None:
    known = data.draw(st.lists(st.sampled_from(rows), unique=True))
    table = UsualRows(TELLING)
    for cut in (slice(0, len(known) // 2), slice(len(known) // 2, None)):
        table.add(np.array(known[cut], np.uint64).reshape(-1, WORDS), np.arange(len(known))[cut])
    for row, number in zip(rows, table.find(np.array(rows, np.uint64)).tolist(), strict=True):
        assert number == -1 or known[number] == row
    if known:
        assert table.find(np.array(known[:1], np.uint64)).tolist() == [0]


def test_rows_that_differ_in_other_words_than_the_telling_ones_share_a_slot_which_the_first_keeps() -> None:
    rows = np.zeros((3, WORDS), np.uint64)
    rows[:, 0] = 1, 2, 3
    table = UsualRows(TELLING)
    table.add(rows[:2], np.array([7, 8]))
    table.add(rows[2:], np.array([9]))
    assert table.find(rows).tolist() == [7, -1, -1]


def test_nearly_all_of_many_rows_have_a_slot_of_their_own() -> None:
    rows = np.zeros((300, WORDS), np.uint64)
    for word in TELLING:
        rows[100 * TELLING.index(word) :][:100, word] = np.arange(1, 101, dtype=np.uint64) << np.uint64(32)
    table = UsualRows(TELLING)
    table.add(rows, np.arange(300))
    assert np.count_nonzero(table.find(rows) >= 0) > 200
