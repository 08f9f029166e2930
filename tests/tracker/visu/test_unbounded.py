"""Heads that do not say in one number how long the body is, malformed chunks, and headers that take several lines."""

from __future__ import annotations

import pytest

from nvscope.findings.judge import judge
from nvscope.protocols.table import judges_of
from nvscope.protocols.visu import VISU
from tests.laws import cut_sizes
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import BODY, DONE, HEAD, OTHER, REFUSED
from tests.tracker.visu.test_endings import said

UNKNOWN = "no one number as Content-Length, or malformed chunks: nobody knows where it ends"
WRONG = [b"19\r\nContent-Length: 20", b"-19", b"19, 20", b"+5", b"", b"19,", b"0x13", b"1e9", b"99999999999"]


def with_length(says: bytes, of: bytes = HEAD) -> bytes:
    return of.replace(b"Content-Length: 19", b"Content-Length: " + says)


def became(line: Line) -> list[str]:
    """Return what became of writes: by the rules, too, and the same however the frames are cut."""
    rules = by_the_rules(line.frames)
    for packets in cut_sizes(len(line.frames)):
        state = followed(cut(batch_of(line.frames), packets))
        rows, findings = told(state)
        assert findings == rules.findings()
        assert writes_of(state) == writes_by_the_rules(rules)
        for one, other in zip(rows, rules.rows(), strict=True):
            assert {name: one[name] for name in other if name[-3:] != "_ns"} == {
                name: value for name, value in other.items() if name[-3:] != "_ns"
            }
    return [one[8] for one in writes_of(state)]


def mismatch(line: Line) -> str:
    state = followed([batch_of(line.frames)])
    (found,) = [one for one in judge(state, judges=judges_of([VISU], state)) if one.code == "NV804"]
    return found.message


@pytest.mark.parametrize(
    "head",
    [
        HEAD.replace(b"Length: ", b"Length:\r\n "), HEAD.replace(b"Length: ", b"Length:\n\t\r\n  "),
        HEAD.replace(b"\r\nContent", b"\r\nX: a,\r\n\tb: c\r\nContent"),
        HEAD.replace(b"\r\nContent", b"\r\n Content-Length: 3\r\nContent"), with_length(b"19, 19"),
        with_length(b"19\r\ncontent-length: 019"), with_length(b"19\r\n , 19"),
    ],
)  # fmt: skip
def test_a_header_may_take_several_lines_and_say_the_same_twice(head: bytes) -> None:
    line = Line().open().ask(head + BODY).answer(DONE).ask(head + OTHER).answer(REFUSED)
    assert became(line) == ["confirmed", "refused"]
    assert not any(UNKNOWN in one for one in said(line.frames))


@pytest.mark.parametrize("says", WRONG)
@pytest.mark.parametrize("together", [True, False])
def test_a_write_of_unknown_length_is_told_and_so_is_its_reply(says: bytes, together: bool) -> None:
    head = with_length(says)
    line = Line().open()
    line = line.ask(head + BODY) if together else line.ask(head).ask(BODY[:5]).ask(BODY[5:])
    line.answer(DONE).ask(HEAD + OTHER).answer(DONE)
    assert became(line) == ["confirmed", "confirmed"]
    assert said(line.frames)[1] == UNKNOWN
    assert mismatch(line) == (
        "1 request or reply between 10.0.0.1 and 10.0.0.5: no one number as Content-Length, or malformed chunks: "
        "nobody knows where they end."
    )


@pytest.mark.parametrize("says", WRONG)
def test_it_goes_on_where_the_next_one_begins(says: bytes) -> None:
    head = with_length(says)
    for more in (HEAD + OTHER, head + OTHER):
        line = Line().open().ask(head + BODY + more[:30]).ask(more[30:]).answer(DONE).answer(REFUSED)
        assert became(line) == ["confirmed", "refused"]


def test_what_is_not_whole_by_what_it_asks_for_is_no_write() -> None:
    head = with_length(b"19, 20")
    for body in (BODY[:9], BODY + b"more", b""):
        line = Line().open().ask(head + body).answer(REFUSED).ask(HEAD + OTHER).answer(DONE)
        assert became(line) == ["confirmed"]
        assert UNKNOWN in said(line.frames)
        assert became(Line().open().ask(head + body).answer(DONE).ask(HEAD + OTHER).answer(DONE)) == ["confirmed"]


