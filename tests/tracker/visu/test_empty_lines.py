"""Empty lines between messages: they are no body, but where one of so many bytes is said."""

from __future__ import annotations

import pytest

from tests.laws import cut_sizes
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import BODY, DONE, HEAD, REFUSED
from tests.tracker.visu.test_rules import near

WRITE = HEAD + BODY
ASKS = b"HEAD / HTTP/1.1\r\n\r\n"
READ = HEAD.replace(b"19", b"15") + b"|0|1|0|4|0|4|6|"
VALUE = b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\n|7.5|"


def outcomes(line: Line) -> list[str]:
    """Return what became of writes, by the rules, too, and the same however the frames are cut."""
    rules = by_the_rules(line.frames)
    for packets in cut_sizes(len(line.frames)):
        state = followed(cut(batch_of(line.frames), packets))
        assert writes_of(state) == writes_by_the_rules(rules)
        assert told(state) == ([near(row) for row in rules.rows()], rules.findings())
    return [one.outcome for one in rules.writes]


def reply(length: str, body: bytes) -> bytes:
    return f"HTTP/1.1 200 OK\r\n{length}\r\n\r\n".encode() + body


@pytest.mark.parametrize("empty", [b"\n", b"\r\n", b"\r\n\r\n"])
@pytest.mark.parametrize("together", [True, False])
def test_a_reply_of_nothing_but_empty_lines_is_the_reply(empty: bytes, together: bool) -> None:
    """Behind the begin of a capture, where a reply may be one to HEAD, which has none whatever it says."""
    said = reply(f"Content-Length: {len(empty)}", empty)
    line = Line().ask(READ)
    line = line.answer(said) if together else line.answer(said[: -len(empty)]).answer(empty)
    assert outcomes(line.ask(WRITE).answer(DONE)) == ["confirmed"]
    state = followed([batch_of(line.frames)])
    assert ([row["unanswered"] for row in told(state)[0]], [one["code"] for one in told(state)[1]]) == ([0], ["NV801"])


@pytest.mark.parametrize("length", ["Content-Length: 77", "Content-Length: 3", "Transfer-Encoding: chunked", "Date: x"])
@pytest.mark.parametrize("empty", [b"", b"\n", b"\r\n"])
def test_in_front_of_another_reply_they_are_no_body(length: str, empty: bytes) -> None:
    """What came before is the reply to a HEAD that nobody captured."""
    line = Line().answer(reply(length, b"")).lose(True, len(WRITE)).answer(empty + DONE)
    assert outcomes(line.ask(WRITE).answer(empty + REFUSED)) == ["refused"]


@pytest.mark.parametrize("empty", [b"", b"\n", b"\r\n"])
def test_in_front_of_another_request_they_are_no_body(empty: bytes) -> None:
    expects = HEAD.replace(b"\r\n\r\n", b"\r\nExpect: 100-continue\r\n\r\n")
    line = Line().open().ask(expects).answer(REFUSED).ask(empty + WRITE).answer(DONE)
    assert outcomes(line) == ["confirmed"]


@pytest.mark.parametrize("text", [b"1", b"H", b"HTTP/1.1 ", b"HTTP/1.1 x\r\n"])
@pytest.mark.parametrize("length", ["Content-Length: x", "Content-Length: {}"])
def test_a_reply_is_there_when_nothing_may_become_another_one(text: bytes, length: str) -> None:
    """Byte by byte: with the first one that does not begin a status line, even if that is behind its body."""
    data = reply(length.format(len(text)), text) + DONE
    line = Line().ask(READ).answer(VALUE).ask(READ)
    for at in range(len(data)):
        line.answer(data[at : at + 1])
    outcomes(line.ask(WRITE).answer(DONE))
