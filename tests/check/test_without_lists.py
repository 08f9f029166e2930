"""Rules about all that came, where requests alone did: no list is there by which they could be judged."""

from __future__ import annotations

import pytest

from nvscope.check.verdict import Verdict
from tests.check.requests import DONE, FAILED, READ_X, VALUE, WRITE_X, asked, of_frames, page, post, reply
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line

FINDINGS, CAUSES, WRITES = {"check": "findings"}, {"check": "causes"}, {"check": "writes", "only_by": "10.0.0.99"}
PASS, FAIL, OPEN = Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE
HELLO, ALERT = b"\x16\x03\x01\x00\x31\x01\n" + bytes(47), b"\x15\x03\x01\x00\x02\x02\x28"


def said(request: bytes, answer: bytes) -> list[Frame]:
    return page().ask(post(request)).answer(reply(answer)).frames


@pytest.mark.parametrize("frames", [said(READ_X, VALUE), said(WRITE_X, DONE), asked(0, counter=1)])
def test_where_all_is_well_they_are_kept(frames: list[Frame]) -> None:
    assert [one.verdict for one in of_frames(frames, FINDINGS, CAUSES)] == [PASS, PASS]


def test_where_a_write_was_refused_they_are_broken() -> None:
    assert [one.verdict for one in of_frames(said(WRITE_X, FAILED), FINDINGS, CAUSES)] == [FAIL, FAIL]


def test_of_a_list_that_did_not_come_nothing_is_known() -> None:
    (one,) = of_frames(said(READ_X, VALUE), FINDINGS | {"list": "udp/1202/7"})
    assert one.verdict is OPEN


def test_what_is_only_spoken_beside_keeps_no_rule() -> None:
    frames = Line().open().ask(HELLO).answer(ALERT).frames
    assert [one.verdict for one in of_frames(frames, FINDINGS, CAUSES, WRITES)] == [OPEN, OPEN, OPEN]
