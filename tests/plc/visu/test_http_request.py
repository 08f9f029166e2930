"""Requests out of bytes: however they are cut into pieces, and whatever they are."""

from __future__ import annotations

import gzip

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.http import MOST_BODY_BYTES
from nvscope.plc.visu.http_request import MOST_HEAD_BYTES, Flaw, HttpRequest, next_request
from tests.laws import examples
from tests.plc.visu.peers import post

BODY = b"|0|1|0|4|0|6|8|"
CHUNKED = b"POST /a HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n5\r\n|0|1|\r\na\r\n0|4|0|6|8|\r\n0\r\n\r\n"
PACKED = gzip.compress(BODY, mtime=0)


@pytest.mark.parametrize(
    "data",
    [
        post(BODY, "/a"),
        b"\r\n" + post(BODY, "/a"),
        b"POST /a HTTP/1.0\ncontent-LENGTH:15\n\n" + BODY,
        CHUNKED,
        b"POST /a HTTP/1.1\r\nContent-Encoding: gzip\r\nContent-Length: %d\r\n\r\n" % len(PACKED) + PACKED,
    ],
)
def test_a_request_is_whole_with_its_last_byte(data: bytes) -> None:
    assert [next_request(data[:end], ended=False) for end in range(len(data))] == [(None, 0)] * len(data)
    assert next_request(data + b"GET ", ended=False) == (HttpRequest("POST", "/a", BODY), len(data))


def test_without_a_length_it_goes_on_to_the_end() -> None:
    data = b"POST /a HTTP/1.0\r\n\r\n" + BODY
    assert next_request(data, ended=False) == (None, 0)
    assert next_request(data, ended=True) == (HttpRequest("POST", "/a", BODY), len(data))


@pytest.mark.parametrize(
    ("data", "flaw"),
    [
        (b"SSH-2.0-x\r\n", Flaw.NO_HTTP),
        (b"\0\xff\n", Flaw.NO_HTTP),
        (b"GET / HTTP/2.0\r\n", Flaw.NO_HTTP),
        (b"POST /a HTTP/1.1\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n", Flaw.NO_HTTP),
        (b"POST /a HTTP/1.1\r\nContent-Length: x\r\n\r\n", Flaw.NO_HTTP),
        (b"POST /a HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n", Flaw.NO_HTTP),
        (b"POST /a HTTP/1.1\r\nContent-Length: %d\r\n\r\n" % (MOST_BODY_BYTES + 1), Flaw.BODY_TOO_LONG),
        (b"GET / HTTP/1.1\r\nX: " + bytes(MOST_HEAD_BYTES), Flaw.HEAD_TOO_LONG),
        (b"G" * MOST_HEAD_BYTES, Flaw.HEAD_TOO_LONG),
        (b"\r\n" * MOST_HEAD_BYTES, Flaw.HEAD_TOO_LONG),
        (b"POST /a HTTP/1.0\r\n\r\n" + bytes(MOST_BODY_BYTES + 1), Flaw.BODY_TOO_LONG),
        (
            b"POST /a HTTP/1.1\r\nContent-Encoding: gzip\r\nContent-Length: 7\r\n\r\nnothing",
            Flaw.NO_HTTP,
        ),
    ],
)
def test_what_is_no_request_is_told_as_soon_as_it_is_known(data: bytes, flaw: Flaw) -> None:
    assert next_request(data, ended=False)[0] is flaw


@given(st.binary(max_size=300) | st.builds(lambda cut, more: CHUNKED[:cut] + more, st.integers(0, 90), st.binary()))
@examples(300)
def test_no_bytes_raise_and_the_end_decides(data: bytes) -> None:
    found, stop = next_request(data, ended=True)
    assert found is not None or not data.strip(b"\r\n")
    assert 0 <= stop <= len(data)
