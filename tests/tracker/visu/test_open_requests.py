"""Requests that do not say how long they are: they end where they are answered, or where the client closes its side."""

from __future__ import annotations

import pytest

from tests.laws import every_other
from tests.oracle.builders import SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp import SYN
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_endings import said

HEAD = b"POST /plc/webvisu.htm HTTP/1.0\r\n"
WRITE = HEAD + b"\r\n|1|1|0|4|0|4|6|9.5|"
READ = HEAD + b"\r\n|0|1|0|4|0|4|6|"
CHUNKS = HEAD + b"Transfer-Encoding: chunked\r\n\r\n13\r\n|1|1|0|4|0|4|6|9.5|\r\n"
DONE, VALUE = (b"HTTP/1.0 200 OK\r\nContent-Length: %d\r\n\r\n%b" % (len(body), body) for body in (b"|0|", b"|12.5|"))
NO_LENGTH = b"HTTP/1.0 200 OK\r\n\r\n|0|"
REFUSED = b"HTTP/1.0 413 x\r\nContent-Length: 0\r\n\r\n"


def became(frames: list[Frame]) -> list[tuple[str | None, str]]:
    """Return what was written, and what became of it; the rules say the same, and so does each cut of the frames."""
    rules = by_the_rules(frames)
    for packets in every_other(1, 2, 3, len(frames)):
        state = followed(cut(batch_of(frames), packets))
        assert writes_of(state) == writes_by_the_rules(rules)
        rows, findings = told(state)
        assert findings == rules.findings()
        names = ("reads", "writes", "replies", "unanswered", "cut")
        assert [[row[name] for name in names] for row in rows] == [
            [row[name] for name in names] for row in rules.rows()
        ]
    return [(one.new, one.outcome) for one in rules.writes]


def asked(request: bytes = WRITE) -> Line:
    return Line().open().ask(request).wait(SECOND // 10)


@pytest.mark.parametrize("request_", [WRITE, CHUNKS, CHUNKS + b"0\r\n"])
@pytest.mark.parametrize(
    ("end", "outcome"),
    [
        (lambda line: line.answer(DONE), "confirmed"),
        (lambda line: line.answer(DONE).close(False).close(True), "confirmed"),
        (lambda line: line.answer(DONE).close(False).reset(True), "confirmed"),
        (lambda line: line.answer(DONE).reset(False), "confirmed"),
        (lambda line: line.answer(NO_LENGTH).close(False).close(True), "confirmed"),
        (lambda line: line.answer(b"HTTP/1.1 100 Continue\r\n\r\n").answer(DONE), "confirmed"),
        (lambda line: line.answer(REFUSED).close(False).close(True), "refused"),
        (lambda line: line.answer(DONE[:-2]).close(False).close(True), "unanswered"),
        (lambda line: line.close(False).close(True), "unanswered"),
        (lambda line: line.reset(False), "unanswered"),
        (lambda line: line.reset(True), "unanswered"),
        (lambda line: line.segment(True, flags=SYN, seq=77), "open"),
        (lambda line: line.answer(DONE[:-2]).reset(False), "unanswered"),
        (lambda line: line.answer(NO_LENGTH).reset(False), "confirmed"),
        (lambda line: line.say(False, DONE, captured=len(DONE) - 1).close(False), "open"),
    ],
)
def test_what_is_answered_before_the_client_closes_its_side(request_: bytes, end: object, outcome: str) -> None:
    assert callable(end)
    assert became(end(asked(request_)).frames) == [("9.5", outcome)]


@pytest.mark.parametrize("end", [Line.reset, lambda line, side: line.segment(side, flags=SYN, seq=77)])
@pytest.mark.parametrize(
    "request_", [WRITE[:-1], WRITE[:-2], WRITE[:-9], CHUNKS[:-4], WRITE.replace(b"|1|1|0", b"|1|2|0")]
)
def test_what_was_to_follow_where_the_connection_is_broken_off_nobody_knows(request_: bytes, end: object) -> None:
    assert callable(end)
    for by_client in (True, False):
        assert became(end(asked(request_), by_client).frames) == []


def test_of_a_request_that_was_broken_off_the_wait_begins_with_its_last_byte() -> None:
    line = asked(WRITE[:30]).ask(WRITE[30:]).wait(SECOND).reset(True)
    assert became(line.frames) == [("9.5", "unanswered")]
    assert said(line.frames)[-1] == f"no reply to frame {len(line.frames)}, given up after 1.0 s"


def test_more_may_be_asked_behind_it() -> None:
    line = asked().answer(DONE).ask(READ).answer(VALUE).ask(CHUNKS).answer(DONE).ask(WRITE).answer(REFUSED)
    assert became(line.frames) == [("9.5", "confirmed"), ("9.5", "confirmed"), ("9.5", "refused")]


def test_it_ends_behind_those_that_wait_in_front_of_it() -> None:
    get = b"GET /plc/x.htm HTTP/1.1\r\n\r\n"
    line = Line().open().ask(get + get).ask(WRITE[:-3]).answer(VALUE).ask(WRITE[-3:]).answer(VALUE)
    assert became(line.frames) == []
    assert became(line.answer(DONE).frames) == [("9.5", "confirmed")]


def test_what_comes_before_the_answer_belongs_to_it() -> None:
    line = asked(WRITE[:20]).ask(WRITE[20:-4]).answer(DONE[:9]).ask(WRITE[-4:]).answer(DONE[9:])
    assert became(line.frames) == [("9.5", "confirmed")]


def test_of_chunks_that_are_answered_within_one_nobody_knows_what_they_ask_for() -> None:
    line = asked(CHUNKS[:-4]).answer(REFUSED).ask(CHUNKS[-4:] + b"0\r\n\r\n")
    assert became(line.frames) == []
    assert became(line.ask(WRITE).answer(DONE).frames) == [("9.5", "confirmed")]


@pytest.mark.parametrize("end", [Line.reset, lambda line, side: line.segment(side, flags=SYN, seq=77)])
def test_a_reply_that_is_missing_is_one_to_it_however_the_connection_is_over(end: object) -> None:
    """What was asked for is whole then, though only the begin of another connection shows the end of this one."""
    assert callable(end)
    lost = asked(WRITE[:-1]).lose(False, len(DONE)).segment(True)
    assert became(end(lost, True).frames) == [("9.5", "open")]
    rows, _ = told(followed([batch_of(lost.frames)]))
    assert (rows[0]["writes"], rows[0]["cut"]) == (1, 1)


def test_a_body_for_which_there_is_no_room_ends_where_it_is_answered() -> None:
    line = Line().open().ask(WRITE)
    for _ in range(40):
        line.ask(b"x" * 30_000)
    assert became(line.answer(DONE).ask(WRITE).answer(REFUSED).frames) == [("9.5", "refused")]


def test_a_reply_for_which_there_is_no_room_ends_with_its_connection() -> None:
    line = asked().answer(NO_LENGTH)
    for _ in range(40):
        line.answer(b"x" * 30_000)
    assert became(line.close(False).close(True).frames) == [("9.5", "open")]
    rows, _ = told(followed(cut(batch_of(line.frames), 5)))
    assert rows[0]["replies"] == 1
