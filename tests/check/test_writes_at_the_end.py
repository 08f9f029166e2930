"""Rules about writes where a capture ends within what clients of pages say, or while some of that still waits."""

from __future__ import annotations

import gzip
from typing import Any

import pytest

from nvscope.check.verdict import Verdict
from tests.check.requests import DONE, READ_X, VALUE, WRITE_X, decided, of_frames, page, post, reply
from tests.oracle.frame import Frame
from tests.oracle.tcp import ACK, SYN
from tests.oracle.tcp_line import CLIENT, Line
from tests.packets import batch_of, cut

PASS, OPEN = Verdict.PASS, Verdict.INCONCLUSIVE
RULE: dict[str, Any] = {"check": "writes", "only_by": "192.0.2.1"}
OTHER = "10.0.0.9", 50_001
READ, WRITE = post(READ_X), post(WRITE_X)
QUERY = b"GET /plc/webvisu.htm?WRITEPI?ADR1=MW2&VALUE1=1 HTTP/1.1\r\nHost: x\r\n\r\n"


def before(line: Line) -> list[Frame]:
    """Return a page that reads, and the frames of a line behind that."""
    good = page(Line(client=("10.0.0.7", 40_000))).ask(READ).answer(reply(VALUE))
    return [*good.frames, *(frame._replace(ts_ns=frame.ts_ns + good.now) for frame in line.frames)]


def verdicts(frames: list[Frame]) -> list[tuple[str | None, Verdict]]:
    """Return who was judged, and how, however the frames are cut."""
    (one,) = of_frames(frames, RULE)
    for packets in (1, 3):
        (other,) = decided(cut(batch_of(frames), packets), RULE)
        assert other.subjects == one.subjects
    return [(judged.node, judged.verdict) for judged in one.subjects]


NOTHING, PERHAPS = [(None, PASS)], [(CLIENT[0], OPEN)]


@pytest.mark.parametrize(
    ("begun", "of_page", "of_others"),
    [
        (WRITE[:-6], PERHAPS, PERHAPS), (READ[:-6], NOTHING, NOTHING), (WRITE[: -len(WRITE_X)], PERHAPS, PERHAPS),
        (WRITE[:20], PERHAPS, NOTHING), (b"P", PERHAPS, NOTHING), (b"\r\n", NOTHING, NOTHING),
        (b"POST /other HTTP/1.1\r\nContent-Length: 9\r\n\r\n", PERHAPS, NOTHING),
        (b"POST /other HTTP/1.1\r\nContent-Length: 9\r\n\r\nname=", NOTHING, NOTHING),
        (b"GET /plc/x.gif HTTP/1.1\r\nHo", NOTHING, NOTHING), (QUERY[:-2], PERHAPS, PERHAPS),
        (QUERY[:9], PERHAPS, NOTHING), (b"PUT /x HTTP/1.1\r\n", NOTHING, NOTHING),
    ],
)  # fmt: skip
def test_a_request_that_has_begun_may_write(begun: bytes, of_page: object, of_others: object) -> None:
    assert verdicts(before(Line().open().ask(READ).answer(reply(VALUE)).ask(begun))) == of_page
    assert verdicts(before(Line().open().ask(begun))) == of_others


def test_so_does_one_that_is_coded() -> None:
    for body, expected in ((WRITE_X, PERHAPS), (READ_X, NOTHING)):
        content = gzip.compress(body * 40, mtime=0)
        head = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Encoding: gzip\r\nContent-Length: %d\r\n\r\n" % len(content)
        assert verdicts(before(Line().open().ask(head + content[:-8]))) == expected


def test_one_that_goes_on_or_ends_is_none() -> None:
    line = Line().open().ask(READ).answer(reply(VALUE)).ask(READ[:20])
    assert verdicts(before(line)) == PERHAPS
    assert verdicts(before(line.ask(READ[20:]))) == NOTHING
    assert verdicts(before(Line().open().ask(READ).answer(reply(VALUE)).ask(WRITE[:20]).close(True))) == NOTHING


def opened_late() -> list[Frame]:
    """Return a connection that opens behind what answers that: what is ahead waits from then on."""
    line = Line(client=("10.0.0.8", 40_001))
    line.segment(False, flags=SYN | ACK, seq=line.begin[False] - 1, ack=line.begin[True])
    return line.segment(True, flags=SYN, seq=line.begin[True] - 1, ack=0).segment(True).frames


@pytest.mark.parametrize("opens", [True, False])
def test_what_is_held_back_may_write(opens: bool) -> None:
    line = Line(client=OTHER)
    line.frames += opened_late()
    line.now = len(line.frames) * 1_000_000
    if opens:
        line.segment(True, flags=SYN, seq=line.begin[True] - 1, ack=0)
    line.segment(True).say(True, WRITE)
    assert verdicts(before(line)) == [(OTHER[0], OPEN)]


def test_so_may_what_waits_behind_an_acknowledgement() -> None:
    line = Line().open()
    line.segment(False, ack=line.sent[True] + len(READ))
    line.ask(READ).answer(reply(VALUE))
    assert verdicts(before(line)) == NOTHING
    line.segment(True, ack=line.sent[False] + len(reply(DONE))).ask(WRITE)
    assert verdicts(before(line)) == PERHAPS
