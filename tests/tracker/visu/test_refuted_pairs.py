"""Replies behind missing bytes that cannot be those to the requests they would answer: then nobody knows any pair."""

from __future__ import annotations

import pytest

from tests.check.requests import DONE, READ_X, VALUE, WRITE_X, post, reply
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.tracker.visu.followed import seen
from tests.tracker.visu.test_lost_segments import became, lost, polled, write

READ, READ_DONE, ASKS, IS_DONE = post(READ_X), reply(VALUE), post(WRITE_X), reply(DONE)
OTHER_COUNT = reply(b"|1|2|3|")


def codes(frames: list[Frame]) -> set[str]:
    return {one["code"] for one in seen(frames)[1]}


def behind_a_hole() -> Line:
    """Return a connection of which a request and its reply are missing, both at once."""
    return lost(polled(), READ, READ_DONE)


@pytest.mark.parametrize("fitting", range(5))
def test_a_controller_that_counts_wrong_is_told_behind_three_replies_that_fit(fitting: int) -> None:
    line = behind_a_hole()
    for _ in range(fitting):
        line.ask(READ).answer(READ_DONE)
    assert ("NV804" in codes(line.ask(READ).answer(OTHER_COUNT).frames)) == (fitting >= 3)


def test_it_is_told_where_nothing_is_missing() -> None:
    assert "NV804" in codes(polled().ask(READ).answer(OTHER_COUNT).frames)
    assert "NV804" in codes(Line().open().ask(READ).answer(OTHER_COUNT).frames)


def test_of_what_waits_with_it_nobody_knows_either_and_the_next_turn_is_in_step() -> None:
    line = behind_a_hole().ask(READ).ask(ASKS).answer(OTHER_COUNT).answer(READ_DONE).answer(IS_DONE)
    assert became(write(line).frames) == ["open", "confirmed"]


def test_several_fields_are_no_reply_to_a_write() -> None:
    line = behind_a_hole().ask(ASKS).answer(OTHER_COUNT).answer(IS_DONE)
    assert became(write(line).frames) == ["open", "confirmed"]
    # One field may be: it says that the write was refused.
    assert "NV802" in codes(behind_a_hole().ask(ASKS).answer(reply(b"|3|")).frames)


def test_a_reply_to_what_was_asked_in_front_shows_that_the_client_did_not_wait() -> None:
    """Its server had not got the request that waits."""
    line = behind_a_hole()
    had = line.sent[True]
    line.ask(ASKS).segment(False, reply(b"", 404), ack=had).lose(False, len(reply(b"", 404))).answer(IS_DONE)
    assert became(write(line).frames) == ["open", "confirmed"]


def test_the_server_is_heard_first_within_a_reply_to_a_request_of_which_bytes_are_missing() -> None:
    line = Line().ask(READ[:-5]).lose(True, 5).lose(False, 9).answer(READ_DONE[9:])
    for _ in range(3):
        write(line).ask(READ).answer(READ_DONE)
    assert became(line.frames) == ["confirmed"] * 3
