"""Replies to HEAD have no body, whatever their length says, and whatever that of the request says."""

from __future__ import annotations

import pytest

from tests.laws import cut_sizes
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import BODY, DONE, HEAD, OTHER

WRITE, NEXT = HEAD + BODY, HEAD + OTHER
REPLY = b"HTTP/1.1 200 OK\r\nContent-Length: 19\r\n\r\n"
REFUSED = b"HTTP/1.1 500 x\r\nContent-Length: 2\r\n\r\nno"
LENGTHS = [b"", b"Content-Length: x\r\n", b"Content-Length: 3\r\nContent-Length: 4\r\n", b"Content-Length: 3, 4\r\n"]
LENGTHS += [b"Content-Length: -1\r\n", b"Transfer-Encoding: chunked\r\n"]


def outcomes(line: Line) -> list[str]:
    """Return what became of writes, by the rules, too, and the same however the frames are cut."""
    rules = by_the_rules(line.frames)
    for packets in cut_sizes(len(line.frames)):
        state = followed(cut(batch_of(line.frames), packets))
        assert writes_of(state) == writes_by_the_rules(rules)
        assert told(state)[1] == rules.findings()
    return [one.outcome for one in rules.writes]


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("begin", [Line.open, lambda line: line])
@pytest.mark.parametrize("together", [True, False])
def test_the_next_reply_is_none_of_it(length: bytes, begin: object, together: bool) -> None:
    assert callable(begin)
    asks = b"HEAD / HTTP/1.1\r\n%b\r\n" % length
    line: Line = begin(Line()).ask(asks)
    if together:
        line = line.answer(REPLY).ask(WRITE).answer(DONE)
    else:
        line = line.answer(REPLY[:20]).answer(REPLY[20:]).ask(WRITE).answer(DONE[:30]).answer(DONE[30:])
    assert outcomes(line.ask(NEXT).answer(REFUSED)) == ["confirmed", "refused"]


@pytest.mark.parametrize("length", LENGTHS)
def test_so_it_is_behind_requests_that_wait(length: bytes) -> None:
    asks = b"HEAD / HTTP/1.1\r\n%b\r\n" % length
    line = Line().open().ask(WRITE).ask(asks).answer(DONE + REPLY).ask(NEXT).answer(REFUSED)
    assert outcomes(line) == ["confirmed", "refused"]
    line = Line().open().ask(WRITE + asks).answer(DONE).answer(REPLY).ask(NEXT).answer(REFUSED)
    assert outcomes(line) == ["confirmed", "refused"]


def test_one_that_comes_before_its_request_is_whole_has_none() -> None:
    asks = b"HEAD / HTTP/1.1\r\nContent-Length: 10\r\n\r\n"
    for begun in (Line().open(), Line().open().ask(WRITE).answer(DONE)):
        line = begun.ask(asks + b"x" * 4).answer(REPLY).ask(b"x" * 6).ask(NEXT).answer(REFUSED)
        assert outcomes(line)[-1] == "refused"
        line = line.ask(asks).answer(REPLY[:9]).ask(b"x" * 10).answer(REPLY[9:]).ask(WRITE).answer(DONE)
        assert outcomes(line)[-1] == "confirmed"


def test_what_is_asked_before_is_not_head_for_it() -> None:
    """A request that is no HEAD has begun behind one that was."""
    line = Line().open().ask(b"HEAD / HTTP/1.1\r\n\r\n").answer(REPLY).ask(WRITE).answer(DONE).ask(WRITE[:-4])
    assert outcomes(line.answer(REFUSED).ask(WRITE[-4:]).ask(NEXT).answer(DONE))[1:] == ["refused", "confirmed"]
