"""Who sent frames of any kind, against a reading of one frame after the other, and against Scapy."""

from __future__ import annotations

import random
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scapy.layers.inet import ICMP, IP, TCP
from scapy.layers.inet6 import IPv6
from scapy.layers.l2 import ARP, Dot1Q, Ether

from dissectors import address
from dissectors.addresses import UNKNOWN, addresses_of
from dissectors.batch import LinkType, PacketBatch
from tests.laws import examples
from tests.oracle.builders import LINKS
from tests.oracle.frame import ETHERNET, Frame
from tests.oracle.traffic import generate, mutate
from tests.packets import batch_of

TAGS = (0x8100, 0x88A8, 0x9100)
# Of each link type: bytes of the header, where the sender's hardware address lies, and where the EtherType does.
HEADERS = {LinkType.ETHERNET: (14, 6, 12), LinkType.LINUX_SLL: (16, 6, 14), LinkType.LINUX_SLL2: (20, 12, 0)}


class Told(NamedTuple):
    """What is told of who sent a frame; the hardware address is a number."""

    row: int
    hardware: int = 0
    vlan: int = UNKNOWN
    ip: str = ""
    ttl: int = UNKNOWN
    announces: bool = False


def of_network(told: Told, kind: int, data: bytes) -> Told:
    """Add what the network layer says."""
    if kind == 0x0800 and len(data) >= 20 and data[0] >> 4 == 4 and data[0] & 15 >= 5:
        return told._replace(ip=".".join(map(str, data[12:16])), ttl=data[8])
    if kind == 0x86DD and len(data) >= 40 and data[0] >> 4 == 6:
        halves = int.from_bytes(data[8:16], "big"), int.from_bytes(data[16:24], "big")
        return told._replace(ip=address.text(*halves), ttl=data[7]) if any(halves) else told
    if kind == 0x0806 and len(data) >= 28 and data[:6] == b"\0\1\x08\0\6\4" and any(data[14:18]):
        return told._replace(ip=".".join(map(str, data[14:18])), announces=data[14:18] == data[24:28])
    return told


def read_singly(row: int, frame: Frame) -> Told:
    told, data = Told(row), frame.data
    if frame.link in HEADERS:
        size, at, kind_at = HEADERS[frame.link]
        if len(data) < size:
            return told
        told = told._replace(hardware=int.from_bytes(data[at : at + 6], "big"))
        kind, rest = int.from_bytes(data[kind_at : kind_at + 2], "big"), data[size:]
        for _ in range(8):
            if kind not in TAGS or len(rest) < 4:
                break
            if told.vlan == UNKNOWN:
                told = told._replace(vlan=int.from_bytes(rest[:2], "big") & 0xFFF)
            kind, rest = int.from_bytes(rest[2:4], "big"), rest[4:]
        return of_network(told, kind, rest)
    if frame.link in (LinkType.NULL, LinkType.LOOP):
        if len(data) < 4:
            return told
        family = int.from_bytes(data[:4], "big" if frame.link == LinkType.LOOP else "little")
        if frame.link == LinkType.NULL and family > 0xFFFF:
            family = int.from_bytes(data[:4], "big")
        kind = 0x0800 if family == 2 else 0x86DD if family in (24, 28, 30) else 0
        return of_network(told, kind, data[4:])
    version = data[0] >> 4 if data else 0
    kinds = {LinkType.IPV4: 4, LinkType.IPV6: 6}
    return of_network(told, {4: 0x0800, 6: 0x86DD}.get(kinds.get(LinkType(frame.link), version), 0), data)


def told_of(batch: PacketBatch) -> list[Told]:
    found = addresses_of(batch)
    columns = found.row, found.hardware, found.vlan, found.high, found.low, found.ttl, found.announces
    return [
        Told(row, hardware, vlan, address.text(high, low) if high or low else "", ttl, announces)
        for row, hardware, vlan, high, low, ttl, announces in zip(*(one.tolist() for one in columns), strict=True)
    ]


@given(st.integers(0, 10_000), st.sampled_from([*LINKS, None]))
@example(767, LinkType.ETHERNET)  # an IPv6 sender without an address
@examples(100)
def test_it_is_what_is_read_of_one_frame_after_the_other(seed: int, link: int | None) -> None:
    frames = generate(seed, frames=80, link=link)
    if seed % 2:
        frames = mutate(seed, frames)
    expected = [read_singly(row, frame) for row, frame in enumerate(frames) if frame.link in {*LINKS, ETHERNET}]
    assert told_of(batch_of(frames)) == [told for told in expected if told.hardware or told.ip]


@pytest.mark.parametrize("tags", [(), (5,), (7, 9)])
def test_frames_of_any_kind_tell_who_sent_them(tags: tuple[int, ...]) -> None:
    link = Ether(src="02:00:00:00:00:2a", dst="ff:ff:ff:ff:ff:ff")
    for tag in tags:
        link /= Dot1Q(vlan=tag, prio=3)
    hardware, vlan = 0x0200_0000_002A, tags[0] if tags else UNKNOWN
    asks = {"hwsrc": "02:00:00:00:00:2a", "psrc": "10.0.0.1"}
    packets = [
        (link / IP(src="10.0.0.1", ttl=3) / ICMP(), ("10.0.0.1", 3, False)),
        (link / IP(src="10.0.0.1", ttl=64, frag=7) / b"a fragment", ("10.0.0.1", 64, False)),
        (link / IPv6(src="fe80::1", hlim=255) / TCP(), ("fe80::1", 255, False)),
        (link / ARP(op=1, pdst="10.0.0.9", **asks), ("10.0.0.1", UNKNOWN, False)),
        (link / ARP(op=1, pdst="10.0.0.1", **asks), ("10.0.0.1", UNKNOWN, True)),
        (link / ARP(op=1, pdst="10.0.0.1", hwsrc="02:00:00:00:00:2a", psrc="0.0.0.0"), ("", UNKNOWN, False)),
        (link / b"something else", ("", UNKNOWN, False)),
    ]
    batch = PacketBatch.of([bytes(packet) for packet, _ in packets], LinkType.ETHERNET)
    assert told_of(batch) == [
        Told(row, hardware, vlan, ip, ttl, announces) for row, (_, (ip, ttl, announces)) in enumerate(packets)
    ]


@given(st.binary(max_size=80), st.sampled_from(LINKS))
@examples(100)
def test_no_bytes_raise(data: bytes, link: int) -> None:
    chance = random.Random(len(data))
    pieces = [data[: chance.randrange(len(data) + 1)] for _ in range(3)]
    assert (np.diff(addresses_of(PacketBatch.of(pieces, link)).row) > 0).all()
