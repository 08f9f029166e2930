"""Requests and replies in a coding that nobody knows, or that is broken, and that do not say how long they are."""

from __future__ import annotations

import gzip

import pytest

from tests.laws import cut_sizes
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import Rows, by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_rules import near

WRITE = b"|1|1|0|4|0|4|6|9.5|"
DONE = b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\n|0|"
CODED = [(b"br", b"\x0b\x08\x80"), (b"gzip", b"broken"), (b"gzip", gzip.compress(WRITE, mtime=0)[:-9]), (b"x", WRITE)]


def post(coding: bytes, body: bytes, more: bytes = b"", target: bytes = b"/plc/webvisu.htm") -> bytes:
    return b"POST %b HTTP/1.1\r\nContent-Encoding: %b\r\n%b\r\n%b" % (target, coding, more, body)


def seen(line: Line) -> tuple[Rows, list[str]]:
    """Return rows, and the codes of findings, as the rules have them, too, however the frames are cut."""
    rules = by_the_rules(line.frames)
    for packets in cut_sizes(len(line.frames)):
        state = followed(cut(batch_of(line.frames), packets))
        assert writes_of(state) == writes_by_the_rules(rules)
        assert told(state) == ([near(row) for row in rules.rows()], rules.findings())
    rows, findings = told(state)
    return rows, [one["code"] for one in findings]


@pytest.mark.parametrize(("coding", "body"), CODED)
def test_a_request_that_ends_with_its_direction_is_one_that_nobody_reads(coding: bytes, body: bytes) -> None:
    line = Line().open().ask(post(coding, body)).close(True)
    (row,), _ = seen(line.answer(DONE).close(False))
    assert (row["cut"], row["writes"]) == (1, 0)


@pytest.mark.parametrize("coding", [b"br", b"gzip"])
def test_so_it_is_not_of_other_pages(coding: bytes) -> None:
    assert seen(Line().open().ask(post(coding, b"broken", target=b"/upload")).close(True)) == ([], [])


@pytest.mark.parametrize(("coding", "body"), CODED)
@pytest.mark.parametrize("by_client", [None, True, False])
def test_a_part_of_a_request_is_one_of_a_page_by_what_it_was(
    coding: bytes, body: bytes, by_client: bool | None
) -> None:  # fmt: skip
    """Nobody knows where it ends."""
    line = Line().open().ask(post(coding, body, b"Content-Length: x\r\n"))
    line = line.close(True) if by_client is None else line.reset(by_client)
    (row,), codes = seen(line)
    assert (row["ambiguous"], row["writes"], "NV804" in codes) == (1, 0, True)


@pytest.mark.parametrize(("coding", "body"), CODED)
def test_so_are_chunks_that_a_reset_breaks_off(coding: bytes, body: bytes) -> None:
    chunks = b"%x\r\n%b\r\n40\r\n" % (len(body), body)
    seen(Line().open().ask(post(coding, chunks, b"Transfer-Encoding: chunked\r\n")).reset(False))


@pytest.mark.parametrize(("coding", "body"), CODED)
def test_a_reply_to_the_end_in_place_of_a_list_is_one_that_nobody_reads(coding: bytes, body: bytes) -> None:
    said = b"HTTP/1.1 200 OK\r\nContent-Encoding: %b\r\n\r\n%b" % (coding, body)
    line = Line().open().ask(b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n").answer(said).close(False)
    seen(line)


REFUSED = b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n"
READ = b"|0|1|0|4|0|4|"


def begun(coding: bytes, body: bytes, target: bytes = b"/plc/webvisu.htm") -> bytes:
    """Return a request of which ten bytes are missing at the end."""
    return post(coding, body, b"Content-Length: %d\r\n" % (len(body) + 10), target)


@pytest.mark.parametrize(("coding", "body"), CODED)
@pytest.mark.parametrize("end", ["server closes", "server resets", "client resets", "client closes"])
def test_a_part_of_known_length_is_one_by_what_it_was(coding: bytes, body: bytes, end: str) -> None:
    line = Line().open().ask(begun(coding, body)).answer(REFUSED)
    by_client = "client" in end
    (row,), codes = seen(line.close(by_client).close(not by_client) if "closes" in end else line.reset(by_client))
    assert codes == ["NV802"]
    assert row["refused"] == (coding == b"gzip" and body != b"broken")  # of which it is known that it writes


@pytest.mark.parametrize("body", [WRITE, READ])
@pytest.mark.parametrize("lost", ["rest", "rest and more"])
def test_what_is_cut_is_one_of_a_page_by_what_it_was(body: bytes, lost: str) -> None:
    coded = gzip.compress(body, mtime=0)
    line = Line().open().ask(post(b"gzip", coded, b"Content-Length: %d\r\n" % (len(coded) + 10), b"/else"))
    line = line.lose(True, 10 if lost == "rest" else 30).ask(post(b"", READ, b"Content-Length: %d\r\n" % len(READ)))
    (row,), _ = seen(line.answer(DONE).answer(DONE).close(True).close(False))
    assert row["cut"] == 1


@pytest.mark.parametrize("coding", [b"br", b"gzip"])
@pytest.mark.parametrize("by_client", [None, True, False])
def test_parts_of_other_pages_are_none(coding: bytes, by_client: bool | None) -> None:
    line = Line().open().ask(begun(coding, b"broken", b"/upload"))
    assert seen(line.close(True) if by_client is None else line.reset(by_client)) == ([], [])
