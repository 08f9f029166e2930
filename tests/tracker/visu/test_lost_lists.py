"""Lists of variables of which bytes are missing, or that nobody reads: names are missing, and that is told."""

from __future__ import annotations

import gzip
import random

import pytest

from nvscope.findings.judge import judge
from nvscope.protocols.table import judges_of
from nvscope.protocols.visu import VISU
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told
from tests.tracker.visu.test_endings import said

OK = b"HTTP/1.1 200 OK\r\n"
DECLARED = b'<?xml version="1.0" encoding="ISO-8859-1"?>\r\n\r\n'
PAGE = DECLARED + b"<visualisation>" + b" " * 900
READ = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 15\r\n\r\n|0|1|0|4|0|2|1|"
LOST, LONG = "bytes of it are missing", "it is too long to be read"


def asked(target: bytes = b"/plc/PLC_VISU.xml") -> Line:
    return Line().open().ask(b"GET %s HTTP/1.1\r\n\r\n" % target)


def sized(body: bytes, head: bytes = b"") -> bytes:
    return OK + head + b"Content-Length: %d\r\n\r\n%s" % (len(body), body)


def chunked(*chunks: bytes) -> bytes:
    return OK + b"Transfer-Encoding: chunked\r\n\r\n" + b"".join(b"%x\r\n%s\r\n" % (len(one), one) for one in chunks)


def why(frames: list[Frame]) -> list[str]:
    """Return why lists cannot be used: by the rules, too, and the same however the frames are cut."""
    state, rules = followed([batch_of(frames)]), by_the_rules(frames)
    assert told(state)[1] == rules.findings()
    assert told(followed(cut(batch_of(frames), 1))) == told(state)
    found = [one.message for one in judge(state, judges=judges_of([VISU], state)) if one.code == "NV807"]
    begin, end = "10.0.0.5 sent a list of variables that cannot be used: ", ". Names are missing, and nobody "
    assert all(one.startswith(begin) and end in one for one in found)
    return [one.removeprefix(begin).partition(end)[0] for one in found]


def with_hole(reply: bytes, at: int, size: int, line: Line) -> Line:
    return line.answer(reply[:at]).lose(False, size).answer(reply[at + size :]).segment(True)


@pytest.mark.parametrize(
    "reply", [sized(PAGE), OK + b"\r\n" + PAGE, chunked(PAGE), sized(PAGE, b"Content-Type: text/xml\r\n")]
)
@pytest.mark.parametrize("at", [17, 60, 200, 700])
def test_a_list_with_a_hole_is_told(reply: bytes, at: int) -> None:
    line = with_hole(reply, at, 30, asked())
    assert why(line.frames) == [LOST]
    assert said(line.frames) == [f"variable list, cannot be used: {LOST}"]
    if at > 100:  # its first tag tells what it is, whatever it is called
        assert why(with_hole(reply, at, 30, asked(b"/any.xml")).frames) == [LOST]
        assert why(with_hole(reply.replace(b"visualis", b"no_visua"), at, 30, asked()).frames) == []


@pytest.mark.parametrize("at", [200, 700])
def test_a_coded_list_with_a_hole_is_told_by_what_it_was(at: int) -> None:
    page = DECLARED + b"<visualisation>" + random.Random(1).randbytes(900)
    reply = sized(gzip.compress(page, mtime=0), b"Content-Encoding: gzip\r\n")
    assert why(with_hole(reply, at, 30, asked(b"/any.xml")).frames) == [LOST]
    other = page.replace(b"visualis", b"no_visua")
    reply = sized(gzip.compress(other, mtime=0), b"Content-Encoding: gzip\r\n")
    assert why(with_hole(reply, at, 30, asked()).frames) == []


def test_what_does_not_tell_that_it_is_a_list_is_none_but_on_connections_of_pages() -> None:
    hidden = sized(b"<!-- <visualisation> --" + b" " * 900)
    for target, is_list in ((b"/any.xml", False), (b"/visu_ini.xml", True), (b"/a/P.SYM_XML?x", True)):
        for at in (60, 200):
            state = followed([batch_of(with_hole(hidden, at, 30, asked(target)).frames)])
            assert [one["code"] for one in told(state)[1]] == ["NV807"] * is_list
    polls = Line().open().ask(READ).answer(sized(b"|1|")).ask(b"GET /any.xml HTTP/1.1\r\n\r\n")
    assert why(with_hole(hidden, 60, 30, polls).frames) == [LOST]


@pytest.mark.parametrize("status", [b"304 Not Modified", b"404 Not Found"])
def test_what_is_no_list_by_its_status_is_none_with_a_hole_either(status: bytes) -> None:
    assert why(with_hole(sized(PAGE).replace(b"200 OK", status), 60, 30, asked()).frames) == []
    assert why(asked().lose(False, 1000).segment(True).answer(b"rest").segment(True).frames) == []


@pytest.mark.parametrize(
    ("reply", "told"),
    [
        (sized(PAGE + b" " * 1_050_000), LONG), (OK + b"\r\n" + PAGE + b" " * 1_050_000, LONG),
        (chunked(PAGE + b" " * 1_050_000, b""), LONG),
        (sized(gzip.compress(PAGE + b" " * 1_050_000), b"Content-Encoding: gzip\r\n"), "Content-Encoding gzip"),
        (sized(b"\x0b\x08\x80", b"Content-Encoding: br\r\n"), "Content-Encoding br"),
        (chunked(PAGE)[:-2] + b"zz", "its chunks are malformed"),
        (sized(PAGE)[:-1], "the connection ended before all of it had come"),
        (chunked(PAGE)[:-2], "the connection ended before all of it had come"),
    ],
    ids=lambda one: one if isinstance(one, str) else "",
)  # fmt: skip
def test_a_list_that_nobody_reads_is_told(reply: bytes, told: str) -> None:
    size = min(max(len(reply) // 20, 100), 60_000)
    line = asked()
    for start in range(0, len(reply), size):
        line.answer(reply[start : start + size])
    assert why(line.close(False).frames) == [told]
