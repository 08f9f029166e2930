"""What a frame may wear around a datagram, and what it says of broadcast."""

from __future__ import annotations

from ipaddress import ip_address
from typing import Any

import pytest

from tests.oracle import frame as frames_of
from tests.oracle.builders import LINKS, data_frame, internet_packet, link_frame, telegram, udp, whole
from tests.oracle.frame import Datagram, Unreachable, peel
from tests.oracle.reference import reference_report
from tests.oracle.wire import ALL, A, B, icmp


@pytest.mark.parametrize("link", LINKS)
def test_every_link_type_is_peeled(link: int) -> None:
    source, to = ("::1", "2001:db8::2") if link == frames_of.IPV6 else (A, B)
    found = peel(data_frame(0, source, to, telegram(), link=link))
    assert found == Datagram(ip_address(source), ip_address(to), 1202, 22, telegram(), broadcast=False)


def packet(source: str = A, to: str = B, **how: Any) -> bytes:
    return internet_packet(ip_address(source), ip_address(to), 17, udp(telegram()), **how)


@pytest.mark.parametrize(
    ("data", "is_telegram"),
    [
        (link_frame(packet(), tags=(0x8100,)), True),
        (link_frame(packet(), tags=(0x88A8, 0x8100)), True),
        (link_frame(packet(), tags=(0x9100,)), True),
        (link_frame(packet(options=bytes(40))), True),
        (link_frame(packet("::1", "::2", extensions=(0, 43, 60, 51))), True),
        (link_frame(packet("::1", "::2", fragment=(0, False))), True),
        (link_frame(packet("::1", "::2", fragment=(0, True))), False),
        (link_frame(packet("::1", "::2", fragment=(1, False))), False),
        (link_frame(packet(fragment=(0, True))), False),
        (link_frame(packet(fragment=(1, False))), False),
        (link_frame(packet(total_length=0)), True),
        (link_frame(packet(total_length=39)), False),
        (link_frame(packet(total_length=40)), True),
        (link_frame(packet(), ethertype=0x86DD), False),
        (link_frame(packet(), ethertype=0x88CC), False),
    ],
)
def test_what_a_frame_may_wear(data: bytes, is_telegram: bool) -> None:
    assert reference_report([whole(0, 1, data)])["capture"]["telegrams"] == int(is_telegram)


@pytest.mark.parametrize(
    ("link", "to", "how", "broadcast"),
    [
        (1, B, {"broadcast": True}, True),
        (1, "10.0.0.255", {}, False),
        (1, ALL, {}, True),
        (1, "225.10.10.11", {}, True),
        (1, "ff02::1", {}, True),
        (113, B, {"packet_type": 1}, True),
        (113, B, {"packet_type": 2}, True),
        (113, "10.0.0.255", {"packet_type": 4}, False),
        (276, B, {"packet_type": 2}, True),
        (276, B, {"packet_type": 3}, False),
        (101, "10.0.0.255", {}, True),
        (101, B, {}, False),
        (0, "10.0.0.255", {}, True),
        (101, "::ff", {}, False),
    ],
)
def test_broadcast(link: int, to: str, how: dict[str, Any], broadcast: bool) -> None:
    found = peel(whole(0, link, link_frame(packet("::1" if ":" in to else A, to), link, **how)))
    assert isinstance(found, Datagram)
    assert found.broadcast is broadcast


def test_padding_belongs_to_no_datagram() -> None:
    short = telegram(data=b"")[:14]
    data = link_frame(internet_packet(ip_address(A), ip_address(B), 17, udp(short))) + b"\xff" * 4
    found = peel(whole(0, 1, data))
    assert isinstance(found, Datagram)
    assert found.payload == short
    quoted = peel(whole(0, 1, icmp(0, telegram(), 9).data + b"\1\0\0\0"))
    assert isinstance(quoted, Unreachable)
    assert len(quoted.quoted.payload) == 9
