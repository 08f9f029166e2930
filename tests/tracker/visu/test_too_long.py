"""Messages that are longer than limits, or coded in a way that nobody knows: they are told, and rules know of them."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from tests.oracle.pcap import write_pcap
from tests.oracle.tcp_line import Line
from tests.program_here import run_text
from tests.tracker.visu.followed import told
from tests.tracker.visu.test_limits import left_out, state_of

WRITE = b"|1|1|0|4|0|2|1|7|"
PADDED = WRITE + b" " * 1_050_000
READ = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 15\r\n\r\n|0|1|0|4|0|2|1|"
DONE = b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\n|0|"
LONG_HEAD = b"X-Long: %s\r\n" % (b"y" * 66_000)


def post(body: bytes, head: bytes = b"", target: bytes = b"/plc/webvisu.htm") -> bytes:
    return b"POST %s HTTP/1.1\r\n%sContent-Length: %d\r\n\r\n%s" % (target, head, len(body), body)


def in_chunks(*chunks: bytes) -> bytes:
    body = b"".join(b"%x\r\n%s\r\n" % (len(one), one) for one in chunks)
    return b"POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n" + body


def spoken(request: bytes, reply: bytes = DONE, size: int = 1400) -> Line:
    line = Line().open()
    for start in range(0, len(request), size):
        line.ask(request[start : start + size])
    return line.answer(reply)


LOST = [
    post(PADDED),
    post(PADDED, target=b"/other"),
    post(WRITE, LONG_HEAD),
    post(WRITE, LONG_HEAD, b"/other"),
    post(gzip.compress(PADDED), b"Content-Encoding: gzip\r\n", b"/other"),
    post(b"\x0b\x08\x80", b"Content-Encoding: br\r\n"),
    in_chunks(*[PADDED[:60_000]] * 40),
    in_chunks(PADDED, b""),
    in_chunks(WRITE)[:-6],
    b"GET /plc/WRITEPI?" + b"ADR1=MW1&VALUE1=1&" * 4000 + b" HTTP/1.1\r\n\r\n",
    b"POST /plc/webvisu.htm?" + b"x" * 70_000 + b" HTTP/1.1\r\nContent-Length: 17\r\n\r\n" + WRITE,
]


@pytest.mark.parametrize("size", [1400, 7])
@pytest.mark.parametrize("request_", LOST, ids=lambda one: f"{one[:40]!r}")
def test_a_request_of_a_page_that_nobody_reads_is_told(request_: bytes, size: int) -> None:
    if size == 7 and len(request_) > 10_000:
        size = 31_007  # as many segments as that would take minutes
    state = state_of(spoken(request_, size=size).frames, 5)
    (row,), findings = told(state)
    assert (row["reads"], row["writes"], row["cut"]) == (0, 0, 1)
    assert findings == []
    assert "1 web visualization message that nobody reads: too long, or in an unknown coding" in left_out(state)


@pytest.mark.parametrize(
    "request_",
    [
        post(b"--boundary\r\n" + b"x" * 1_100_000, target=b"/upload"),
        post(b"--boundary\r\n" + b"x" * 1_100_000),
        post(b"\x0b\x08\x80", b"Content-Encoding: br\r\n", b"/upload"),
        in_chunks(b"--boundary\r\n" + b"x" * 1_100_000, b""),
        b"GET /firmware.bin HTTP/1.1\r\n" + LONG_HEAD + b"\r\n",
        b"PUT /firmware.bin HTTP/1.1\r\nContent-Length: 1100000\r\n\r\n" + b"x" * 1_100_000,
    ],
    ids=lambda one: f"{one[:40]!r}",
)
def test_what_is_long_and_no_page_s_is_not_told(request_: bytes) -> None:
    download = b"HTTP/1.1 200 OK\r\nContent-Length: 1100000\r\n\r\n" + b"x" * 1_100_000
    state = state_of(spoken(request_, download).frames, 100)
    assert told(state) == ([], [])


def test_behind_one_that_is_too_long_all_goes_on() -> None:
    line = spoken(post(PADDED)).ask(READ).answer(DONE)
    (row,), _ = told(state_of(line.frames, 10))
    assert (row["reads"], row["replies"], row["cut"], row["connections"]) == (1, 1, 1, 1)


def test_one_that_was_never_sent_whole_is_a_part_however_long_it_was_to_be() -> None:
    line = Line().open().ask(post(PADDED)[:2000]).close(True)
    line.answer(b"HTTP/1.1 413 Too Large\r\nContent-Length: 0\r\n\r\n")
    (row,), findings = told(state_of(line.frames, 10))
    assert (row["cut"], row["refused"], [one["code"] for one in findings]) == (0, 1, ["NV802"])


@pytest.mark.parametrize("count", [90, 1500])
def test_an_older_page_writes_as_many_variables_as_one_line_has_room_for(count: int) -> None:
    query = b"&".join(b"ADR%d=MW%d&VALUE%d=%d&FORMAT%d=%%d" % ((one, 100 + one) + (one,) * 3) for one in range(count))
    request = b"GET /plc/WRITEPI?" + query + b" HTTP/1.1\r\n\r\n"
    assert len(request) < 1 << 16
    (row,), _ = told(state_of(spoken(request).frames, 3))
    assert (row["writes"], row["entries"]) == (1, count)


def test_a_query_is_read_whatever_body_comes_with_it() -> None:
    request = b"GET /WRITEPI?ADR1=MW1&VALUE1=1 HTTP/1.1\r\nContent-Length: 1100000\r\n\r\n" + b"x" * 1_100_000
    (row,), _ = told(state_of(spoken(request).frames, 100))
    assert (row["writes"], row["cut"]) == (1, 0)


def test_a_response_whose_head_never_ends_answers_what_waits() -> None:
    line = spoken(READ, b"HTTP/1.1 200 OK\r\n" + LONG_HEAD[:30_000]).answer(LONG_HEAD[30_000:])
    state = state_of(line.frames, 4)
    (row,), _ = told(state)
    assert (row["reads"], row["replies"], row["cut"]) == (1, 0, 1)
    assert "1 web visualization message that nobody reads" in left_out(state)


@pytest.mark.parametrize(
    ("status", "body", "words"),
    [
        (b"404 Not Found", b"<html/>", "HTTP status 404, no variable list"),
        (b"304 Not Modified", b"", "HTTP status 304, the file that may list variables has not changed"),
        (b"200 OK", b'<?xml version="1.0"?><rss/>', "XML, no variable list (27 bytes)"),
        (b"200 OK", b"<visualisation><variablelist/></visualisation>", "variable list (46 bytes)"),
    ],
)
def test_what_comes_in_place_of_a_list_is_called_what_it_is(
    tmp_path: Path, status: bytes, body: bytes, words: str
) -> None:  # fmt: skip
    line = Line().open().ask(b"GET /plc/plc_visu.xml HTTP/1.1\r\n\r\n")
    line.answer(b"HTTP/1.1 %s\r\nContent-Length: %d\r\n\r\n%s" % (status, len(body), body)).ask(READ).answer(DONE)
    write_pcap(line.frames, tmp_path / "c.pcap")
    told = run_text("packets", str(tmp_path / "c.pcap")).stdout
    assert f"visu  {words}\n" in told


def test_counts_are_told_as_they_came_and_nothing_stands_behind_a_colon(tmp_path: Path) -> None:
    line = Line().open().ask(post(b"|1|1|x|4|0|4|6|1|")).answer(DONE).ask(post(b"|0|%d|" % 10**30)).answer(DONE)
    line.ask(post(b"|0|1|\r\n0|4|0|4|6")).answer(DONE).ask(post(b"|0|1|0|4|0|4|6|\r\n")).answer(DONE)
    write_pcap(line.frames, tmp_path / "c.pcap")
    told = run_text("packets", str(tmp_path / "c.pcap")).stdout
    assert "visu  write 0 variables, declares 1\n" in told
    assert "visu  read 0 variables, declares 1000000000000000000 or more\n" in told
    assert "visu  1 value for 0 (" in told
    assert "visu  read 1 variable, no | at its end, line breaks in it: 4,0,4,6\n" in told
    assert "visu  read 1 variable: 4,0,4,6\n" in told


def test_who_may_have_written_what_nobody_reads_is_not_known(tmp_path: Path) -> None:
    write_pcap(spoken(post(PADDED)).frames, tmp_path / "c.pcap")
    (tmp_path / "r.toml").write_text('[[rule]]\nid = "by"\ncheck = "writes"\nonly_by = ["1.2.3.4"]\n')
    told = run_text("check", str(tmp_path / "c.pcap"), "--rules", str(tmp_path / "r.toml"))
    assert "1 rule could not be decided" in told.stdout
    assert "a message of its is too long to be read, or in an unknown" in " ".join(told.stdout.split())
