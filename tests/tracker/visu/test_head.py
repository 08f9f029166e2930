"""Replies to HEAD have no body, whatever their length says, and whatever that of the request says."""

from __future__ import annotations

import pytest

from tests.laws import crossed, cut_sizes
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import BODY, DONE, HEAD, OTHER

WRITE, NEXT = HEAD + BODY, HEAD + OTHER
REPLY = b"HTTP/1.1 200 OK\r\nContent-Length: 19\r\n\r\n"
LONG = REPLY.replace(b"19", b"190")
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


@pytest.mark.parametrize(
    ("length", "together", "begin"), crossed(LENGTHS, [True, False], [Line.open, lambda line: line])
)
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


@pytest.mark.parametrize("together", [True, False])
def test_behind_missing_requests_any_reply_may_be_to_one(together: bool) -> None:
    """The HEAD is missing with the write in front of it, whose reply has a body."""
    asks = b"HEAD / HTTP/1.1\r\n\r\n"
    for known in (Line().open(), Line().open().ask(asks).answer(LONG), Line()):
        line = known.ask(WRITE).answer(DONE).lose(True, len(NEXT))
        line = line.ask(asks) if together else line.lose(True, len(asks)).segment(False)
        line = line.answer(DONE + LONG) if together else line.answer(DONE).answer(LONG)
        assert outcomes(line.ask(NEXT).answer(REFUSED).ask(WRITE).answer(DONE)) == ["confirmed", "refused", "confirmed"]


def test_requests_before_the_capture_may_be_several() -> None:
    line = Line().answer(DONE).answer(LONG).ask(NEXT).answer(REFUSED).ask(WRITE).answer(DONE)
    assert outcomes(line) == ["refused", "confirmed"]


def test_where_the_client_lost_step_tells_nothing_of_the_next_batch() -> None:
    """It does so behind more of a reply than its rest, which comes behind missing bytes of it."""
    line = Line().open().ask(b"HEAD / HTTP/1.1\r\n\r\n").answer(LONG).ask(WRITE)
    long = b"HTTP/1.1 200 OK\r\nContent-Length: 81\r\n\r\n|" + b"0|" * 40
    line.answer(long[:-20]).lose(True, len(NEXT)).ask(WRITE)
    line.answer(long[-20:-9]).lose(False, 4).answer(long[-5:]).segment(True)
    line.answer(DONE).answer(DONE)
    assert outcomes(line.ask(NEXT).answer(REFUSED))[1:] == ["open", "refused"]
