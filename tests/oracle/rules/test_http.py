"""HTTP in one direction: each rule by a few bytes. Numbers among the parts are holes."""

from __future__ import annotations

import gzip
import zlib

import pytest

from tests.oracle.rules.http import LONGEST_REQUEST_LINE, Reader
from tests.oracle.rules.http_bodies import MOST_BODY
from tests.oracle.rules.http_heads import LONGEST_OTHER_LINE
from tests.oracle.rules.http_message import Lost, Message

GET, OK = b"GET /a HTTP/1.1\r\n\r\n", b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok"
POST = b"POST /b HTTP/1.0\r\nContent-Length: 3\r\n\r\n"
END = "end"
RESET = "reset"


def read(
    *parts: bytes | int | str, response: bool = False, in_step: bool = True, to_head: bool = False
) -> list[Message | Lost]:  # fmt: skip
    reader = Reader(response, in_step, lambda: to_head)
    found: list[Message | Lost] = []
    for time, part in enumerate(parts):
        if isinstance(part, bytes):
            found += reader.feed(part, time)
        elif isinstance(part, int):
            found += reader.hole(part)
        else:
            found += reader.end(part == RESET, time)
    return found


def told(*parts: bytes | int | str, response: bool = False, in_step: bool = True, to_head: bool = False) -> list[str]:
    """Return what was read: a method or status and the body, `cut` with what is seen of it, `lost`."""
    lines = []
    for one in read(*parts, response=response, in_step=in_step, to_head=to_head):
        if isinstance(one, Lost):
            lines.append("lost")
            one_dropped = one.dropped
            if one_dropped is None:
                continue
            lines[-1] += " with"
            message = one_dropped
        else:
            lines.append("")
            message = one
        body = "cut " + message.seen.decode() if message.cut else "?" if message.body is None else message.body.decode()
        lines[-1] = f"{lines[-1]} {message.method.decode() or message.status} {body}".strip()
    return lines


def answer(head: str, body: bytes = b"") -> bytes:
    return f"HTTP/1.1 200 OK\r\n{head}\r\n\r\n".encode() + body


def test_requests_and_responses() -> None:
    assert told(GET + POST + b"abcGET /x HTTP/1.1\n\n") == ["GET", "POST abc", "GET"]
    assert told(OK + OK, response=True) == ["200 ok", "200 ok"]


def test_it_may_come_byte_by_byte() -> None:
    data = b"\r\n" + GET + POST + b"abc"
    assert told(*(data[at : at + 1] for at in range(len(data)))) == ["GET", "POST abc"]


@pytest.mark.parametrize(
    ("head", "body"),
    [
        ("CONTENT-length:3", "abc"),
        ("content-length: \t 3 ", "abc"),
        ("Content-Length: 3\nX: y", "abc"),
        ("Content-Length: 03\r\nContent-Length: 3", "abc"),
        ("Transfer-Encoding: chunked\r\nContent-Length: x", ""),
        ("No colon\r\n Content-Length: 9\r\nContent-Length: 3", "abc"),
    ],
)
def test_heads(head: str, body: str) -> None:
    assert told(answer(head, b"abc" if body else b"0\r\n\r\n"), response=True) == [f"200 {body}".strip()]


@pytest.mark.parametrize("length", ["x", "", "-1", "5, 6", str(2**30 + 1), "1\r\nContent-Length: 2"])
def test_where_a_wrong_length_is_said_the_next_message_is_searched(length: str) -> None:
    assert told(answer(f"Content-Length: {length}", b"abc" + OK), response=True) == ["200 ?", "200 ok"]


@pytest.mark.parametrize(
    "line",
    [b"get /a HTTP/1.1", b"GET  /a HTTP/1.1", b"GET /a HTTP/2.0", b"GET /a b HTTP/1.1", b"GET /a", b"BREW /a HTTP/1.1",
     b"GET /a HTTP/1.1 ", b"\x16\x03\x01"],
)  # fmt: skip
def test_what_is_foreign(line: bytes) -> None:
    assert told(line + b"\r\n\r\n" + GET) == ["lost", "GET"]
    assert told(line) == (["lost"] if line[:1] == b"\x16" else [])
    assert told(line[:1]) == []
    assert told(b"HTTP/1.1 2000\r\n" + OK, response=True) == ["lost", "200 ok"]


