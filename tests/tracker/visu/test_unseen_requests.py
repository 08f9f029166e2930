"""Requests that a capture lacks, of pages that make a connection for each of theirs: what is told, and what is not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from nvscope.check.verdict import Verdict
from tests.check.requests import DONE, READ_X, VALUE, WRITE_X, of_frames, post, reply
from tests.oracle.builders import SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told

WRITE = post(WRITE_X)
PICTURE = b"GET /plc/valve.bmp HTTP/1.1\r\n\r\n"
BITMAP = b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\nBM\1\2"
AT = 5


def connection(number: int) -> Line:
    return Line(("10.0.0.1", 50_000 + number), now=number * SECOND).open()


def ended(line: Line) -> Sequence[Frame]:
    return line.close(True).close(False).frames


def page(odd: Line, at: int = AT) -> list[Frame]:
    """Return ten requests, each with a connection of its own, of which one is another one."""
    lines = [connection(number) for number in range(10)]
    polls = [odd if number == at else line.ask(post(READ_X)).answer(reply(VALUE)) for number, line in enumerate(lines)]
    return [frame for line in polls for frame in ended(line)]


def lacking(request: bytes, begin: int, size: int, response: bytes, number: int = AT) -> Line:
    """Return a connection with a request of which some bytes were not captured."""
    line = connection(number)
    for data, is_there in ((request[:begin], True), (request[begin : begin + size], False)):
        line = line.ask(data) if is_there and data else line.lose(True, len(data))
    rest = request[begin + size :]
    return (line.ask(rest) if rest else line).answer(response)


def row_of(frames: Sequence[Frame]) -> dict[str, Any]:
    (row,), findings = told(followed([batch_of(frames)]))
    assert (([row], findings)) == told(followed(cut(batch_of(frames), 3)))
    (expected,) = by_the_rules(frames).rows()
    names = ("connections", "reads", "writes", "replies", "cut", "gap_bytes", "unanswered")
    assert {name: row[name] for name in names} == {name: expected[name] for name in names}
    return row


@pytest.mark.parametrize(("begin", "size"), [(0, len(WRITE)), (0, 20), (10, 20), (0, len(WRITE) - 5)])
def test_a_write_that_is_missing_is_cut_and_nobody_knows_who_wrote(begin: int, size: int) -> None:
    frames = page(lacking(WRITE, begin, size, reply(DONE)))
    row = row_of(frames)
    assert (row["connections"], row["reads"], row["cut"], row["gap_bytes"]) == (10, 9, 1, size)
    (one,) = of_frames(frames, {"check": "writes", "only_by": "192.0.2.1"})
    assert (one.verdict, "bytes of its connections are missing" in one.subjects[0].reason) == (
        Verdict.INCONCLUSIVE,
        True,
    )


def test_a_page_of_which_nothing_else_was_captured_is_known_by_the_reply() -> None:
    row = row_of(ended(lacking(WRITE, 0, 20, reply(DONE))))
    assert (row["connections"], row["cut"], row["gap_bytes"]) == (1, 1, 20)


@pytest.mark.parametrize("at", [0, AT, 9])
@pytest.mark.parametrize("response", [reply(b"", status=500), BITMAP])
def test_what_may_have_been_a_write_is_missing_and_no_request(response: bytes, at: int) -> None:
    frames = page(lacking(WRITE, 0, len(WRITE), response, at), at)
    row = row_of(frames)
    assert (row["connections"], row["cut"], row["gap_bytes"]) == (9, 0, len(WRITE))
    (one,) = of_frames(frames, {"check": "writes", "only_by": "192.0.2.1"})
    assert one.verdict is Verdict.INCONCLUSIVE


def test_a_picture_of_which_bytes_are_missing_hides_no_write() -> None:
    line = connection(AT).ask(PICTURE).answer(BITMAP[:9]).lose(False, len(BITMAP) - 9)
    frames = page(line)
    assert row_of(frames)["gap_bytes"] == 0
    (one,) = of_frames(frames, {"check": "writes", "only_by": "192.0.2.1"})
    assert one.verdict is Verdict.PASS


def test_of_those_who_ask_for_no_variable_nothing_is_told() -> None:
    assert told(followed([batch_of(ended(lacking(PICTURE, 0, 9, BITMAP)))])) == ([], [])
