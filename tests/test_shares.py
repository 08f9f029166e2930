"""What the quick profile leaves out of tables and cuts, it leaves out of none of their values."""

from __future__ import annotations

from itertools import combinations, pairwise, product

import pytest

from tests import laws
from tests.laws import crossed, cut_sizes, every_other, in_turn


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(laws, "in_full", lambda: False)


@pytest.mark.parametrize("lengths", [(3,), (1, 4), (6, 5), (2, 5), (3, 2, 7), (4, 4, 2), (2, 2, 9), (6, 2, 5)])
def test_of_a_table_each_value_comes_and_each_pair_of_all_axes_but_the_last(lengths: tuple[int, ...]) -> None:
    axes = [range(length) for length in lengths]
    few, whole = crossed(*axes), set(product(*axes))
    assert len(few) == len(set(few)) <= len(whole)
    assert set(few) <= whole
    for place, axis in enumerate(axes):
        assert {row[place] for row in few} == set(axis)
    for first, second in combinations(range(len(axes) - 1), 2):
        assert {(row[first], row[second]) for row in few} == set(product(axes[first], axes[second]))


@pytest.mark.parametrize("packets", [1, 2, 3, 4, 20, 1000])
def test_cuts_go_from_one_at_a_time_to_all_at_once(packets: int) -> None:
    sizes = cut_sizes(packets)
    assert (sizes[0], sizes[-1]) == (1, packets)
    assert all(before < behind <= 3 * before for before, behind in pairwise(sizes))


def test_of_some_sizes_the_first_and_the_last_are_left() -> None:
    assert every_other(1, 2, 3) == [1, 3]
    assert every_other(1, 2, 3, 40) == [1, 3, 40]
    assert every_other(1, 2, 3, 2) == [1, 2, 3]


def test_several_tests_in_turn_leave_nothing_out() -> None:
    assert sorted(one for number in range(3) for one in in_turn(range(20), number, 3)) == list(range(20))