def test_a_search_finds_a_start_line_anywhere_when_it_is_complete() -> None:
    assert told(b"...GET /a", b" HTTP/1.1\r", b"\n\r\n", in_step=False) == ["GET"]
    assert told(b"...GET /a HTTP/1.1\r\n\r\n", in_step=False) == ["GET"]
    assert told(b"...GET /a HTTP/1.1\r\n\r\n") == ["lost", "GET"]
    long = b"/" + b"a" * (LONGEST_REQUEST_LINE - len(b"GET / HTTP/1.1\n\n"))
    assert told(b"GET " + long + b" HTTP/1.1\n\n", in_step=False) == ["GET"]
    assert told(b"GET " + long + b"aa HTTP/1.1\n\n") == ["lost"]


def test_a_head_has_a_limit() -> None:
    most = 65536 - len(b"GET /a HTTP/1.1\r\nX: \r\n\r\n")
    for more, outcome in ((0, ["GET", "GET"]), (1, ["lost", "GET"])):
        assert told(b"GET /a HTTP/1.1\r\nX: " + b"x" * (most + more) + b"\r\n\r\n" + GET) == outcome
    for begin, longest in ((b"x", LONGEST_OTHER_LINE), (b"GET ", LONGEST_REQUEST_LINE)):
        assert told(begin.ljust(longest - 1, b"x")) == []
        assert told(begin.ljust(longest, b"x")) == ["lost"]


def test_bodies_up_to_the_end() -> None:
    post, response = b"POST /a HTTP/1.0\r\n\r\nabc", b"HTTP/1.0 200 OK\r\n\r\nabc"
    assert told(post, END) == ["POST abc"]
    (broken_off,) = read(post, RESET)
    assert isinstance(broken_off, Message)
    assert (broken_off.broken_off, broken_off.body) == (True, b"abc")
    assert told(response, END, response=True) == told(response, RESET, response=True) == ["200 abc"]
    assert told(GET) == ["GET"]
    (message,) = read(response, END, response=True)
    assert isinstance(message, Message)
    assert message.arrival == 1


def test_what_is_not_whole_at_the_end() -> None:
    (part,) = read(POST + b"ab", END)
    assert isinstance(part, Message)
    assert (part.part, part.cut, part.seen) == (True, False, b"ab")
    assert told(OK[:-1], END, response=True) == ["200 cut o"]
    assert told(answer("Transfer-Encoding: chunked", b"3\r\nab"), END, response=True) == ["200 cut ab"]
    assert told(OK[:20], END, response=True) == []


@pytest.mark.parametrize("status", [100, 101, 204, 304])
def test_responses_without_a_body(status: int) -> None:
    assert told(b"HTTP/1.1 %d\r\nContent-Length: 9\r\n\r\n" % status + OK, response=True) == [str(status), "200 ok"]


def test_the_response_to_head_has_no_body() -> None:
    assert told(OK[:-2], response=True, to_head=True) == ["200"]


CHUNKED = b"POST /b HTTP/1.1\r\nTransfer-Encoding: gzip , Chunked\r\n\r\n"


@pytest.mark.parametrize(
    "body",
    [
        b"3\r\nabc\r\n0\r\n\r\n",
        b"1;x=y\r\na\r\n02\r\nbc\r\n000\r\n\r\n",
        b"3\nabc\n0\n\n",
        b"3\r\nabc\r\n0\r\nX: y\r\nZ\r\n\r\n",
    ],
)
def test_chunks(body: bytes) -> None:
    assert told(CHUNKED + body + GET) == ["POST abc", "GET"]
    assert told(CHUNKED, *(body[at : at + 1] for at in range(len(body)))) == ["POST abc"]


@pytest.mark.parametrize(
    ("body", "seen"),
    [(b"x\r\n", ""), (b"\r\n", ""), (b"3\r\nabcd\r\n", " abc"), (b"3\r\nabc\rx", " abc"), (b"40000001\r\n", ""),
     (b"000000003\r\nabc", "")],
)  # fmt: skip
def test_behind_malformed_chunks_the_next_message_is_looked_for(body: bytes, seen: str) -> None:
    assert told(CHUNKED + body + b"0\r\n\r\n" + GET) == [f"lost with POST cut{seen}", "GET"]


@pytest.mark.parametrize(
    ("coding", "body"),
    [("gzip", gzip.compress(b"abc", mtime=0)), ("X-Gzip", gzip.compress(b"abc", mtime=0)),
     ("gzip", gzip.compress(b"ab", mtime=0) + gzip.compress(b"c", mtime=0) + b"\0"),
     ("deflate", zlib.compress(b"abc")), ("deflate", zlib.compress(b"abc")[2:-4]), ("identity", b"abc")],
)  # fmt: skip
def test_bodies_are_decoded(coding: str, body: bytes) -> None:
    assert told(answer(f"Content-Encoding: {coding}\r\nContent-Length: {len(body)}", body), response=True) == [
        "200 abc"
    ]


