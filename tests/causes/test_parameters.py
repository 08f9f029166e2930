"""Requests of the Parameter Manager that nobody answers: what else the capture shows of them."""

from __future__ import annotations

from ipaddress import ip_address
from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.open import open_sink
from nvscope.causes.cause import Cause
from nvscope.tracker.parameter.events import place_of, variable_name
from tests.causes.told import causes_of
from tests.oracle.builders import (
    ETHERNET,
    MILLISECOND,
    PROTOCOL_UDP,
    data_frame,
    internet_packet,
    link_frame,
    telegram,
    udp,
    unreachable,
    whole,
)
from tests.oracle.frame import Frame
from tests.packets import batch_of

ASKING, ASKED = "10.0.0.1", "10.0.0.2"


def came_back(at_ns: int, payload: bytes, port: int = 1202) -> Frame:
    """Return the message that the asked node does not take a request."""
    quoted = internet_packet(ip_address(ASKING), ip_address(ASKED), PROTOCOL_UDP, udp(payload, port=port))
    return whole(at_ns, ETHERNET, link_frame(unreachable(ip_address(ASKED), quoted[:48])))


def all_causes_of(frames: list[Frame], folder: Path) -> list[Cause]:
    sink = open_sink(str(folder / "x.pcap"))
    sink.write(batch_of(frames))
    sink.close()
    return list(causes_of(Inquiry([str(folder / "x.pcap")]))[1])


def cause_of(frames: list[Frame], folder: Path) -> Cause:
    (found,) = all_causes_of(frames, folder)
    return found


def asked(*, rejected: int) -> list[Frame]:
    """Return five requests without a reply, of which some come back, and a telegram when all are over."""
    frames = []
    for number in range(5):
        payload = telegram(1, 0x2000, 1, counter=number, data=b"")
        frames.append(data_frame(number * 1000 * MILLISECOND, ASKING, ASKED, payload))
        if number < rejected:
            frames.append(came_back(number * 1000 * MILLISECOND + 1, payload))
    return [*frames, data_frame(6000 * MILLISECOND, ASKING, "255.255.255.255", telegram(0, 1))]


def test_requests_that_come_back_are_told_as_such(tmp_path: Path) -> None:
    cause = cause_of(asked(rejected=3), tmp_path)
    assert cause.kind.name == "parameters-unanswered"
    assert "3 requests came back: ICMP destination unreachable" in cause.checked
    assert cause.next.startswith("What the ICMP messages say")


@pytest.mark.parametrize("identification", [0, 77])
def test_what_came_back_and_was_captured_twice_came_back_once(identification: int, tmp_path: Path) -> None:
    frames = []
    for number in range(5):
        payload = telegram(1, 0x2000, 1, counter=number, data=b"")
        own = identification and identification + number
        sent = internet_packet(
            ip_address(ASKING), ip_address(ASKED), PROTOCOL_UDP, udp(payload), identification=own
        )  # fmt: skip
        told = link_frame(unreachable(ip_address(ASKED), sent[:48]))
        for after in (0, 30 * MILLISECOND if identification else 20_000):
            at_ns = number * 1000 * MILLISECOND + after
            frames += [whole(at_ns, ETHERNET, link_frame(sent)), whole(at_ns + MILLISECOND, ETHERNET, told)]
    frames.append(asked(rejected=0)[-1])
    cause = cause_of(sorted(frames, key=lambda one: one.ts_ns), tmp_path)
    assert cause.title.startswith(f"Node {ASKED} did not answer 5 requests")
    assert "5 requests came back: ICMP destination unreachable" in cause.checked


def test_without_such_messages_nothing_is_said_of_them(tmp_path: Path) -> None:
    there = data_frame(10 * MILLISECOND, ASKED, "255.255.255.255", telegram(0, 2))
    first, *others = asked(rejected=0)
    cause = cause_of([first, there, *others], tmp_path)
    assert cause.kind.name == "parameters-unanswered"
    assert cause.next == cause.kind.next_step
    assert not any("ICMP" in line for line in cause.checked)