@pytest.mark.parametrize("end", ["client closes", "server closes", "client resets", "server resets", "hole"])
@pytest.mark.parametrize("body", [BODY, BODY[:9]])
def test_it_may_end_with_its_direction(end: str, body: bytes) -> None:
    line = Line().open().ask(with_length(b"19, 20") + body)
    if end == "hole":
        line.lose(True, 3).segment(False).ask(HEAD + OTHER).answer(DONE)
    elif end.endswith("closes"):
        line.close("client" in end).close("client" not in end)
    else:
        line.reset("client" in end)
    became(line)


@pytest.mark.parametrize("says", WRONG)
def test_a_reply_of_unknown_length_is_told_and_the_next_one_is_read(says: bytes) -> None:
    start = with_length(says, b"HTTP/1.1 %d x\r\nContent-Length: 19\r\n\r\n")
    good = Line().open().ask(HEAD + BODY).answer(start % 200 + b"|0|").ask(HEAD + OTHER).answer(DONE)
    assert became(good) == ["open", "confirmed"]
    assert said(good.frames)[1].startswith("reply not read, nobody knows where it ends (")
    assert UNKNOWN in said(good.frames)
    line = Line().open().ask(HEAD + BODY).ask(HEAD + OTHER).answer(start % 500 + b"|0|" + DONE)
    assert became(line) == ["refused", "confirmed"]


def test_of_other_requests_it_is_not_told() -> None:
    get = b"GET /plc/x.htm HTTP/1.1\r\nContent-Length: x\r\n\r\n"
    line = Line().open().ask(get).answer(DONE).ask(HEAD + BODY).answer(DONE)
    assert became(line) == ["confirmed"]
    assert not any(UNKNOWN in one for one in said(line.frames))


CHUNKED = b"Transfer-Encoding: chunked\r\n\r\n"
IN_CHUNKS = HEAD[: HEAD.index(b"Content-Length")] + CHUNKED
MALFORMED = [b"%x\r\n%s\r\nzz\r\n", b"zz%x\r\n%s\r\n", b"%x\r\n%sX\r\n", b"-%x\r\n%s\r\n"]


@pytest.mark.parametrize("chunks", MALFORMED, ids=lambda one: f"{one[:9]!r}")
def test_malformed_chunks_are_told_of_a_request_and_of_a_reply(chunks: bytes) -> None:
    line = Line().open().ask(IN_CHUNKS + chunks % (len(BODY), BODY)).answer(DONE).ask(HEAD + OTHER).answer(DONE)
    assert became(line) == ["confirmed"]
    assert said(line.frames)[:2] == ["not read: its chunks are malformed", UNKNOWN]
    assert mismatch(line).startswith("1 request or reply between 10.0.0.1 and 10.0.0.5: no one number as ")
    start = b"HTTP/1.1 200 OK\r\n" + CHUNKED
    line = Line().open().ask(HEAD + BODY).answer(start + chunks % (3, b"|0|")).ask(HEAD + OTHER).answer(DONE)
    assert became(line) == ["open", "confirmed"]
    assert said(line.frames)[1:3] == ["not read: its chunks are malformed", UNKNOWN]
    other = Line().open().ask(IN_CHUNKS.replace(b"webvisu.htm", b"other") + b"1\r\n<\r\n" + chunks % (3, b"<x>"))
    assert told(followed([batch_of(other.answer(DONE).frames)])) == ([], [])


@pytest.mark.parametrize("by_client", [True, False])
@pytest.mark.parametrize("sent", [b"13\r\n" + BODY[:9], b"9\r\n%s\r\n" % BODY[:9], b""])
def test_chunks_that_a_reset_breaks_off_are_a_part(sent: bytes, by_client: bool) -> None:
    line = Line().open().ask(IN_CHUNKS + sent).reset(by_client)
    assert became(line) == []
    reset = [] if by_client else ["no reply to frame 5, connection reset by the controller"]
    assert said(line.frames) == [f"part of a {'write' if sent else 'request'}, the rest was never sent", *reset]
