"""Writes with separators in their texts: all that is written is found, or it is said that nobody knows it."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.webvisu import MOST_ENTRIES, Request, read_request
from tests.laws import examples
from tests.oracle.rules.visu_body import asked as by_the_rules


def asked(body: bytes) -> Request:
    request = read_request(body)
    assert request is not None
    return request


def told(request: Request) -> tuple[list[tuple[str, str | None]], bool]:
    return [(entry.address, entry.value) for entry in request.entries], request.ambiguous


PLACES = st.sampled_from([b"4|0|9|8", b"4|9|81|08", b"4|0|4|6", b"2|48|0|0", b" +4| 0|4 |6"])
TEXTS = st.sampled_from([b"", b"a", b"a|b", b"|", b"7|7", b"1|2|3|4|5|6|7", b"x|1|4|0|4|6|9", b"x|2|4|0|9|8|9|1"])
ENTRIES = st.tuples(st.sampled_from([0, 0, 0, 0, 1, 7]), PLACES, TEXTS)


@examples(400)
@given(st.lists(ENTRIES, max_size=5), st.integers(-1, 2), st.sampled_from([0, 1]), st.sampled_from([b"", b"|x", b"|"]))
def test_writes_are_what_the_rules_say(
    entries: list[tuple[int, bytes, bytes]], more: int, first: int, end: bytes
) -> None:  # fmt: skip
    body = b"|1|%d" % max(len(entries) + (more if more < 2 else 0), 0)
    for number, (step, place, text) in enumerate(entries):
        body += b"|%d|%s|%s" % (first + number + step, place, text)
    body += end + b"|"
    rules = by_the_rules(b"POST", b"/", body)
    assert rules is not None
    expected = [(",".join(map(str, entry.address)), rules.text(entry)) for entry in rules.entries]
    assert told(asked(body)) == (expected, rules.ambiguous)


@examples(200)
@given(st.lists(st.tuples(PLACES, st.sampled_from([b"", b"a", b"|", b"a|b|", b"||7|"])), min_size=1, max_size=30))
def test_texts_with_separators_hide_nothing(entries: list[tuple[bytes, bytes]]) -> None:
    """Where only texts have separators, and nothing in them looks like an entry, all is found as it was sent."""
    sent = [(place, text if place.endswith(b"8") else b"7") for place, text in entries]
    body = b"".join(b"|%d|%s|%s" % (number, *one) for number, one in enumerate(sent))
    found, ambiguous = told(asked(b"|1|%d%s|" % (len(sent), body)))
    expected = [
        (",".join(str(int(number)) for number in place.split(b"|")), text.decode()) for place, text in sent
    ]  # fmt: skip
    assert (found, ambiguous) == (expected, False)


@pytest.mark.parametrize(
    ("body", "may_write_more"),
    [
        (b"|1|1|0|4|0|4|6|1|", False),
        (b"|1|1|0|4|0|4|6|1|x|", True),
        (b"|1|2|0|4|0|4|6|1|x|4|4|4|6|2|", True),  # its number is none: a controller may write it all the same
        (b"|1|100|0|4|0|4|6|1|", False),
        (b"|1|1|0|4|0|9|8|a|1|4|0|4|6|80.0|", True),
        (b"|1|20000" + b"|1|4|0|4|6|1" * (MOST_ENTRIES + 1) + b"|", True),
        (b"|0|2|0|4|0|4|6|x|", False),
    ],
)
def test_what_may_write_more_than_it_tells(body: bytes, may_write_more: bool) -> None:
    assert asked(body).may_write_more is may_write_more


HOSTILE = {
    "everything may be an entry": b"|0|4|0|9|8" + b"|1" * 60_000,
    "each number twice": b"|0|4|0|9|8|a" + b"".join(b"|%d|4|0|9|8|a" % number * 2 for number in range(1, 2000)),
    "no end": b"|0|4|0|9|8|a" + b"|1|4|0|9|8|a" * 9000 + b"|x",
    "one text": b"|0|4|0|9|8" + b"|" * 500_000,
}


@pytest.mark.parametrize("declared", [1, 2, 2000, 9000])
@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_writes_take_no_longer_than_they_are(what: str, declared: int) -> None:
    begin = time.process_time()
    request = asked(b"|1|%d%s|" % (declared, HOSTILE[what]))
    assert time.process_time() - begin < 2
    assert len(request.entries) <= MOST_ENTRIES
