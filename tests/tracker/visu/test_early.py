"""Replies that come before their request is whole, and whatever else HTTP/1.1 lets clients and servers do."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from tests.laws import examples
from tests.oracle.builders import SECOND
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.drawn_http import drawn
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_endings import said
from tests.tracker.visu.test_open_requests import became

HEAD = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 19\r\n\r\n"
BODY, OTHER = b"|1|1|0|4|0|4|6|9.5|", b"|1|1|0|4|0|4|6|8.5|"
REFUSED = b"HTTP/1.1 413 x\r\nContent-Length: 2\r\n\r\nno"
DONE = b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\n|0|"
GO_ON = b"HTTP/1.1 100 Continue\r\n\r\n"
HAS = b"HEAD /plc/x.htm HTTP/1.1\r\n\r\n"
SIZE = b"HTTP/1.1 200 OK\r\nContent-Length: 70\r\n\r\n"
BOTH = [("9.5", "refused"), ("8.5", "confirmed")]


@examples(400)
@given(seed=st.integers(0, 10**6), packets=st.integers(1, 9))
def test_what_becomes_of_writes_is_what_whole_streams_say(seed: int, packets: int) -> None:
    conversation = drawn(seed)
    frames, became = conversation.frames(), conversation.became()
    whole, parts = followed([batch_of(frames)]), followed(cut(batch_of(frames), packets))
    assert [(row[7], row[8], row[10]) for row in writes_of(whole)] == became
    assert writes_of(parts) == writes_of(whole) == writes_by_the_rules(by_the_rules(frames))
    assert told(parts) == told(whole)


def test_a_reply_before_the_body_is_the_requests() -> None:
    for first in ([BODY], [BODY[:5], BODY[5:]]):
        line = Line().open().ask(HEAD).answer(REFUSED)
        for part in first:
            line.ask(part)
        assert became(line.ask(HEAD + OTHER).answer(DONE).frames) == BOTH
    within = Line().open().ask(HEAD + BODY[:9]).answer(REFUSED).ask(BODY[9:] + HEAD + OTHER).answer(DONE)
    assert became(within.frames) == BOTH


def test_it_is_told_with_the_request_and_how_long_that_took_is_not_known() -> None:
    line = Line().open().ask(HEAD).answer(REFUSED).wait(SECOND).ask(BODY)
    assert became(line.frames) == [("9.5", "refused")]
    assert said(line.frames) == ["write 1 variable: 4,0,4,6 = 9.5", "HTTP status 413 (seen before its request)"]


def test_who_sends_no_more_has_asked_for_nothing() -> None:
    for end in (Line.close, Line.reset):
        line = end(Line().open().ask(HEAD + BODY[:9]).answer(REFUSED).close(False), True)
        assert became(line.frames) == []


def test_who_goes_on_after_the_server_has_closed_its_side_is_refused() -> None:
    line = Line().open().ask(HEAD).answer(REFUSED).close(False).ask(BODY).close(True)
    assert became(line.frames) == [("9.5", "refused")]


def test_a_reply_before_the_head_is_whole_is_nobodys() -> None:
    line = Line().open().ask(HEAD[:30]).answer(REFUSED).ask(HEAD[30:] + BODY).answer(DONE)
    assert became(line.frames) == [("9.5", "confirmed")]


def test_an_interim_reply_is_none() -> None:
    line = Line().open().ask(HEAD).answer(GO_ON).ask(BODY).answer(GO_ON + DONE).ask(HEAD + OTHER).answer(DONE)
    assert became(line.frames) == [("9.5", "confirmed"), ("8.5", "confirmed")]


def test_of_two_early_ones_the_second_is_nobodys() -> None:
    line = Line().open().ask(HEAD).answer(REFUSED + DONE).ask(BODY + HEAD + OTHER).answer(DONE)
    assert became(line.frames) == BOTH


def test_one_that_waits_in_front_is_answered_first() -> None:
    line = Line().open().ask(HEAD + BODY + HEAD).answer(REFUSED).ask(OTHER).answer(DONE)
    assert became(line.frames) == BOTH
    early = Line().open().ask(HEAD + BODY + HEAD).answer(REFUSED + DONE).ask(OTHER)
    assert became(early.frames) == BOTH


def test_what_answers_head_behind_it_has_no_body() -> None:
    line = Line().open().ask(HAS).answer(SIZE).ask(HEAD).answer(REFUSED).ask(BODY + HAS).answer(SIZE)
    assert became(line.ask(HEAD + OTHER).answer(DONE).frames) == BOTH


def test_a_request_behind_one_without_a_length_may_be_answered_early() -> None:
    without = HEAD.replace(b"Content-Length: 19", b"X: y") + OTHER
    line = Line().open().ask(without).answer(DONE).ask(HEAD).answer(REFUSED).ask(BODY + HEAD + OTHER).answer(DONE)
    assert became(line.frames) == [("8.5", "confirmed"), *BOTH]


def test_of_a_request_that_lacks_bytes_the_reply_is_not_that_of_the_next_one() -> None:
    line = Line().open().ask(HEAD).answer(REFUSED).say(True, BODY, captured=9).ask(HEAD + OTHER).answer(DONE)
    assert became(line.frames) == [("8.5", "confirmed")]


def test_where_more_come_early_than_there_is_room_for_the_others_are_nobodys() -> None:
    """Two captures, one of each direction, by clocks that differ: the server's is ahead by several replies."""
    right = ["confirmed", "refused"] * 5
    for ahead in range(1, 10):
        line = Line().open()
        for outcome in right:
            line.ask(HEAD + BODY).answer(DONE if outcome == "confirmed" else REFUSED)
        opened, asked, answered = line.frames[:-20], line.frames[-20::2], line.frames[-19::2]
        later = [frame for pair in zip(asked, answered[ahead:], strict=False) for frame in pair]
        found = [outcome for _, outcome in became([*opened, *answered[:ahead], *later, *asked[10 - ahead :]])]
        known = [one if place < 4 or place >= ahead else "open" for place, one in enumerate(right)]
        assert found == known
