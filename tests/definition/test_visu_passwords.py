"""Bytes of passwords: who shares any with one is one, whatever its type."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.webvisu import Place
from nvscope.definition.visu_passwords import NO_PASSWORDS, Passwords
from tests.oracle.rules.visu_body import Listed, shows_password

PLACES = st.builds(Place, st.integers(0, 4), st.integers(0, 60), st.integers(0, 12), st.sampled_from((0, 2, 5, 8, 9)))


@pytest.mark.parametrize(
    ("place", "lies"),
    [
        ((4, 10, 21, 8), True), ((4, 10, 21, 9), True), ((4, 30, 1, 2), True), ((4, 7, 4, 5), True),
        ((4, 0, 100, 11), True), ((4, 31, 4, 5), False), ((4, 6, 4, 5), False), ((3, 10, 21, 8), False),
        ((4, 30, 0, 0), True), ((4, 9, 0, 0), False), ((2, 8, 0, 0), True), ((2, 15, 1, 0), True),
        ((2, 16, 0, 0), False), ((2, 7, 0, 0), False), ((2, 1, 1, 2), True), ((2, 2, 1, 2), False),
    ],
)  # fmt: skip
def test_a_byte_in_common_is_enough(place: tuple[int, int, int, int], lies: bool) -> None:
    assert Passwords([Place(4, 10, 21, 8), Place(2, 1, 1, 2)]).lie_in(Place(*place)) == lies


def test_without_names_nobody_knows_of_any() -> None:
    assert not NO_PASSWORDS
    assert not NO_PASSWORDS.lie_in(Place(4, 10, 21, 8))


@given(st.lists(PLACES, max_size=6), PLACES)
def test_the_rules_written_a_second_time_say_the_same(passwords: list[Place], place: Place) -> None:
    listed: Listed = [(f"CurrentPasswords[{number}]", one) for number, one in enumerate(passwords)]
    assert Passwords(passwords).lie_in(place) == shows_password(place, [listed])
