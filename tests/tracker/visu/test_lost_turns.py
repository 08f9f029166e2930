"""What answers requests around segments that a capture lacks, or has in another order: in doubt nobody knows."""

from __future__ import annotations

from itertools import permutations

import pytest

from tests.check.requests import DONE, READ_X, VALUE, WRITE_X, post, reply, sent
from tests.laws import every_other, in_turn
from tests.oracle.tcp import ACK, PSH
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_lost_segments import became, lost, polled, write

READ, READ_DONE, ASKS, IS_DONE = post(READ_X), reply(VALUE), post(WRITE_X), reply(DONE)
REFUSED = reply(b"-1")


def test_a_request_that_is_known_when_its_reply_is_gone_waits_for_nothing() -> None:
    """A hole shows the rest of the read with the write; the reply to the read came, without its begin, before that."""
    line = polled().ask(READ).say(False, READ_DONE[:6]).lose(False, len(READ_DONE) - 6)
    line.say(True, READ[:-4]).lose(True, 4).lose(False, 10).segment(True).say(False, READ_DONE[10:])
    assert became(write(line).frames) == ["confirmed"]


def test_what_the_client_had_before_it_asked_is_no_answer_though_the_server_acknowledges_little() -> None:
    line = Line().open().lose(True, len(READ)).segment(False).lose(False, len(READ_DONE)).ask(ASKS)
    at = line.sent[False] - len(READ_DONE)
    line.segment(False, READ_DONE, PSH | ACK, seq=at, ack=line.sent[True] - len(ASKS))
    assert became(line.answer(IS_DONE).frames) == ["confirmed"]


def test_where_several_replies_may_be_missing_what_follows_answers_nothing() -> None:
    line = polled().ask(READ).ask(ASKS).lose(False, len(READ_DONE)).ask(ASKS).answer(REFUSED).answer(IS_DONE)
    assert became(write(line).frames) == ["open", "open", "confirmed"]


def test_a_reply_without_what_is_missing_does_not_show_that_this_was_answered() -> None:
    """The reply to a read whose begin is missing is there; the next request of the turn behind it is missing."""
    line = polled().lose(True, 20).ask(READ[20:]).answer(READ_DONE).lose(True, len(READ)).ask(ASKS)
    line.answer(REFUSED).answer(IS_DONE)
    assert became(write(line).frames) == ["open", "confirmed"]


def test_one_with_all_of_it_shows_that_a_turn_begins_though_several_were_asked_at_once_before() -> None:
    line = polled().ask(READ).ask(READ).answer(READ_DONE).answer(READ_DONE)
    line.say(True, READ[:9]).lose(True, 20).ask(READ[29:]).answer(READ_DONE)
    assert became(write(line).frames) == ["confirmed"]


def test_who_asks_several_at_once_behind_missing_bytes_may_have_asked_another_one() -> None:
    line = lost(polled(), READ, READ_DONE).lose(True, len(READ)).ask(ASKS).ask(ASKS)
    line.answer(READ_DONE).answer(REFUSED).answer(IS_DONE)
    assert became(write(line).frames) == ["open", "open", "confirmed"]


def test_the_rest_of_a_request_shows_that_one_is_in_front() -> None:
    line = lost(polled(), READ, READ_DONE).lose(True, 20).ask(READ[20:] + ASKS).answer(READ_DONE).answer(IS_DONE)
    assert became(write(line).frames) == ["open", "confirmed"]


def test_a_reply_that_came_while_the_client_lost_step_may_be_that_to_what_it_asked() -> None:
    """The request was captured behind the begin of its reply, and shows that another one is missing in front of it."""
    line = polled().lose(True, len(READ)).answer(READ_DONE)
    at, had = line.sent[True], line.sent[False]
    line.lose(True, len(ASKS)).say(False, IS_DONE[:9]).segment(True, ASKS, PSH | ACK, seq=at, ack=had)
    line.say(False, IS_DONE[9:])
    assert became(write(line).frames) == ["open", "confirmed"]


