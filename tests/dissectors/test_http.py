"""Heads of HTTP messages, and how bodies are coded."""

from __future__ import annotations

import gzip
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors import http
from dissectors.http import MOST_BODY_BYTES, Body, Head, Side
from tests.laws import examples


def request(*lines: str, first: str = "POST /plc/webvisu.htm HTTP/1.1") -> Head | None:
    return http.read_head("\r\n".join([first, *lines, "", ""]).encode("latin-1"), Side.CLIENT)


def response(*lines: str, status: int = 200) -> Head | None:
    return http.read_head("\r\n".join([f"HTTP/1.0 {status} OK", *lines, "", ""]).encode("latin-1"), Side.SERVER)


def _zipped(*members: bytes) -> bytes:
    return b"".join(gzip.compress(one, mtime=0) for one in members)


def test_a_request() -> None:
    assert request("Host: a", "Content-Length: 15") == Head(Body.LENGTH, 15, "POST", "/plc/webvisu.htm")
    assert request("cONTENT-lENGTH:15 ") == request("Content-Length: 15", "content-length: 15, 15")
    assert request() == Head(Body.END, 0, "POST", "/plc/webvisu.htm")
    assert request(first="GET /plc/plc_visu.xml HTTP/1.0") == Head(Body.LENGTH, 0, "GET", "/plc/plc_visu.xml")
    assert request("Transfer-Encoding: gzip, Chunked", "Content-Length: 3") == Head(
        Body.CHUNKS, 3, "POST", "/plc/webvisu.htm"
    )


@pytest.mark.parametrize("length", ["x", "-1", "1,2", "", "99999999999", "0x10", "1_0", "²"])
def test_a_wrong_length(length: str) -> None:
    assert request(f"Content-Length: {length}") == Head(Body.END, 0, "POST", "/plc/webvisu.htm", is_unbounded=True)
    assert response(f"Content-Length: {length}") == Head(Body.END, 0, status=200, is_unbounded=True)


def test_a_header_may_take_several_lines() -> None:
    one = Head(Body.LENGTH, 12, "POST", "/plc/webvisu.htm")
    assert request("Content-Length:", " 12") == request("Content-Length: 12", "\t, 12") == one
    assert request(" Content-Length: 13", "Content-Length: 12", " ") == one
    assert request("X: a", "  Content-Length: 13", "Content-Length: 12") == one


def test_a_response() -> None:
    assert response("Content-Length: 3") == Head(Body.LENGTH, 3, status=200)
    assert response() == Head(Body.END, 0, status=200)
    for status in (100, 101, 204, 304):
        for length in ("3", "x"):
            assert response(f"Content-Length: {length}", status=status) == Head(Body.LENGTH, 0, status=status)
    to_head = http.read_head(b"HTTP/1.1 200 OK\r\nContent-Length: x\r\n\r\n", Side.SERVER, answers_head=True)
    assert to_head == Head(Body.LENGTH, 0, status=200)
    interim = response(status=100)
    assert interim is not None
    assert interim.is_interim
    assert response("Content-Encoding: GZIP", "Content-Length: 3") == Head(Body.LENGTH, 3, status=200, coding="gzip")


@pytest.mark.parametrize(
    "line",
    [
        b"GET  /x HTTP/1.1\r\n", b"get /x HTTP/1.1\r\n", b"GET /x HTTP/2.0\r\n", b"GET /x HTTP/1.1 \r\n", b"\r\n",
        b"GET " + b"x" * ((1 << 16) + 1) + b" HTTP/1.1\r\n", b"HTTP/1.1 200 OK\r\n",
    ],
)  # fmt: skip
def test_what_is_no_request_line(line: bytes) -> None:
    assert http.start_of_message(line, 0, len(line), Side.CLIENT) == -1
    assert not http.is_start_line(line, 0, len(line), Side.CLIENT)


def test_a_first_line_is_found_anywhere() -> None:
    data = b"|1|2|HTTP/1.1 20 x\r\nPOST /a HTTP/1.1\r\n"
    assert http.start_of_message(data, 0, len(data), Side.CLIENT) == data.index(b"POST")
    assert http.start_of_message(data, 0, len(data) - 1, Side.CLIENT) == -1
    assert http.start_of_message(data, 0, len(data), Side.SERVER) == -1


def chunks(*parts: bytes, more: bytes = b"") -> bytes:
    return b"".join(b"%x%s\r\n%s\r\n" % (len(part), more, part) for part in (*parts,)) + b"0\r\n\r\n"


@examples(60)
@given(st.lists(st.binary(min_size=1, max_size=40), max_size=6), st.sampled_from([b"", b";a=b", b" "]), st.binary())
def test_chunks(parts: list[bytes], more: bytes, behind: bytes) -> None:
    data = chunks(*parts, more=more)
    found = http.read_chunks(data + behind, 0, len(data + behind))
    assert (found.stop, found.content, found.wrong_at) == (len(data), b"".join(parts), -1)
    for stop in range(len(data)):
        part = http.read_chunks(data, 0, stop)
        assert (part.stop, part.wrong_at) == (-1, -1)
        assert b"".join(parts).startswith(part.content)


