"""What is a TCP segment, and how much data it has."""

from __future__ import annotations

from ipaddress import ip_address

import pytest

from tests.oracle.builders import LINKS, internet_packet, link_frame, whole
from tests.oracle.frame import ETHERNET, IPV6
from tests.oracle.tcp import PROTOCOL_TCP, PSH, Segment, peel_tcp
from tests.oracle.tcp_line import snapped, tcp_frame
from tests.oracle.wire import A, B

HEADER = bytes((0xC3, 0x50, 0, 80, 0, 0, 0, 7, 0, 0, 0, 9, 0x50, PSH, 0, 0, 0, 0, 0, 0))


@pytest.mark.parametrize("link", LINKS)
def test_every_link_type_is_peeled(link: int) -> None:
    source, to = ("::1", "2001:db8::2") if link == IPV6 else (A, B)
    frame = tcp_frame(0, (source, 50_000), (to, 80), seq=7, ack=9, flags=PSH, data=b"hello", link=link)
    found = Segment(ip_address(source), 50_000, ip_address(to), 80, 7, 9, PSH, b"hello", 5)
    assert peel_tcp(frame) == found


@pytest.mark.parametrize("source", [A, "fd00::1"])
def test_the_ip_header_says_how_long_it_is(source: str) -> None:
    to = "fd00::2" if ":" in source else B
    frame = tcp_frame(0, (source, 50_000), (to, 80), data=b"hello", options=bytes(12))
    for missing in range(6):
        found = peel_tcp(snapped(frame, missing))
        assert found is not None
        assert (found.payload, found.length) == (b"hello"[: 5 - missing], 5)
    for missing in range(6, 18):
        found = peel_tcp(snapped(frame, missing))
        assert found is not None
        assert (found.payload, found.length) == (b"", 5)
    assert peel_tcp(snapped(frame, 18)) is None
    padded = frame._replace(data=frame.data + bytes(9), original=frame.original + 9)
    assert peel_tcp(padded) == peel_tcp(frame)


def test_without_a_length_the_frame_has_it() -> None:
    packet = internet_packet(ip_address(A), ip_address(B), PROTOCOL_TCP, HEADER + b"hello", total_length=0)
    frame = whole(0, ETHERNET, link_frame(packet))
    found = peel_tcp(snapped(frame, 2))
    assert found is not None
    assert (found.payload, found.length) == (b"hel", 5)


def test_others_are_none() -> None:
    def peeled(
        content: bytes, protocol: int = PROTOCOL_TCP, fragment: tuple[int, bool] | None = None
    ) -> Segment | None:
        packet = internet_packet(ip_address(A), ip_address(B), protocol, content, fragment=fragment)
        return peel_tcp(whole(0, ETHERNET, link_frame(packet)))

    assert peeled(HEADER) is not None
    assert peeled(HEADER, 17) is None
    assert peeled(HEADER, fragment=(0, True)) is None
    assert peeled(HEADER, fragment=(1, False)) is None
    assert peeled(HEADER[:19]) is None
    assert peeled(HEADER[:12] + b"\x40" + HEADER[13:]) is None
    assert peeled(HEADER[:12] + b"\x60" + HEADER[13:]) is None
    assert peel_tcp(whole(0, ETHERNET, link_frame(HEADER, ethertype=0x0806))) is None
