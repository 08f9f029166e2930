"""Bodies of requests: what pages send, and nothing that is malformed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.webvisu import STRING, TYPES, Place, read_request
from nvscope.plc.visu.body import MOST_AT_ONCE, read_body, write_body
from tests.laws import examples

NUMBERS = st.integers(0, 9_999_999_999)
PLACES = st.builds(Place, NUMBERS, NUMBERS, NUMBERS, st.integers(0, len(TYPES) + 5))
TEXTS = st.text(st.characters(max_codepoint=255, exclude_characters="|\r\n\0"), max_size=80)


def test_bodies_are_those_that_are_published() -> None:
    published = Place(4, 0, 6, 8), Place(4, 6, 1, 2), Place(4, 7, 2, 3), Place(2, 0, 0, 0)
    assert read_body([Place(0, 0, 1, 0), *published]) == (b"|0|5|0|0|0|1|0|1|4|0|6|8|2|4|6|1|2|3|4|7|2|3|4|2|0|0|0|")
    assert write_body(Place(0, 6, 1, 2), "7") == b"|1|1|0|0|6|1|2|7|"
    assert write_body(Place(4, 572, 4, 5), "0") == b"|1|1|0|4|572|4|5|0|"


@given(st.lists(PLACES, min_size=1, max_size=MOST_AT_ONCE))
@examples(60)
def test_what_is_asked_for_is_what_is_read(places: list[Place]) -> None:
    request = read_request(read_body(places))
    assert request is not None
    assert (request.writes, request.is_miscounted) == (False, False)
    assert [(one.number, one.place) for one in request.entries] == list(enumerate(places))


@given(PLACES, TEXTS)
@examples()
def test_what_is_written_is_what_is_read(place: Place, text: str) -> None:
    request = read_request(write_body(place, text))
    assert request is not None
    assert (request.writes, request.declared) == (True, 1)
    assert [(one.place, one.value) for one in request.entries] == [(place, text)]


@pytest.mark.parametrize("text", ["a|b", "|", "a\rb", "a\nb", "\0", "€", "\u202e"])
def test_what_would_be_more_than_a_value_is_none(text: str) -> None:
    with pytest.raises(ValueError, match=r"cannot have|is no character"):
        write_body(Place(4, 0, 81, STRING), text)


@pytest.mark.parametrize("count", [0, MOST_AT_ONCE + 1])
def test_a_request_asks_for_some_variables_and_not_too_many(count: int) -> None:
    with pytest.raises(ValueError, match="200"):
        read_body([Place(4, 0, 1, 0)] * count)
