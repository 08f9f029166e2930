"""Requests of the Parameter Manager that nobody answers: what else the capture shows of them."""

from __future__ import annotations

from ipaddress import ip_address
from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.open import open_sink
from nvscope.causes.cause import Cause
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


def came_back(at_ns: int, payload: bytes) -> Frame:
    """Return the message that the asked node does not take a request."""
    quoted = internet_packet(ip_address(ASKING), ip_address(ASKED), PROTOCOL_UDP, udp(payload, port=1202))
    return whole(at_ns, ETHERNET, link_frame(unreachable(ip_address(ASKED), quoted[:48])))


def cause_of(frames: list[Frame], folder: Path) -> Cause:
    sink = open_sink(str(folder / "x.pcap"))
    sink.write(batch_of(frames))
    sink.close()
    (found,) = causes_of(Inquiry([str(folder / "x.pcap")]))[1]
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


def test_without_such_messages_nothing_is_said_of_them(tmp_path: Path) -> None:
    cause = cause_of(asked(rejected=0), tmp_path)
    assert cause.kind.name == "parameters-unanswered"
    assert cause.next == cause.kind.next_step
    assert not any("ICMP" in line for line in cause.checked)
