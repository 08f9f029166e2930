"""Requests to partners that answer, that are somebody else, that send what they like, or that are not there."""

from __future__ import annotations

import random
import sys

import pytest

from dissectors.netvar import Service
from nvscope.errors import UsageError
from nvscope.plc.parameter.conversation import Ending, Ignored, Outcome, Patience
from nvscope.plc.parameter.link import ParameterLink
from nvscope.plc.parameter.message import Message
from tests.plc.parameter.peers import LOCAL, bound, peer, unused_port
from tests.plc.parameter.wire import BUSY, INDEX, READ_REPLY, heard, said

MS = 1_000_000
REQUEST = Message(Service.ODReadRequest, 0x2000, 1, 7)
PATIENT = Patience(20_000 * MS)
"""For what ends by an answer."""

BRIEF = Patience(500 * MS)
"""For what ends without one, before which something else comes."""


def ask(port: int, patience: Patience = PATIENT) -> Outcome:
    with ParameterLink(LOCAL, port) as link:
        return link.ask(REQUEST, patience)


def test_what_is_sent_is_what_the_document_has() -> None:
    with peer(lambda came, _: [said(READ_REPLY, data=b"\1")]) as one:
        found = ask(one.port)
    assert [came for came, _ in one.got] == [said(1)]
    assert (found.ending, found.answer and found.answer.data) == (Ending.REPLIED, b"\1")
    assert found.latency_ns is not None
    assert found.latency_ns > 0


def test_what_comes_before_the_answer_is_passed_over() -> None:
    noise = [
        b"", b"garbage", bytes(60_000), said(READ_REPLY, length=5), said(0, index=7, data=bytes(256)), said(6),
        said(READ_REPLY, counter=6), said(READ_REPLY, subindex=2), said(4), said(1),
    ]  # fmt: skip
    with peer(lambda came, _: [*noise, said(READ_REPLY, data=b"\1"), said(INDEX)]) as one:
        found = ask(one.port)
    assert (found.ending, found.answer and found.answer.data) == (Ending.REPLIED, b"\1")
    assert dict(found.ignored) == {
        Ignored.NO_TELEGRAM: 3, Ignored.MALFORMED: 1, Ignored.OF_A_LIST: 2, Ignored.OTHER_REQUEST: 2,
        Ignored.OTHER_SERVICE: 2,
    }  # fmt: skip


@pytest.mark.skipif(sys.platform != "linux", reason="all of 127.0.0.0/8 is this machine")
def test_an_answer_of_another_node_is_none() -> None:
    with bound("127.0.0.9") as sender, peer(lambda came, _: [said(READ_REPLY)], sender) as one:
        found = ask(one.port, BRIEF)
    assert (found.ending, dict(found.ignored), found.others) == (
        Ending.SILENT, {Ignored.OTHER_NODE: 1}, ("127.0.0.9",),
    )  # fmt: skip


def test_an_answer_from_another_port_of_the_partner_is_one() -> None:
    with bound() as sender, peer(lambda came, _: [said(READ_REPLY)], sender) as one:
        assert ask(one.port).ending is Ending.REPLIED


def test_silence_is_told_after_the_retries() -> None:
    with peer(lambda came, _: []) as one:
        found = ask(one.port, Patience(50 * MS, 2))
    assert (found.ending, found.transmissions) == (Ending.SILENT, 3)
    assert {came for came, _ in one.got} == {said(1)}


def test_busy_is_asked_again() -> None:
    with peer(lambda came, number: [said(READ_REPLY) if number == 3 else said(BUSY)]) as one:
        found = ask(one.port, Patience(2_000 * MS))
    assert (found.ending, found.busy, len(one.got)) == (Ending.REPLIED, 3, 4)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not tell")
def test_nobody_there_is_told_at_once_and_why() -> None:
    found = ask(unused_port())
    assert (found.ending, found.why) == (Ending.UNDELIVERED, "port unreachable")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not tell")
def test_what_came_back_of_one_request_spoils_no_other() -> None:
    port = unused_port()
    with ParameterLink(LOCAL, port) as link:
        assert link.ask(REQUEST, PATIENT).ending is Ending.UNDELIVERED
        assert link.ask(REQUEST, PATIENT).ending is Ending.UNDELIVERED


def test_a_flood_ends_at_the_timeout() -> None:
    rng = random.Random(1)
    with peer(lambda came, _: [rng.randbytes(rng.randrange(60)) for _ in range(2_000)]) as one:
        found = ask(one.port, BRIEF)
    assert found.ending is Ending.SILENT


def test_requests_of_one_link_are_told_apart() -> None:
    """Late answers to the first come while the second waits."""
    with peer(lambda came, number: [said(READ_REPLY, counter=7, data=b"\1"), *([said(READ_REPLY, counter=8, data=b"\2")]
              if heard(came).counter == 8 else [])]) as one, ParameterLink(LOCAL, one.port) as link:  # fmt: skip
        first = link.ask(REQUEST, PATIENT)
        second = link.ask(Message(Service.ODReadRequest, 0x2000, 1, 8), PATIENT)
    assert [one.answer and one.answer.data for one in (first, second)] == [b"\1", b"\2"]
    assert dict(second.ignored) == {Ignored.OTHER_REQUEST: 1}


@pytest.mark.parametrize("address", ["192.0.2.1", "8.8.8.8", "2001:db8::1", "198.51.100.7"])
def test_nothing_is_sent_to_others_unless_that_is_allowed(address: str) -> None:
    with pytest.raises(UsageError, match="unless that is allowed") as raised:
        ParameterLink(address, 1202)
    assert "--allow-network" in raised.value.next_step


@pytest.mark.parametrize("address", ["255.255.255.255", "239.1.2.3", "0.0.0.0", "ff02::1", "::"])
@pytest.mark.parametrize("allow_network", [False, True])
def test_a_partner_is_one_node(address: str, allow_network: bool) -> None:
    with pytest.raises(UsageError, match="is no node"):
        ParameterLink(address, 1202, allow_network=allow_network)
