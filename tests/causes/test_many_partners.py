"""Hosts that ask very many for parameters: what nobody answers them is one thing, what one partner does not its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.causes.cause import Cause
from nvscope.causes.kind import MOST_APART
from nvscope.findings.scans import SCAN
from tests.causes.plants import causes_in
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.wire import SECOND

HOST, PANEL, PRESS, ALL = "10.0.0.99", "10.0.0.50", "10.0.0.1", "255.255.255.255"
READ, REPLY, NO_INDEX, NO_SUBINDEX = 1, 2, 23, 24
Asked = tuple[str, int]


def plant() -> list[Frame]:
    return [data_frame(second * SECOND, PRESS, ALL, telegram(counter=second + 1)) for second in range(70)]


def asks(at: int, source: str, asked: Asked, number: int, answer: int = 0, *, index: int = 0x2000) -> list[Frame]:
    """Return a request, and its reply by a service; none for 0."""
    partner, port = asked
    request = telegram(READ, index, 1, counter=number, data=b"")
    frames = [data_frame(at, source, partner, request, port=port, source_port=port)]
    if answer:
        reply = telegram(answer, index, 1, counter=number)
        frames.append(data_frame(at + SECOND // 1000, partner, source, reply, port=port, source_port=port))
    return frames


def network(source: str, partners: range, *, answers: dict[int, int], port: int = 1202) -> list[Frame]:
    """Return a request to each partner, of which some answer with a service."""
    return [
        frame for place in partners
        for frame in asks(SECOND + place * SECOND // 5, source, (f"10.0.1.{place}", port), place, answers.get(place, 0))
    ]  # fmt: skip


def told(frames: list[Frame], directory: Path) -> list[Cause]:
    return causes_in([*plant(), *frames], directory)


def test_a_scan_of_a_network_is_one_cause_with_its_finding(tmp_path: Path) -> None:
    (cause,) = told(network(HOST, range(1, 250), answers=dict.fromkeys((4, 21, 60), REPLY)), tmp_path)
    assert cause.kind.name == "parameters-unanswered"
    assert cause.title == (
        f"246 of 249 partners did not answer node {HOST}, which asked them for parameters from 1.2 s to 51.3 s"
    )
    assert cause.checked == (
        "10.0.1.1, 10.0.1.2, 10.0.1.3 and 243 more: not one reply to 246 requests for 0x2000:1",
        f"{HOST} asked 246 addresses for parameters, of which not one replied (10.0.1.1, 10.0.1.2, 10.0.1.3 …), at "
        "least 100 of them within a minute",
        "nothing that they send is in this capture",
    )
    assert cause.next == SCAN.next_steps[0]
    assert {one.code for one in cause.findings} == {"NV701", "NV966"}
    assert (len(cause.findings), len(cause.nodes)) == (247, 9)


@pytest.mark.parametrize("dead", [1, 2, MOST_APART])
def test_of_few_partners_each_has_a_cause_of_its_own(dead: int, tmp_path: Path) -> None:
    answers = {place: REPLY for place in range(1, 20) if place > dead}
    causes = told(network(PANEL, range(1, 20), answers=answers), tmp_path)
    assert [cause.title for cause in causes] == [
        f"Node 10.0.1.{place} did not answer 1 request of {PANEL} for 0x2000:1 from {1 + place / 5:.1f} s to "
        f"{1.5 + place / 5:.1f} s" for place in range(1, dead + 1)
    ]  # fmt: skip


def test_a_dead_partner_of_one_host_is_told_beside_the_scan_of_another(tmp_path: Path) -> None:
    polls = [frame for at in range(8) for frame in asks(at * SECOND + 5, PANEL, ("10.0.1.7", 1202), at)]
    scan, dead = sorted(
        told([*network(HOST, range(1, 31), answers={}), *polls], tmp_path), key=lambda one: -len(one.nodes)
    )
    assert scan.title.startswith(f"30 partners did not answer node {HOST}, which asked them for parameters from")
    assert dead.title.startswith(f"Node 10.0.1.7 did not answer 8 requests of {PANEL} for 0x2000:1 ")


def test_who_answers_some_requests_is_told_by_itself(tmp_path: Path) -> None:
    again = network(PANEL, range(1, 2), answers={1: REPLY})
    later = [one._replace(ts_ns=one.ts_ns + 20 * SECOND) for one in again]
    first, *_ = causes = told([*network(PANEL, range(1, 12), answers={}), *later], tmp_path)
    assert len(causes) == 2
    assert {first.title[:26], causes[1].title[:26]} == {"10 of 11 partners did not ", "Node 10.0.1.1 did not answ"}


def test_a_scan_of_ports_is_one_cause(tmp_path: Path) -> None:
    frames = [
        frame for port in range(60) for frame in asks(SECOND + port * SECOND // 5, HOST, (PANEL, 2000 + port), port)
    ]
    (cause,) = told(frames, tmp_path)
    assert (
        cause.title
        == f"Node {PANEL} did not answer node {HOST}, which asked it for parameters on 60 ports from 1.0 s to 13.3 s"
    )
    assert {one.code for one in cause.findings} == {"NV701", "NV966"}


def test_partners_that_refuse_alike_are_one_cause_and_others_are_not(tmp_path: Path) -> None:
    """What a program asks for that none of its partners has; one of them has the Index, and no such SubIndex."""
    answers = dict.fromkeys(range(1, 13), NO_INDEX) | {12: NO_SUBINDEX}
    many, one = sorted(told(network(PANEL, range(1, 13), answers=answers), tmp_path), key=lambda one: -len(one.nodes))
    assert many.title == f"11 of 12 partners refuse requests of node {PANEL} for 0x2000:1 from 1.2 s to 3.2 s"
    assert many.checked == ("10.0.1.1, 10.0.1.2, 10.0.1.3 and 8 more refuse them alike", "ODErrorReplyIdx: 11 times")
    assert one.title.startswith("Node 10.0.1.12 refuses 1 request")


def test_what_goes_to_everybody_is_no_partner_of_many(tmp_path: Path) -> None:
    frames = [frame for place in range(20) for frame in asks(place * SECOND, HOST, (f"10.1.{place}.255", 1202), place)]
    causes = told(frames, tmp_path)
    assert len(causes) == 20
    assert all(cause.title.startswith(f"Nobody answered 1 request of {HOST}") for cause in causes)
