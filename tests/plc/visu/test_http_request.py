"""Requests out of the bytes of a connection: every tolerance, every limit, and whatever may come."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.plc.visu.http_request import (
    MOST_BYTES,
    MOST_HEAD_BYTES,
    Flaw,
    HttpRequest,
    next_request,
    waits_for_continue,
)
from tests.laws import examples

POST = b"POST /plc/webvisu.htm HTTP/1.1\r\n"
BODY = b"|0|1|0|4|0|6|8|"
ASKED = HttpRequest("POST", "/plc/webvisu.htm", BODY)


def zipped(content: bytes) -> bytes:
    return gzip.compress(content, mtime=0)


def requests_in(data: bytes) -> list[HttpRequest | Flaw]:
    """Return all that is found in the bytes of a connection that has ended, up to the first flaw."""
    found = []
    while True:
        one, stop = next_request(data, ended=True)
        if one is None:
            return found
        found.append(one)
        if isinstance(one, Flaw):
            return found
        data = data[stop:]


@pytest.mark.parametrize(
    "data",
    [
        POST + b"Content-Length: 15\r\n\r\n" + BODY,
        POST + b"CONTENT-LENGTH:15\r\nHost:\r\n\r\n" + BODY,
        POST + b"Content-length: 15, 15\r\nContent-Length: 15\r\n\r\n" + BODY,
        b"\r\n\r\n" + POST + b"Content-Length: 15\r\n\r\n" + BODY,
        POST.replace(b"\r", b"") + b"Content-Length: 15\n\n" + BODY,
        POST + b"Content-Type: image/gif\r\nno header at all\r\n\r\n" + BODY,
        POST + b"\r\n" + BODY,
        POST + b"Transfer-Encoding: chunked\r\nContent-Length: 3\r\n\r\n5\r\n|0|1|\r\na\r\n0|4|0|6|8|\r\n0\r\n\r\n",
        POST + b"transfer-encoding: CHUNKED\r\n\r\nF;x=y\n" + BODY + b"\n0\r\nTrailer: x\r\n\r\n",
        POST + b"Content-Encoding: gzip\r\n\r\n" + zipped(BODY),
        POST
        + b"Content-Encoding: x-gzip\r\nTransfer-Encoding: chunked\r\n\r\n%x\r\n%s\r\n0\r\n\r\n"
        % (len(zipped(BODY)), zipped(BODY)),
        POST + b"Content-Encoding: deflate\r\n\r\n" + zlib.compress(BODY),
        POST + b"Content-Encoding: deflate\r\n\r\n" + zlib.compress(BODY)[2:-4],
        POST + b"Content-Encoding: identity\r\n\r\n" + BODY,
    ],
)
def test_requests_of_every_kind_are_found_whole(data: bytes) -> None:
    assert requests_in(data) == [ASKED]
    for cut in range(len(data)):
        assert next_request(data[:cut], ended=False)[0] is None


@pytest.mark.parametrize(
    ("head", "closes"),
    [
        (b"GET / HTTP/1.1\r\n\r\n", False),
        (b"GET / HTTP/1.1\r\nConnection: keep-alive\r\n\r\n", False),
        (b"GET / HTTP/1.1\r\nConnection: Close\r\n\r\n", True),
        (b"GET / HTTP/1.1\nCONNECTION: te, close\n\n", True),
        (b"GET / HTTP/1.0\r\n\r\n", True),
        (b"GET / HTTP/1.0\nHost: x\n\n", True),
        (b"GET / HTTP/1.0\r\nConnection: Keep-Alive\r\n\r\n", False),
    ],
)
def test_who_wants_the_connection_to_end_is_known(head: bytes, closes: bool) -> None:
    assert requests_in(head) == [HttpRequest("GET", "/", closes=closes)]


@pytest.mark.parametrize(
    ("data", "waits"),
    [
        (POST + b"Content-Length: 15\r\nExpect: 100-continue\r\n\r\n", True),
        (POST + b"content-length: 15\nexpect: 100-Continue\n\n", True),
        (POST + b"Content-Length: 15\r\nExpect: 100-continue\r\n\r\n|", False),
        (POST + b"Content-Length: 15\r\nExpect: 100-continue\r\n", False),
        (POST + b"Content-Length: 15\r\n\r\n", False),
        (b"", False),
    ],
)
def test_who_waits_to_be_asked_for_a_body_is_known(data: bytes, waits: bool) -> None:
    assert waits_for_continue(data) == waits


@pytest.mark.parametrize(
    ("data", "flaw"),
    [
        (b"SSH-2.0-x\r\n", Flaw.NO_HTTP),
        (b"GET / HTTP/2.0\r\n", Flaw.NO_HTTP),
        (POST + b"Content-Length: x\r\n\r\n", Flaw.NO_HTTP),
        (POST + b"Content-Length: 1\r\nContent-Length: 2\r\n\r\n", Flaw.NO_HTTP),
        (POST + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n", Flaw.NO_HTTP),
        (POST + b"Content-Encoding: gzip\r\nContent-Length: 7\r\n\r\nnothing", Flaw.NO_HTTP),
        (POST + b"Content-Length: 1048577\r\n\r\n", Flaw.BODY_TOO_LONG),
        (POST + b"\r\n" + bytes(1_048_577), Flaw.BODY_TOO_LONG),
        (b"GET / HTTP/1.1\r\nX: " + bytes(MOST_HEAD_BYTES), Flaw.HEAD_TOO_LONG),
        (b"G" * MOST_HEAD_BYTES, Flaw.HEAD_TOO_LONG),
        (b"\r\n" * MOST_HEAD_BYTES, Flaw.HEAD_TOO_LONG),
    ],
)
def test_what_is_none_is_told_as_soon_as_it_is_known(data: bytes, flaw: Flaw) -> None:
    assert next_request(data, ended=False)[0] is flaw


@pytest.mark.parametrize(
    ("data", "flaw"),
    [
        (b"\x16\x03\x01\n", Flaw.NO_HTTP),
        (b"|0|1|0|4|0|6|8|\n", Flaw.NO_HTTP),
        (b"FETCH / HTTP/1.1\r\n\r\n", Flaw.NO_HTTP),
        (b"GET / HTTP/2.0\r\n\r\n", Flaw.NO_HTTP),
        (b"GET /a b HTTP/1.1\r\n\r\n", Flaw.NO_HTTP),
        (b"GET / HTTP/1.1\r\n", Flaw.NO_HTTP),
        (b"G", Flaw.NO_HTTP),
        (POST + b"Content-Length: -1\r\n\r\n", Flaw.NO_HTTP),
        (POST + b"Content-Length: 3\r\nContent-Length: 4\r\n\r\n|||", Flaw.NO_HTTP),
        (POST + b"Content-Length: 16\r\n\r\n" + BODY, Flaw.NO_HTTP),
        (POST + b"Content-Length: 99999999999\r\n\r\n", Flaw.NO_HTTP),
        (POST + b"Content-Length: 1048577\r\n\r\n", Flaw.BODY_TOO_LONG),
        (POST + b"\r\n" + bytes(1_048_577), Flaw.BODY_TOO_LONG),
        (POST + b"Transfer-Encoding: chunked\r\n\r\n-1\r\n|\r\n0\r\n\r\n", Flaw.NO_HTTP),
        (POST + b"Transfer-Encoding: chunked\r\n\r\n1\r\n|||\r\n0\r\n\r\n", Flaw.NO_HTTP),
        (POST + b"Transfer-Encoding: chunked\r\n\r\n1\r\n|", Flaw.NO_HTTP),
        (POST + b"Transfer-Encoding: chunked\r\n\r\n" + b"1\r\n|\r\n" * 400_000, Flaw.BODY_TOO_LONG),
        (POST + b"Content-Encoding: gzip\r\n\r\n" + BODY, Flaw.NO_HTTP),
        (POST + b"Content-Encoding: br\r\n\r\n" + BODY, Flaw.NO_HTTP),
        (POST + b"Content-Encoding: gzip\r\n\r\n" + zipped(bytes(10_000_000)), Flaw.NO_HTTP),
        (b"\r\n" * 20_000, Flaw.HEAD_TOO_LONG),
        (b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 4_000, Flaw.HEAD_TOO_LONG),
        (b"y" * 20_000, Flaw.HEAD_TOO_LONG),
    ],
)
def test_what_is_none_is_told(data: bytes, flaw: Flaw) -> None:
    assert requests_in(data) == [flaw]


def test_what_never_ends_is_given_up_soon() -> None:
    for data in (b"GET / HTTP/1.1\r\nX: " + b"y" * MOST_BYTES, b"1" * MOST_BYTES, b"\n" * MOST_BYTES):
        assert isinstance(next_request(data[: 1 << 15], ended=False)[0], Flaw)
    chunked = POST + b"Transfer-Encoding: chunked\r\n\r\n"
    assert next_request(chunked + b"1;" + b"y" * 70_000, ended=False)[0] is Flaw.NO_HTTP
    assert next_request(chunked + b"0\r\n" + b"X: y\r\n" * 20_000, ended=False)[0] is Flaw.NO_HTTP


ONE = st.builds(
    lambda body, chunked: (
        POST
        + (
            b"Transfer-Encoding: chunked\r\n\r\n%x\r\n%s\r\n0\r\n\r\n" % (len(body), body)
            if chunked and body
            else b"Content-Length: %d\r\n\r\n%s" % (len(body), body)
        )
    ),
    st.binary(max_size=40),
    st.booleans(),
)


@given(st.lists(ONE | st.just(b"GET /x HTTP/1.0\r\n\r\n"), max_size=5), st.lists(st.integers(0, 400)))
@examples(60)
def test_pieces_of_any_size_give_the_same(sent: Sequence[bytes], cuts: Sequence[int]) -> None:
    """What follows is no part of what was before it: requests come one behind the other without a pause."""
    whole = b"".join(sent)
    waiting, found, start = b"", list[HttpRequest | Flaw](), 0
    for stop in [*sorted(min(cut, len(whole)) for cut in cuts), len(whole)]:
        waiting, start = waiting + whole[start:stop], stop
        while (one := next_request(waiting, ended=False))[0] is not None:
            found.append(one[0])
            waiting = waiting[one[1] :]
    assert found == requests_in(whole)
    assert (len(found), waiting) == (len(sent), b"")


@given(st.binary(max_size=300) | st.tuples(ONE, st.binary(max_size=30)).map(b"".join), st.booleans())
@examples(80)
def test_no_bytes_raise(data: bytes, ended: bool) -> None:
    found, stop = next_request(data, ended=ended)
    assert 0 <= stop <= len(data)
    assert (stop > 0) == isinstance(found, HttpRequest)
    assert found is not None or not ended or not data.strip(b"\r\n")
