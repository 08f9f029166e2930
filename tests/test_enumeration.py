"""Several names in a sentence."""

from __future__ import annotations

from nvscope import units
from nvscope.enumeration import first_few, joined

ABCDE = ["a", "b", "c", "d", "e"]


def test_few_names_stand_all_in_a_sentence() -> None:
    assert first_few([]) == ""
    assert first_few(ABCDE[:1]) == "a"
    assert first_few(ABCDE[:3]) == "a, b, c"


def test_of_many_names_the_first_ones_stand_there() -> None:
    assert first_few(ABCDE) == "a, b, c and 2 more"
    assert first_few(ABCDE, 1) == "a and 4 more"
    assert first_few(ABCDE, 2, between="; ") == "a; b and 3 more"


def test_there_may_be_more_than_are_given() -> None:
    assert first_few(ABCDE[:2], of=2) == "a, b"
    assert first_few(ABCDE[:2], of=9) == "a, b and 7 more"
    assert first_few(ABCDE, of=1_239) == "a, b, c and 1 236 more"
    with units.thousands(separated=False):
        assert first_few(ABCDE, of=1_239) == "a, b, c and 1236 more"


def test_names_are_joined_as_one_says_them() -> None:
    assert [joined(ABCDE[:number]) for number in range(4)] == ["", "a", "a and b", "a, b and c"]
    assert joined(ABCDE, 5) == "a, b, c, d and e"
    assert joined(ABCDE, 3) == "a, b, c and 2 more"