def test_of_whom_nothing_is_captured_nobody_knows_whether_it_answers(tmp_path: Path) -> None:
    """As at a mirror port of one direction: a node that is off is not even asked, since ARP does not find it."""
    cause = cause_of(asked(rejected=0), tmp_path)
    assert cause.next.startswith(
        f"Whether this capture sees what {ASKED} sends: a mirror port of one direction shows no"
    )
    assert cause.checked == ("it answered none", "nothing that it sends is in this capture")


@pytest.mark.parametrize(
    ("after_ms", "counter", "told", "step"),
    [
        (700, 0, "5 replies came after the timeout, the slowest after 700.0 ms", "Its task cycle, "),
        (5, 500, "5 replies came with a Counter of which no request was open", "The Counter in its replies "),
        (700, 500, "5 replies came with a Counter of which no request was open", "The Counter in its replies "),
    ],
)
def test_replies_that_come_too_late_are_not_those_of_another_counter(
    after_ms: int, counter: int, told: str, step: str, tmp_path: Path
) -> None:
    frames = []
    for number in range(5):
        frames += [served(1, number * 1000, number, 1202), served(2, number * 1000 + after_ms, number + counter, 1202)]
    cause = cause_of([*frames, data_frame(6000 * MILLISECOND, ASKING, "255.255.255.255", telegram(0, 1))], tmp_path)
    assert told in cause.checked
    assert cause.next.startswith(step)


def test_a_request_that_was_answered_later_is_not_given_up_any_more(tmp_path: Path) -> None:
    """Programs without a Counter ask again with the same one: what comes behind its answer is no late one."""
    frames = [served(1, 0, 7, 1202), served(1, 1000, 7, 1202), served(2, 1005, 7, 1202), served(2, 1300, 7, 1202)]
    cause = cause_of([*frames, data_frame(6000 * MILLISECOND, ASKING, "255.255.255.255", telegram(0, 1))], tmp_path)
    assert "1 reply came with a Counter of which no request was open" in cause.checked


def test_where_nothing_was_answered_those_that_still_wait_are_not_counted(tmp_path: Path) -> None:
    again = data_frame(5900 * MILLISECOND, ASKING, ASKED, telegram(1, 0x2000, 1, counter=9, data=b""))
    frames = asked(rejected=0)
    cause = cause_of([*frames[:-1], again, frames[-1]], tmp_path)
    assert cause.title.startswith(f"Node {ASKED} did not answer 5 requests of")
    assert "it answered none" in cause.checked


@pytest.mark.parametrize("partner", ["10.0.0.255", "10.0.0.127", "255.255.255.255", "239.1.2.3"])
def test_requests_to_everybody_are_no_silent_nodes(partner: str, tmp_path: Path) -> None:
    """The frame says whom it goes to, whatever the mask of the network."""
    request = to_hardware(data_frame(0, ASKING, partner, telegram(1, 0x2000, 1, data=b"")), b"\xff" * 6)
    cause = cause_of([request, asked(rejected=0)[-1]], tmp_path)
    assert cause.title.startswith(f"Nobody answered 1 request of {ASKING} for 0x2000:1 to {partner}")
    (finding,) = cause.findings
    assert finding.message == (
        f"1 request of {ASKING} for 0x2000:1 went to everybody, {partner}, and to no one controller: no reply comes "
        "from there."
    )


def test_a_controller_may_have_an_address_that_ends_as_broadcasts_do(tmp_path: Path) -> None:
    request = to_hardware(data_frame(0, ASKING, "10.0.0.255", telegram(1, 0x2000, 1, data=b"")), b"\x02\0\0\0\0\7")
    cause = cause_of([request, asked(rejected=0)[-1]], tmp_path)
    assert cause.title.startswith(f"Node 10.0.0.255 did not answer 1 request of {ASKING} for 0x2000:1")
    (finding,) = cause.findings
    assert finding.message.startswith("10.0.0.255 did not answer 1 request of")


def to_hardware(frame: Frame, hardware: bytes) -> Frame:
    return frame._replace(data=hardware + frame.data[6:])


