"""Frames of all the kinds that are no telegrams, with a telegram among them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scapy.layers.inet import ICMP, IP, TCP, UDP, fragment
from scapy.layers.inet6 import (
    ICMPv6DestUnreach,
    ICMPv6EchoReply,
    ICMPv6EchoRequest,
    ICMPv6ND_NA,
    ICMPv6ND_NS,
    ICMPv6NDOptDstLLAddr,
    ICMPv6NDOptSrcLLAddr,
    IPv6,
    IPv6ExtHdrHopByHop,
)
from scapy.layers.l2 import ARP, Dot1Q, Dot3, Ether
from scapy.utils import wrpcap

from dissectors.scapy_layers import NetVar

A, B = "02:00:00:00:00:01", "02:00:00:00:00:02"
ALL = "ff:ff:ff:ff:ff:ff"
START_S = 1_700_000_000
_NOBODY = "00:00:00:00:00:00"


def kinds() -> list[tuple[str, Any]]:
    """Return a name for each frame, and the frame."""
    here, there, router = "10.0.0.1", "10.0.0.9", "10.0.0.254"
    near, far = "fe80::1", "fe80::9"
    data = UDP(sport=1202, dport=1202) / NetVar(index=7, items=1) / b"\x2a\x00"
    sent, sent_v6 = IP(src=here, dst=there) / data, IPv6(src=near, dst=far) / data
    to, own = Ether(src=A, dst=B), ICMPv6NDOptSrcLLAddr(lladdr=A)
    fragments = fragment(IP(src=here, dst=there, id=9) / ICMP(type=8) / (b"z" * 2000), fragsize=1400)
    return [
        ("arp request", Ether(src=A, dst=ALL) / ARP(op=1, hwsrc=A, psrc=here, hwdst=_NOBODY, pdst=there)),
        ("arp reply", to / ARP(op=2, hwsrc=B, psrc=there, hwdst=A, pdst=here)),
        ("gratuitous", Ether(src=A, dst=ALL) / ARP(op=1, hwsrc=A, psrc=here, hwdst=_NOBODY, pdst=here)),
        ("probe", Ether(src=A, dst=ALL) / ARP(op=1, hwsrc=A, psrc="0.0.0.0", hwdst=_NOBODY, pdst=here)),
        ("tagged arp", Ether(src=A, dst=ALL) / Dot1Q(vlan=5) / ARP(op=2, hwsrc=A, psrc=here, hwdst=ALL, pdst=here)),
        ("telegram", to / sent),
        ("port unreachable", to / IP(src=there, dst=here) / ICMP(type=3, code=3) / bytes(sent)),
        ("echo", to / IP(src=here, dst=there) / ICMP(type=8, id=7, seq=1) / b"abcdefgh"),
        ("too long", to / IP(src=router, dst=here) / ICMP(type=3, code=4, nexthopmtu=1400) / bytes(sent)[:28]),
        ("time exceeded", to / IP(src=router, dst=here) / ICMP(type=11, code=0) / bytes(sent)[:28]),
        ("redirect", to / IP(src=router, dst=here) / ICMP(type=5, code=1, gw="10.0.0.3") / bytes(sent)[:28]),
        ("unknown icmp", to / IP(src=router, dst=here) / ICMP(type=77, code=9)),
        ("solicitation", to / IPv6(src=near, dst="ff02::1:ff00:9") / ICMPv6ND_NS(tgt=far) / own),
        ("advertisement", to / IPv6(src=far, dst=near) / ICMPv6ND_NA(tgt=far) / ICMPv6NDOptDstLLAddr(lladdr=B)),
        ("unreachable v6", to / IPv6(src=far, dst=near) / ICMPv6DestUnreach(code=4) / bytes(sent_v6)),
        ("echo v6", to / IPv6(src=near, dst=far) / ICMPv6EchoRequest(id=3, seq=4)),
        ("behind an extension", to / IPv6(src=far, dst=near) / IPv6ExtHdrHopByHop() / ICMPv6EchoReply(id=3, seq=4)),
        ("tcp", to / IP(src=here, dst=there) / TCP(sport=49152, dport=80, flags="S")),
        ("igmp", to / IP(src=here, dst="224.0.0.22", proto=2) / b"\x22\x00\xf9\xfe\x00\x00\x00\x00"),
        ("udp", to / IP(src=here, dst="224.0.0.251") / UDP(sport=5353, dport=5353) / (b"x" * 20)),
        ("udp v6", to / Dot1Q(vlan=9) / IPv6(src=near, dst=far) / UDP(sport=7, dport=9) / b"xyz"),
        ("lldp", Ether(src=A, dst="01:80:c2:00:00:0e", type=0x88CC) / (b"\x02\x07\x04" + b"\0" * 40)),
        ("802.3", Dot3(src=A, dst="01:80:c2:00:00:00", len=38) / (b"\x42\x42\x03" + b"\0" * 35)),
        *((f"fragment {number}", to / part) for number, part in enumerate(fragments)),
    ]  # fmt: skip


NAMES = [name for name, _ in kinds()]


def write_kinds(path: Path) -> None:
    """Write all of them as a capture, a hundredth of a second apart."""
    frames = []
    for number, (_, frame) in enumerate(kinds()):
        frame.time = START_S + number * 0.01
        frames.append(frame)
    wrpcap(str(path), frames)
