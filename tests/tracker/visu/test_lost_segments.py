"""Segments that a capture lacks of conversations in which all is answered: nobody is accused, and what is known is."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from nvscope.check.verdict import Verdict
from tests.check.requests import DONE, READ_X, VALUE, WRITE_X, of_frames, post, reply, sent
from tests.laws import every_other
from tests.oracle.builders import SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp import ACK, FIN, PSH, SYN
from tests.oracle.tcp_line import CLIENT, SERVER, Line, tcp_frame
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of

HEAD = b"HEAD /plc/a.bmp HTTP/1.1\r\n\r\n"
OF_HEAD = b"HTTP/1.1 200 OK\r\nContent-Length: 9999\r\n\r\n"
NOBODY = {"check": "writes", "only_by": "192.0.2.1"}


def became(frames: Sequence[Frame]) -> list[str]:
    """Return what became of writes, the same by the rules, and however the frames are cut; nobody is accused."""
    frames = [*frames, sent(frames[-1].ts_ns / 1e6 + 30_000)]
    state, rules = followed([batch_of(frames)]), by_the_rules(frames)
    findings = told(state)[1]
    assert findings == rules.findings()
    assert {one["code"] for one in findings} <= {"NV801", "NV808", "NV810"}
    for packets in every_other(1, 2, 3):
        parts = followed(cut(batch_of(frames), packets))
        assert told(parts) == told(state)
        assert writes_of(parts) == writes_of(state)
    assert writes_of(state) == writes_by_the_rules(rules)
    return [one[8] for one in writes_of(state)]


def polled() -> Line:
    return Line().open().ask(post(READ_X)).answer(reply(VALUE))


def write(line: Line) -> Line:
    return line.ask(post(WRITE_X)).answer(reply(DONE))


def lost(line: Line, request: bytes, response: bytes) -> Line:
    """Add an exchange of which nothing was captured."""
    return line.lose(True, len(request)).lose(False, len(response))


def test_the_reply_to_a_head_that_is_missing_has_no_body() -> None:
    line = polled().lose(True, len(HEAD)).answer(OF_HEAD)
    assert became(write(write(line)).close(True).close(False).frames) == ["confirmed", "confirmed"]


def test_nor_has_the_reply_to_a_head_behind_a_reply_that_is_missing() -> None:
    line = polled().ask(post(READ_X)).lose(False, len(reply(VALUE))).ask(HEAD).answer(OF_HEAD)
    assert became(write(write(line)).close(True).close(False).frames) == ["confirmed", "confirmed"]


def test_what_is_missing_behind_it_is_not_taken_for_its_body() -> None:
    line = polled().lose(True, len(HEAD)).answer(OF_HEAD).ask(post(READ_X)).lose(False, len(reply(VALUE)))
    assert became(write(line).close(True).close(False).frames) == ["confirmed"]


def test_a_write_behind_an_exchange_that_is_missing_is_answered() -> None:
    line = lost(polled(), post(READ_X), reply(VALUE))
    assert became(write(line).frames) == ["confirmed"]


def test_so_is_one_behind_a_reply_that_is_missing() -> None:
    line = polled().ask(post(WRITE_X)).lose(False, len(reply(DONE)))
    assert became(write(line).frames) == ["open", "confirmed"]


def test_what_the_client_had_before_it_asked_is_no_answer_even_if_it_is_captured_later() -> None:
    read, value, both = post(READ_X), reply(VALUE), post(b"|0|2|0|4|144|1|0|1|4|146|2|1|")
    line = Line().open().ask(read).lose(False, len(value))
    at, had = line.sent[True] + len(read), line.sent[False] + len(value)
    line = line.segment(True, both, PSH | ACK, seq=at, ack=had).segment(
        False, value, PSH | ACK, seq=had - len(value), ack=at
    )
    line.sent.update({True: at + len(both), False: had})
    assert became(write(line.answer(reply(b"|1|2|"))).frames) == ["confirmed"]


def test_of_who_sends_several_at_once_the_first_one_may_be_missing() -> None:
    line = polled().ask(post(READ_X)).ask(post(READ_X)).answer(reply(VALUE)).answer(reply(VALUE))
    line = line.lose(True, len(post(WRITE_X))).ask(post(WRITE_X)).answer(reply(b"|-1|")).answer(reply(DONE))
    assert became(write(line).frames) == ["open", "confirmed"]


@pytest.mark.parametrize("acknowledges", ["with its end", "behind its end"])
def test_who_acknowledges_a_reply_that_is_missing_has_not_given_up(acknowledges: str) -> None:
    line = polled().ask(post(WRITE_X))
    if acknowledges == "with its end":
        line.lose(False, len(reply(DONE))).close(True)
    else:
        line.close(True).lose(False, len(reply(DONE))).segment(True)
    assert became(line.frames) == ["open"]


def test_who_acknowledges_no_more_than_the_end_of_its_server_has() -> None:
    line = polled().ask(post(WRITE_X)).segment(True, flags=FIN | 16, ack=Line().sent[False] + len(reply(VALUE)) + 1)
    frames = [*line.frames, sent(line.now / 1e6 + 30_000)]
    state = followed([batch_of(frames)])
    assert [one["code"] for one in told(state)[1]] == ["NV801", "NV805"]
    assert told(state)[1] == by_the_rules(frames).findings()


def test_behind_another_connection_of_the_same_ends_nobody_knows() -> None:
    line = polled().ask(post(WRITE_X))
    line.frames.append(tcp_frame(line.now + SECOND, CLIENT, SERVER, seq=77, flags=SYN))
    assert became(line.frames) == ["open"]


def verdict(frames: Sequence[Frame]) -> Verdict:
    (one,) = of_frames([*frames, sent(frames[-1].ts_ns / 1e6 + 100)], NOBODY)
    return one.verdict


@pytest.mark.parametrize("end", ["open", "server closes", "server resets", "client waits for room"])
def test_where_nothing_of_a_client_came_behind_what_is_missing_nobody_knows_what_it_wrote(end: str) -> None:
    line = polled().lose(True, len(post(WRITE_X))).answer(reply(DONE))
    if end == "server closes":
        line.close(False)
    elif end == "server resets":
        line.reset(False)
    elif end == "client waits for room":
        line = polled().lose(True, 7).ask(post(WRITE_X))
    assert verdict(line.frames) is Verdict.INCONCLUSIVE


def test_where_nothing_is_missing_that_is_known() -> None:
    assert verdict(polled().ask(post(READ_X)).segment(False).frames) is Verdict.PASS
    assert verdict(polled().close(True).close(False).segment(True).frames) is Verdict.PASS