PIECES = st.sampled_from([b"3\r\nabc\r\n", b"2;a=b\nab\n", b"0\r\n", b"a: b\r\n", b"\r\n", b"\r", b"1", b"x", b"A\r\n"])


@examples(100)
@given(st.lists(PIECES, max_size=12).map(b"".join), st.lists(st.integers(0, 60), max_size=6))
def test_chunks_that_come_bit_by_bit_are_found_as_at_once(data: bytes, stops: list[int]) -> None:
    reader = http.Chunks()
    for stop in [*sorted(one for one in stops if one < len(data)), len(data)]:
        found, part = http.read_chunks(data, 0, stop), reader.read(data, 0, stop)
        assert (part.stop, part.wrong_at) == (found.stop, found.wrong_at)
        if part.wrong_at >= 0:
            return
        if part.stop >= 0:
            assert part.content == found.content
            return
        assert reader.so_far(data) == found.content


def test_chunks_that_are_whole_are_read_once() -> None:
    reader, data = http.Chunks(), chunks(b"abc", b"de")
    first = len(b"3\r\nabc\r\n")
    assert reader.read(data, 0, first + 2).stop == -1
    assert reader.read(bytes(first) + data[first:], 0, len(data)).content == b"abcde"


@pytest.mark.parametrize(
    "data", [b"x\r\n", b"\r\n", b"3\r\nabcd\r\n", b"3\r\nabc\rx", b"40000001\r\n", b"000000003\r\n"]
)
def test_what_are_no_chunks(data: bytes) -> None:
    whole = http.read_chunks(data, 0, len(data))
    assert whole.wrong_at > 0
    # As soon as it can be known, and not before.
    assert http.read_chunks(data, 0, whole.wrong_at).wrong_at == whole.wrong_at
    assert http.read_chunks(data, 0, whole.wrong_at - 1).wrong_at == -1


@pytest.mark.parametrize(
    ("coding", "content"),
    [
        ("", b"abc"), ("gzip", gzip.compress(b"abc", mtime=0)), ("x-gzip", gzip.compress(b"abc", mtime=0)),
        ("deflate", zlib.compress(b"abc")), ("deflate", zlib.compress(b"abc")[2:-4]),
        ("gzip", _zipped(b"a", b"", b"bc")), ("gzip", _zipped(b"ab", b"c") + b"\0\0 behind"),
        ("gzip", _zipped(*[b""] * 255, b"abc")),
    ],
)  # fmt: skip
def test_content_is_decoded(coding: str, content: bytes) -> None:
    assert http.decoded(content, coding) == b"abc"


@pytest.mark.parametrize(
    ("coding", "content"),
    [
        ("gzip", b"abc"), ("gzip", gzip.compress(b"abc", mtime=0)[:-9]), ("deflate", b"\xff"), ("br", b"abc"),
        ("gzip", b""), ("gzip", _zipped(b"abc", b"d")[:-1]), ("gzip", _zipped(b"abc") + b"\x1f\x8b damaged"),
        ("gzip", _zipped(*[b""] * 256, b"abc")), ("gzip", _zipped(bytes(MOST_BODY_BYTES), b"a")),
        ("gzip", gzip.compress(bytes(MOST_BODY_BYTES + 1), mtime=0)), ("", bytes(MOST_BODY_BYTES + 1)),
    ],
)  # fmt: skip
def test_what_cannot_be_decoded(coding: str, content: bytes) -> None:
    assert http.decoded(content, coding) is None


def test_how_content_begins() -> None:
    assert http.begin_of(_zipped(b"|", b"", b"0|", b"1|0|"), "gzip", 4) == b"|0|1"
    assert http.begin_of(_zipped(b"|0", b"|1|")[:-9], "x-gzip", 64) == b"|0|1|"
    assert http.begin_of(_zipped(b"|0") + b"\x1f\x8b damaged", "gzip", 64) == b"|0"


@examples(100)
@given(st.lists(st.sampled_from([b"POST / HTTP/1.1\r\n", b"HTTP/1.1 200\r\n", b"\r\n", b"\n", b"a:", b":", b"\xff",
                                 b"Content-Length: 1", b"Transfer-Encoding: chunked", b"5", b"0", b" "]),
                max_size=20).map(b"".join))  # fmt: skip
def test_no_bytes_raise(data: bytes) -> None:
    for side in Side:
        http.start_of_message(data, 0, len(data), side)
        end = http.end_of_head(data, 0, len(data))
        if end >= 0:
            http.read_head(data[:end], side)
    http.read_chunks(data, 0, len(data))
    http.decoded(data, "deflate")