@pytest.mark.parametrize(
    ("coding", "body"),
    [("gzip", b"abc"), ("gzip", gzip.compress(b"abc", mtime=0)[:-1]), ("deflate", b"\xff"), ("br", b"abc"),
     ("gzip", gzip.compress(b"abc", mtime=0) + gzip.compress(b"d", mtime=0)[:-1]),
     ("gzip, gzip", b"abc"), ("gzip", gzip.compress(bytes(MOST_BODY + 1), mtime=0)), ("gzip", b"")],
)  # fmt: skip
def test_bodies_that_are_not_known(coding: str, body: bytes) -> None:
    assert told(answer(f"Content-Encoding: {coding}\r\nContent-Length: {len(body)}", body), response=True) == ["200 ?"]


def test_a_body_has_a_limit() -> None:
    for length, known in ((MOST_BODY, True), (MOST_BODY + 1, False)):
        for head, body in (
            (f"Content-Length: {length}", bytes(length)),
            (
                f"Content-Encoding: gzip\r\nContent-Length: {len(gzip.compress(bytes(length), mtime=0))}",
                gzip.compress(bytes(length), mtime=0),
            ),
        ):
            (message,) = read(answer(head, body), response=True)
            assert isinstance(message, Message)
            assert (message.body is not None) is known


def test_a_hole_inside_a_body_of_known_length_cuts_the_message_and_no_more() -> None:
    assert told(POST, 3, GET) == ["POST cut", "GET"]
    assert told(POST + b"a", 1, b"c" + GET) == ["POST cut a", "GET"]
    assert told(POST + b"a", 1, 1, GET) == ["POST cut a", "GET"]


def test_any_other_hole_loses_step() -> None:
    assert told(POST + b"a", 3, b"c" + GET) == ["lost with POST cut a", "GET"]
    assert told(POST[:-2], 5, b"c" + GET) == ["lost with POST cut", "GET"]
    assert told(b"POST /x", 5, GET) == ["lost with POST cut", "GET"]
    assert told(b"POST", 5, GET) == ["lost with POST cut", "GET"]
    assert told(b"POS", 5, GET) == ["lost", "GET"]
    assert told(GET, 5, GET) == ["GET", "lost", "GET"]
    assert told(b"...", 5, b"T / HTTP/1.1\r\n" + GET, in_step=False) == ["lost", "GET"]
    assert told(CHUNKED + b"3\r\nabc\r\n2\r\nd", 1, GET) == ["lost with POST cut abcd", "GET"]
    assert told(OK[:17], 1, OK, response=True) == ["lost with 200 cut", "200 ok"]
    assert told(OK[:16], 1, OK, response=True) == ["lost", "200 ok"]
    assert told(b"HTTP/1.0 200 OK\r\n\r\nab", 1, b"c", END, response=True) == ["lost with 200 cut ab"]


def test_the_arrival_is_the_time_of_what_came_last_up_to_the_end() -> None:
    reader = Reader(False, True, lambda: False)
    found = [*reader.feed(GET[:5], 9), *reader.feed(GET[5:], 3), *reader.feed(GET, 4), *reader.feed(GET, 10)]
    assert [message.arrival for message in found if isinstance(message, Message)] == [3, 4, 10]


EXPECTING = b"POST /a HTTP/1.1\r\nExpect: 100-Continue\r\nContent-Length: 9\r\n\r\n"


def test_who_expects_an_interim_response_may_send_no_body() -> None:
    assert told(EXPECTING, GET) == told(EXPECTING, GET[:3], GET[3:]) == ["POST", "GET"]
    assert told(EXPECTING + GET[:-2]) == ["POST"]
    assert told(EXPECTING + GET[:9]) == []
    assert told(EXPECTING + b"GET / abc" + GET) == ["POST GET / abc", "GET"]
    assert told(EXPECTING + b"GET /abc\n" + GET) == ["POST GET /abc", "GET"]
    assert told(EXPECTING + b"|0|1|0|4|") == ["POST |0|1|0|4|"]
    assert told(EXPECTING.replace(b"Expect", b"X") + GET[:9]) == ["POST " + GET[:9].decode()]


def test_a_response_of_a_direction_that_began_before_may_be_one_to_head() -> None:
    to_head = b"HTTP/1.1 200 OK\r\nContent-Length: 170\r\n\r\n"
    assert told(to_head + OK, OK, response=True, in_step=False) == ["200", "200 ok", "200 ok"]
    assert told(OK + to_head, OK, response=True, in_step=False) == ["200 ok", "200", "200 ok"]
    assert told(OK + to_head, OK, response=True) == ["200 ok"]
    assert told(to_head + OK, OK, response=True) == []
