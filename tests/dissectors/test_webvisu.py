"""Bodies of WebVisu requests and replies: the vectors of documents and clients, and what is seen in the field."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.webvisu import (
    MOST_ENTRIES,
    Answer,
    Entry,
    Likeness,
    Place,
    Request,
    fields_in_reply,
    is_request,
    likeness,
    read_query,
    read_reply,
    read_request,
)
from tests.laws import examples

FIVE = b"|0|5|0|0|0|1|0|1|4|0|6|8|2|4|6|1|2|3|4|7|2|3|4|2|0|0|0|"
"""Printed in the document."""

THREE = b"|0|3|0|4|0|6|8|1|4|6|1|2|2|4|7|2|3|"


def asked(body: bytes) -> Request:
    request = read_request(body)
    assert request is not None
    return request


def test_the_example_of_the_document() -> None:
    request = asked(FIVE)
    assert (request.writes, request.declared, request.is_miscounted) == (False, 5, False)
    assert [entry.address for entry in request.entries] == ["0,0,1,0", "4,0,6,8", "4,6,1,2", "4,7,2,3", "2,0,0,0"]
    assert request.entries[1] == Entry(1, Place(4, 0, 6, 8))


def test_a_write() -> None:
    request = asked(b"|1|1|0|0|6|1|2|7|")
    assert request.writes
    assert request.entries == (Entry(0, Place(0, 6, 1, 2), "7"),)
    assert read_reply(request, b"|0|").answer is Answer.DONE
    assert read_reply(request, b" |0|\r\n").answer is Answer.DONE
    for refused in (b"|1|", b"", b"|0|0|", b"0", b"<html>"):
        assert read_reply(request, refused).answer is Answer.REFUSED


def test_the_printed_program_declares_one_more_than_it_sends() -> None:
    body = "|0|100" + "".join(f"|{number}|2|{number}|1|2" for number in range(99)) + "|"
    request = asked(body.encode())
    assert (request.declared, len(request.entries), request.is_miscounted) == (100, 99, True)


@pytest.mark.parametrize(
    ("body", "addresses"),
    [
        (b"|0|2|\r\n0|2|48|0|0|\r\n1|2|29|0|0|", ["2,48,0,0", "2,29,0,0"]),  # as the document prints it
        (b"|0|1|0|4|572|4|5", ["4,572,4,5"]),  # no trailing separator
        (b"|0|3|0|4|146|1|0|1|4|156|4|5|5|4|160|4|6|", ["4,146,1,0", "4,156,4,5", "4,160,4,6"]),  # numbers jump
        (b"|0|2|0|4|146|1|0|0|4|146|1|0|", ["4,146,1,0", "4,146,1,0"]),  # twice the same
        (b"|0|2| 0|+4|146|\t1|0 |1|4|156| +4|5|", ["4,146,1,0", "4,156,4,5"]),  # blanks and signs
        (b"|0|2|0|4|146|1|0|x|4|156|4|5|", ["4,146,1,0"]),
        (b"|0|2|0|4|146|1|0|1|-4|156|4|5|", ["4,146,1,0"]),
        (b"|0|2|0|4|146|1|0|1|4|156", ["4,146,1,0"]),
        (b"|0|0|", []),
        (b"|0|99999999999999999999|", []),
    ],
)
def test_what_is_seen_in_the_field(body: bytes, addresses: list[str]) -> None:
    assert [entry.address for entry in asked(body).entries] == addresses


@pytest.mark.parametrize(
    "body", [b"", b"|", b"|2|1|0|4|0|1|0|", b"|0|x|", b"0|1|0|4|0|1|0|", b"|0|1", b"<soap>", b"\xa7|0|1|", b"|0||1|"]
)
def test_what_is_no_request(body: bytes) -> None:
    assert read_request(body) is None
    assert not is_request(body)


def test_a_body_may_become_a_request_up_to_where_it_cannot() -> None:
    for stop in range(1, len(FIVE)):
        assert likeness(FIVE[:stop], "/a") is Likeness.YES
    for other in (b"x", b"|2", b"|0x", b"|0|5x", b"<"):
        assert likeness(other, "/webvisu.htm") is Likeness.NO


def test_without_a_body_the_name_of_the_page_is_all_there_is_to_tell_a_request_by() -> None:
    for target in ("/webvisu.htm", "/PLC/WebVisu.HTM?a=/b", "webvisu.htm"):
        assert likeness(b"\r\n", target) is Likeness.YES
    for target in ("", "/", "/WebVisuV3.bin", "/index.html?page=/webvisu.htm", "/webvisu.htm/"):
        assert likeness(b"", target) is Likeness.PERHAPS


@pytest.mark.parametrize(
    ("reply", "answer", "values"),
    [
        (b"|abc|5|1000|", Answer.DONE, ("abc", "5", "1000")),
        (b"|abc|5|1000", Answer.DONE, ("abc", "5", "1000")),
        (b"|a|b|5|1000|", Answer.DONE, ("a|b", "5", "1000")),  # one STRING: the surplus is its
        (b"|||5|1000|", Answer.DONE, ("|", "5", "1000")),
        (b"|abc|5|", Answer.MISCOUNTED, ("abc", "5")),
        (b"|abc|???|1000|\r\n", Answer.DONE, ("abc", None, "1000")),
        (b"", Answer.MISCOUNTED, ()),
        (b"<html>", Answer.MISCOUNTED, ()),
    ],
)
def test_replies_to_a_read(reply: bytes, answer: Answer, values: tuple[str | None, ...]) -> None:
    found = read_reply(asked(THREE), reply)
    assert (found.answer, tuple(found.values)) == (answer, values)


def test_surplus_fields() -> None:
    two_strings = asked(b"|0|2|0|4|0|6|8|1|4|6|6|8|")
    assert read_reply(two_strings, b"|a|b|c|").answer is Answer.AMBIGUOUS
    assert not read_reply(two_strings, b"|a|b|c|").values
    no_string = asked(b"|0|1|0|4|572|4|5|")
    assert read_reply(no_string, b"|1|2|").answer is Answer.MISCOUNTED
    assert read_reply(no_string, b"|1|2|").values == ("1",)


def test_a_separator_in_a_string_that_is_written() -> None:
    assert asked(b"|1|1|0|4|0|9|8|a|b|c|").entries[0].value == "a|b|c"
    assert asked(b"|1|1|0|4|0|9|8||").entries[0].value == ""
    request = asked(b"|1|2|0|4|0|9|8|a|b|1|4|9|1|2|7|")
    assert [(entry.address, entry.value) for entry in request.entries] == [("4,0,9,8", "a|b"), ("4,9,1,2", "7")]
    assert not request.is_miscounted
    assert not request.may_write_more


@pytest.mark.parametrize(
    ("target", "writes", "entries"),
    [
        ("/PLC/READPI?ADR=MW230&FORMAT=%d", False, [("MW230", None)]),
        ("/readpi?ADR1=MW230&FORMAT1=%25d&ADR2=QX0.1", False, [("MW230", None), ("QX0.1", None)]),
        ("/WRITEPI?ADR1=MW230&VALUE1=12&FORMAT1=%d&ADR2=MW231&VALUE2=a%7Cb", True, [("MW230", "12"), ("MW231", "a|b")]),
        ("/WRITEPI?ADR=MW1", True, [("MW1", "")]),
        ("/READPI?", False, []),
    ],
)
def test_older_pages(target: str, writes: bool, entries: list[tuple[str, str | None]]) -> None:
    request = read_query(target)
    assert request is not None
    assert request.writes is writes
    assert [(entry.address, entry.value) for entry in request.entries] == entries


def test_another_url_is_none() -> None:
    assert read_query("/plc/webvisu.htm?x=READPI") is None


def test_entries_have_a_limit() -> None:
    body = b"|0|%d" % (MOST_ENTRIES + 5) + b"|1|4|0|1|0" * (MOST_ENTRIES + 5) + b"|"
    assert len(asked(body).entries) == MOST_ENTRIES


NUMBERS = st.integers(0, 10**10 - 1)
PLACES = st.builds(Place, NUMBERS, NUMBERS, NUMBERS, st.integers(0, 30))
PIECES = st.sampled_from([b"|", b"0", b"1", b"8", b"\r\n", b"???", b"x", b"\xff", b"|0|", b"|1|1|0|4|0|9|8|"])


@examples(100)
@given(st.lists(PLACES, max_size=30), st.booleans())
def test_what_is_asked_is_what_is_read(places: list[Place], trailing: bool) -> None:
    entries = "".join(f"|{number}|{place.text.replace(',', '|')}" for number, place in enumerate(places))
    body = f"|0|{len(places)}{entries}{'|' if trailing or not places else ''}".encode()
    assert [entry.place for entry in asked(body).entries] == places
    assert not asked(body).is_miscounted


@examples(100)
@given(st.lists(st.text(st.characters(codec="latin-1", exclude_characters="|\r\n"), max_size=9), min_size=1))
def test_values_are_what_was_sent(values: list[str]) -> None:
    asks = b"|0|%d" % len(values) + b"|0|4|0|4|5" * len(values) + b"|"
    reply = "".join(f"|{value}" for value in values) + "|"
    found = read_reply(asked(asks), reply.encode("latin-1"))
    assert found.answer is Answer.DONE
    assert found.values == tuple(None if value == "???" else value for value in values)


@examples(100)
@given(st.lists(PIECES, max_size=40).map(b"".join), st.lists(PIECES, max_size=40).map(b"".join))
def test_no_bytes_raise(body: bytes, reply: bytes) -> None:
    request = read_request(body)
    assert (request is not None) is is_request(body)
    assert likeness(body, "") is Likeness.YES or not is_request(body)
    for one in (request, asked(THREE), asked(b"|1|1|0|4|0|9|8|a|")):
        if one is not None:
            found = read_reply(one, reply)
            assert len(found.values) <= len(one.entries)
            if not one.writes and found.answer is not Answer.AMBIGUOUS and one.strings != 1:
                assert len(found.values) == min(fields_in_reply(reply), len(one.entries))