def test_what_a_server_has_not_at_its_begin_is_missing_in_front_of_its_client() -> None:
    line = Line().open()
    line.frames = line.frames[1:2]
    line.lose(True, len(READ)).ask(ASKS).answer(READ_DONE).answer(REFUSED)
    assert became(write(line).frames) == ["open", "confirmed"]
    line = Line().open()
    line.frames = line.frames[1:2]
    assert became(write(line).frames) == ["confirmed"]


def test_between_replies_that_came_before_their_requests_one_may_be_missing() -> None:
    line = polled()
    at, had = line.sent[True], line.sent[False]
    asked = READ + ASKS + ASKS
    line.lose(True, len(asked)).answer(READ_DONE).lose(False, len(REFUSED)).answer(IS_DONE).segment(True)
    line.segment(True, asked, PSH | ACK, seq=at, ack=had)
    assert became(write(line).frames) == ["open", "open", "confirmed"]


def test_what_is_asked_behind_a_lost_reply_and_never_answered_is_unanswered() -> None:
    line = polled().ask(ASKS).lose(False, len(IS_DONE)).ask(ASKS).close(True)
    frames = [*line.frames, sent(line.now / 1e6 + 30_000)]
    state, rules = followed([batch_of(frames)]), by_the_rules(frames)
    assert [row[8] for row in writes_of(state)] == ["open", "unanswered"]
    assert [(one["code"], one["frames"]) for one in told(state)[1]] == [("NV801", [6, 7]), ("NV805", [7])]
    for packets in every_other(1, 2, 3):
        assert told(followed(cut(batch_of(frames), packets))) == told(state)
    assert (told(state)[1], writes_of(state)) == (rules.findings(), writes_by_the_rules(rules))


def test_who_asks_more_while_a_reply_is_known_to_be_owed_may_get_that() -> None:
    """Of two requests sent at once the first is missing, and so it is seen for the first time that this client does."""
    line = polled().lose(True, len(READ)).ask(ASKS).answer(READ_DONE).ask(ASKS).answer(REFUSED).answer(IS_DONE)
    assert became(line.frames) == ["open", "open"]


def test_two_replies_to_what_came_at_once_show_that_several_are_missing() -> None:
    line = polled().lose(True, 3 * len(READ)).answer(READ_DONE).answer(READ_DONE)
    assert became(line.ask(ASKS).answer(REFUSED).answer(IS_DONE).frames) == ["open"]


def test_replies_each_with_more_of_the_client_show_that_it_takes_turns() -> None:
    line = polled()
    for _ in range(3):
        line.lose(True, len(READ)).answer(READ_DONE)
    assert became(write(line).frames) == ["confirmed"]


@pytest.mark.parametrize(("turns", "outcome"), [(0, "open"), (2, "open"), (3, "confirmed")])
def test_who_was_seen_to_wait_for_several_replies_has_all_of_them_behind_a_hole(turns: int, outcome: str) -> None:
    """That the first turn was waited for shows with the request behind it, and so on."""
    line = polled()
    for _ in range(turns):
        line.ask(READ).ask(READ).answer(READ_DONE).answer(READ_DONE)
    line.ask(READ).ask(READ).lose(False, 2 * len(READ_DONE))
    assert became(write(write(line)).frames) == ["open", outcome]


@pytest.mark.parametrize("first", range(3))
def test_a_client_that_is_captured_ahead_of_its_server_is_told_the_same_in_any_batches(first: int) -> None:
    line = write(write(Line().open()))
    times = [frame.ts_ns for frame in line.frames]
    for order in in_turn(list(permutations(range(1, 6))), first, 7):
        frames = [line.frames[place] for place in (0, *order, 6)]
        frames = [frame._replace(ts_ns=ts_ns) for frame, ts_ns in zip(frames, times, strict=True)]
        state, parts = followed([batch_of(frames)]), followed(cut(batch_of(frames), first + 1))
        assert (told(parts), writes_of(parts)) == (told(state), writes_of(state))
        assert writes_of(state) == writes_by_the_rules(by_the_rules(frames))
        assert {one["code"] for one in told(state)[1]} <= {"NV801", "NV808", "NV810"}
