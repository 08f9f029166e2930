"""Connections that began before the capture: the first response may answer a request that nobody captured."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.laws import crossed, cut_sizes, examples
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import BODY, DONE, HEAD, OTHER, REFUSED
from tests.tracker.visu.test_endings import said

READ = HEAD.replace(b"19", b"15") + b"|0|1|0|4|0|4|6|"
VALUE = b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\n|7.5|"
HAS = b"HEAD /plc/x.htm HTTP/1.1\r\n\r\n"
WITHOUT_BODY = [b"Content-Length: 170\r\n", b"Content-Length: 2\r\n", b"Transfer-Encoding: chunked\r\n", b""]
UNCLEAR = "nobody knows what answers frame 1"


def became(line: Line) -> list[str]:
    """Return what became of writes: by the rules, too, and the same however the frames are cut."""
    rules = by_the_rules(line.frames)
    for packets in cut_sizes(len(line.frames)):
        state = followed(cut(batch_of(line.frames), packets))
        assert told(state)[1] == rules.findings()
        assert writes_of(state) == writes_by_the_rules(rules)
    return [one[8] for one in writes_of(state)]


def codes(line: Line) -> set[str]:
    return {one["code"] for one in told(followed([batch_of(line.frames)]))[1]} - {"NV801"}


def to_head(status: int, says: bytes) -> bytes:
    return b"HTTP/1.1 %d x\r\n%b\r\n" % (status, says)


@pytest.mark.parametrize(("together", "says", "status"), crossed([True, False], WITHOUT_BODY, [200, 301, 404, 500]))
def test_a_reply_to_head_behind_a_write_is_not_the_writes(status: int, says: bytes, together: bool) -> None:
    line = Line().ask(HEAD + BODY).answer(to_head(status, says))
    line = line.answer(DONE) if together else line.answer(DONE[:5]).answer(DONE[5:])
    assert became(line.ask(HEAD + OTHER).answer(DONE)) == ["confirmed", "confirmed"]
    assert codes(line) == set()


@pytest.mark.parametrize("count", [2, 3])
def test_nor_are_several(count: int) -> None:
    line = Line().ask(HEAD + BODY)
    for number in range(count):
        line.answer(to_head(404, WITHOUT_BODY[number]))
    assert became(line.answer(DONE)) == ["confirmed"]


def test_nor_where_the_replies_come_at_once() -> None:
    line = Line().ask(HEAD + BODY).answer(to_head(404, WITHOUT_BODY[0]) * 2 + DONE)
    assert became(line) == ["confirmed"]


@pytest.mark.parametrize("status", [200, 204, 304, 404])
def test_what_might_be_a_reply_to_head_leaves_open_what_became_of_a_write(status: int) -> None:
    line = Line().ask(HEAD + BODY).answer(to_head(status, b"Content-Length: 0\r\n")).answer(DONE)
    assert became(line.ask(HEAD + OTHER).answer(REFUSED)) == ["open", "refused"]
    assert UNCLEAR in said(line.frames)


@pytest.mark.parametrize("first", [REFUSED, REFUSED.replace(b"413", b"200"), VALUE])
def test_what_answers_a_request_from_before_leaves_it_open(first: bytes) -> None:
    line = Line().ask(HEAD + BODY).answer(first).answer(DONE)
    assert became(line) == ["open"]
    assert codes(line) == set()


def test_of_all_that_waits_then_nobody_knows_what_answers_it() -> None:
    line = Line().ask(HEAD + BODY).ask(HEAD + OTHER).answer(REFUSED).answer(DONE).answer(REFUSED)
    assert became(line) == ["open", "open"]
    assert [one for one in said(line.frames) if "nobody" in one] == [UNCLEAR, UNCLEAR.replace("1", "2")]


def test_what_is_answered_as_it_asks_is_answered() -> None:
    line = Line().ask(READ).answer(VALUE).ask(HEAD + BODY).answer(REFUSED)
    assert became(line) == ["refused"]
    assert became(Line().ask(HEAD + BODY).answer(DONE).ask(HEAD + OTHER).answer(REFUSED)) == ["confirmed", "refused"]


def test_a_read_is_not_refused_by_it_either() -> None:
    for first in (to_head(404, b"Content-Length: 0\r\n"), REFUSED):
        line = Line().ask(READ).answer(first).answer(VALUE)
        assert became(line) == []
        assert codes(line) == set()


def test_a_captured_head_in_front_may_have_its_reply_behind_another_one() -> None:
    heads = to_head(404, WITHOUT_BODY[0]), to_head(404, b"Content-Length: 0\r\n")
    assert became(Line().ask(HAS).ask(HEAD + BODY).answer(heads[0]).answer(heads[0]).answer(DONE)) == ["open"]
    assert became(Line().ask(HAS).ask(HEAD + BODY).answer(heads[1]).answer(heads[1]).answer(DONE)) == ["open"]


@pytest.mark.parametrize("says", [*WITHOUT_BODY, b"Content-Length: 0\r\n"])
def test_it_may_come_before_the_write_is_whole(says: bytes) -> None:
    line = Line().ask(HEAD + BODY[:9]).answer(to_head(404, says)).ask(BODY[9:]).answer(DONE)
    assert became(line) == ["open" if b" 0\r" in says else "confirmed"]
    assert codes(line) == set()


def test_who_was_heard_from_the_begin_has_asked_for_nothing_before() -> None:
    for body in (b"Content-Length: 0\r\n", b"Content-Length: 2\r\n"):
        line = Line().open().ask(HEAD + BODY).answer(to_head(404, body) + b"no"[: int(body[16:17])])
        assert became(line) == ["refused"]


@examples(300)
@given(seed=st.integers(0, 10**6))
def test_no_write_is_said_to_be_refused_by_what_answers_head(seed: int) -> None:
    """Some requests to HEAD were sent before, and are answered behind the first one that was captured."""
    rng = random.Random(seed)
    replies = [to_head(rng.choice((200, 404)), rng.choice(WITHOUT_BODY)) for _ in range(rng.randint(1, 3))]
    truth: list[str] = []
    line = Line()
    for number in range(rng.randint(1, 4)):
        is_done = rng.random() < 0.5
        truth.append("confirmed" if is_done else "refused")
        line.ask(HEAD + b"|1|1|0|4|0|4|6|%d.5|" % number)
        replies.append(DONE if is_done else REFUSED)
        if number and rng.random() < 0.5:
            continue
        data, replies = b"".join(replies), []
        while data:
            size = rng.randint(1, len(data))
            line.answer(data[:size])
            data = data[size:]
    found = became(line)
    assert all(one in ("open", told) for one, told in zip(found, truth, strict=True))
    if truth[0] == "confirmed":
        assert found[0] == "confirmed"


@pytest.mark.parametrize("begin", [b"", b"|1|"])
def test_a_cut_reply_is_cut_all_the_same(begin: bytes) -> None:
    cut_short = Line().ask(HEAD + BODY).answer(b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\n" + begin)
    line = cut_short.lose(False, 100 - len(begin)).ask(HEAD + OTHER).answer(REFUSED)
    assert became(line) == ["open", "refused"]
    assert codes(line) == {"NV802", "NV808"}


@pytest.mark.parametrize("ends", ["server closes", "client resets"])
def test_a_late_reply_of_a_length_nobody_knows_refuses_nothing(ends: str) -> None:
    line = Line().ask(HEAD + BODY).answer(b"HTTP/1.1 500 x\r\nContent-Length: 19, 20\r\n\r\n")
    line = line.close("client" in ends) if "closes" in ends else line.reset("client" in ends)
    assert became(line) == ["open"]
    assert "NV802" not in codes(line)