def test_who_answers_a_request_to_everybody_is_told_with_it(tmp_path: Path) -> None:
    frames = []
    for number in range(5):
        asking = telegram(1, 0x2000, 1, counter=number, data=b"")
        frames.append(data_frame(number * 1000 * MILLISECOND, ASKING, "10.0.0.255", asking))
        frames.append(served(2, number * 1000 + 5, number, 1202))
    cause = cause_of([*frames, asked(rejected=0)[-1]], tmp_path)
    assert cause.title.startswith(f"5 requests of {ASKING} for 0x2000:1 went to everybody, 10.0.0.255,")
    assert cause.checked[-1] == f"5 replies came, of {ASKED}"


def test_copies_of_replies_are_the_fault_of_a_mirror_that_shows_all_twice(tmp_path: Path) -> None:
    """Not so replies that come late, or that nobody asked for."""
    frames = [
        data_frame(at * 20 * MILLISECOND, ASKED, "255.255.255.255", telegram(0, 1, counter=at)) for at in range(60)
    ]
    for at in range(20):
        frames += [served(1, at * 20 + 1, at, 1202), served(2, at * 20 + 3, at, 1202)]
    stray = [served(2, at * 20 + 5, at, 1203) for at in range(20)]
    for others, kinds in (([], ["mirrored-twice"]), (stray, ["mirrored-twice", "other"])):
        twice = [one._replace(ts_ns=one.ts_ns + late) for one in [*frames, *others] for late in (0, 5000)]
        found = all_causes_of(sorted(twice, key=lambda one: one.ts_ns), tmp_path)
        assert [one.kind.name for one in found] == kinds


def served(service: int, at_ms: int, counter: int, port: int) -> Frame:
    """Return a request, or the reply to one, on a port."""
    ends = (ASKING, ASKED) if service in (1, 3) else (ASKED, ASKING)
    payload = telegram(service, 0x2000, 1, counter=counter, data=b"")
    return data_frame(at_ms * MILLISECOND, *ends, payload, port=port, source_port=port)


def on_two_ports(*, error: bool = False) -> list[Frame]:
    """Return requests of one parameter on two ports: on 1202 one of four fails, on 1300 the only one does."""
    frames = []
    for number in range(4):
        frames.append(served(1, number * 1000, number, 1202))
        if error or number != 1:
            frames.append(served(23 if number == 1 else 2, number * 1000 + 5, number, 1202))
    frames.append(served(1, 6000, 9, 1300))
    if error:
        frames.append(served(25, 6005, 9, 1300))
    else:
        frames.append(came_back(6001 * MILLISECOND, telegram(1, 0x2000, 1, counter=9, data=b""), 1300))
    return [*frames, served(1, 9000, 20, 1202), served(2, 9005, 20, 1202)]


def test_each_port_has_a_cause_of_its_own_and_its_own_next_step(tmp_path: Path) -> None:
    usual, other = all_causes_of(on_two_ports(), tmp_path)
    assert "did not answer 1 of 5 requests, that of 10.0.0.1 for 0x2000:1 on port 1202," in usual.title
    assert usual.next == usual.kind.next_step
    assert not any("ICMP" in line for line in usual.checked)
    assert "did not answer 1 request of 10.0.0.1 for 0x2000:1 on port 1300 " in other.title
    assert other.next.startswith("What the ICMP messages say")
    assert [one.kind.name for one in (usual, other)] == ["parameters-unanswered"] * 2


def test_what_a_port_refuses_is_not_what_another_one_refuses(tmp_path: Path) -> None:
    usual, other = all_causes_of(on_two_ports(error=True), tmp_path)
    assert [one.kind.name for one in (usual, other)] == ["parameters-refused"] * 2
    assert "on port 1202" in usual.title
    assert usual.checked == ("ODErrorReplyIdx: 1 time", "it answered 4 other requests")
    assert "on port 1300" in other.title
    assert other.checked == ("ODErrorReplyLen: 1 time", "it answered nothing else")


@pytest.mark.parametrize("partner", ["10.0.0.2", "fe80::1"])
@pytest.mark.parametrize("port", [1202, 1300])
def test_what_a_finding_is_about_can_be_taken_apart(partner: str, port: int) -> None:
    variable = variable_name(partner, port, "0x2000:1")
    assert place_of(variable) == (partner, port, "0x2000:1")
    assert (str(port) in variable) is (port != 1202)
