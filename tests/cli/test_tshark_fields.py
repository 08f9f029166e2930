"""Every field that tshark has too, as it writes it: on sample captures and on frames of every kind, whole and cut."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from scapy.layers.inet import ICMP, IP, TCP, UDP, fragment
from scapy.layers.inet6 import (
    ICMPv6DestUnreach,
    ICMPv6PacketTooBig,
    IPv6,
    IPv6ExtHdrDestOpt,
    IPv6ExtHdrFragment,
    IPv6ExtHdrHopByHop,
    fragment6,
)
from scapy.layers.l2 import ARP, Dot1AD, Dot1Q, Ether

from dissectors.batch import LinkType
from dissectors.scapy_layers import NetVar
from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap
from tests.other_frames import A, B, kinds
from tests.program_here import run_text

needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")

CAPTURES = Path(__file__).parents[2] / "captures"
SCENARIOS = Path(__file__).parents[1] / "scenarios"
SAMPLES = ("interfaces.pcapng", "peers/peers.pcap", "plant.pcapng.gz", "telegrams.pcap")
BUILT = (
    "can-and-ethernet", "can-error-frames", "can-other-frames", "foreign-traffic", "fragments", "ipv6", "link-loop",
    "link-null", "link-raw", "link-sll", "link-sll2", "truncated", "unreachable", "vlan", "wild",
)  # fmt: skip

TOLD_OTHERWISE = {"frame.time", "arp", "icmp", "icmpv6"}
"""A date as of ISO 8601, and 1 or 0 for protocols, of which tshark writes a title."""

OF_PACKETS = ("ip.src", "ip.dst", "ip.version", "ipv6.src", "ipv6.dst")
OF_FRAGMENTS = ("ip.flags.mf", "ip.frag_offset", "ipv6.fraghdr.more", "ipv6.fraghdr.offset")
OF_WHAT_IS_IN_THEM = ("udp.", "tcp.", "icmp.", "icmpv6.")
CAN_FLAGS = ("can.flags.xtd", "can.flags.rtr", "can.flags.err")
"""Where tshark leaves them out, in frames of CAN FD and in error frames, they are 0 here."""

TO = Ether(src=A, dst=B)
V4, V6 = IP(src="10.0.0.1", dst="10.0.0.9"), IPv6(src="fe80::1", dst="fe80::9")
TELEGRAM = UDP(sport=1202, dport=1202) / NetVar(index=7, items=1) / b"\x2a\x00"
LARGE = UDP(sport=1202, dport=1202) / NetVar(index=7, items=1) / (b"z" * 3000)
FRAGMENTS = [*fragment(V4 / LARGE, 1000), *fragment6(V6 / IPv6ExtHdrFragment(id=5) / LARGE, 1200)]
LLDP = b"\x02\x07\x04" + bytes(40)
IN_ETHERTYPES = (
    (0x0800, V4 / TELEGRAM), (0x86DD, V6 / TELEGRAM), (0x0806, ARP(psrc="10.0.0.1", pdst="10.0.0.2")), (0x88CC, LLDP),
    (0x8100, Dot1Q(vlan=7) / Dot1Q(vlan=9) / V4 / TELEGRAM), (0x0800, V4 / ICMP(type=8)), (0x0800, FRAGMENTS[0]),
    (0x0800, V4 / TCP(sport=5, dport=6)), (4, bytes(40)), (1, bytes(30)), (0x88A8, Dot1Q(vlan=7) / V4 / TELEGRAM),
)  # fmt: skip


def quoting(quoted: bytes, kind: int = 3, code: int = 3) -> Any:
    return TO / IP(src="10.0.0.254", dst="10.0.0.1") / ICMP(type=kind, code=code) / quoted


def can(identifier: int, data: bytes = b"", flags: int = 0, length: int | None = None) -> bytes:
    return struct.pack(">IBBBB", identifier, len(data) if length is None else length, flags, 0, 0) + data


FRAMES: dict[str, tuple[int, Sequence[Any]]] = {
    "kinds": (LinkType.ETHERNET, [frame for _, frame in kinds()]),
    "tags": (LinkType.ETHERNET, [
        TO / Dot1Q(vlan=7) / Dot1Q(vlan=100) / V4 / TELEGRAM,
        TO / Dot1AD(vlan=7) / Dot1Q(vlan=100) / V4 / TELEGRAM,
        TO / Dot1AD(vlan=7) / V6 / TELEGRAM,
        TO / Dot1Q(vlan=0, prio=6) / V4 / TELEGRAM,
        TO / Dot1Q(vlan=1) / Dot1Q(vlan=2) / Dot1Q(vlan=3) / Dot1Q(vlan=4) / ARP(psrc="10.0.0.1", pdst="10.0.0.2"),
        TO / Dot1Q(vlan=7) / Dot1Q(vlan=100, type=0x88CC) / LLDP,
        Ether(bytes(TO)[:12] + b"\x91\x00\x00\x05\x08\x00" + bytes(V4 / TELEGRAM)),
        Ether(bytes(TO)[:12] + b"\x92\x00\x00\x05\x08\x00" + bytes(V4 / TELEGRAM)),
    ]),
    "fragments": (LinkType.ETHERNET, [
        *(TO / part for part in FRAGMENTS),
        TO / V6 / IPv6ExtHdrFragment(id=6, nh=17) / TELEGRAM,
        *(TO / part for part in reversed(fragment(V4 / LARGE, 504))),
        *(TO / Dot1Q(vlan=4) / Dot1Q(vlan=5) / part for part in fragment(V4 / TCP() / bytes(2000), 1000)),
    ]),
    "icmp": (LinkType.ETHERNET, [
        *(quoting(bytes(V4 / TELEGRAM), *kind) for kind in ((3, 0), (3, 3), (4, 0), (5, 1), (11, 0), (12, 0))),
        *(quoting(bytes(inner)) for inner in (V4 / TCP(), V4 / ICMP(type=8), FRAGMENTS[0], FRAGMENTS[1])),
        quoting(bytes(V4 / TELEGRAM)[:28]),
        TO / V6 / ICMPv6DestUnreach(code=4) / bytes(V6 / TELEGRAM),
        TO / V6 / ICMPv6PacketTooBig(mtu=1280) / bytes(V6 / TCP()),
    ]),
    "in other packets": (LinkType.ETHERNET, [TO / V4 / V4 / TELEGRAM, TO / V4 / V6 / TELEGRAM]),
    "options": (LinkType.ETHERNET, [
        TO / IP(src="10.0.0.1", dst="10.0.0.9", options=b"\x01" * 8) / TELEGRAM,
        TO / V6 / IPv6ExtHdrHopByHop() / IPv6ExtHdrDestOpt() / TELEGRAM,
        TO / IP(src="10.0.0.1", dst="10.0.0.9", len=0) / TELEGRAM,
        TO / V4 / UDP(sport=4000, dport=1202),
    ]),
    "arp": (LinkType.ETHERNET, [
        *(TO / ARP(op=number, psrc="10.0.0.1", pdst="10.0.0.2") for number in (1, 2, 8, 9)),
        *(
            Ether(src=A, dst=B, type=0x0806) / (struct.pack(">HHBBH", *fixed, 1) + bytes(range(60)))
            for fixed in ((6, 0x0800, 6, 4), (1, 0x86DD, 6, 16), (1, 0x0800, 8, 4), (1, 0x0800, 0, 4), (1, 0x80B, 6, 4))
        ),
    ]),
    "sll": (LinkType.LINUX_SLL, [
        struct.pack(">HHH8sH", 0, 1, 6, b"\2" * 8, kind) + bytes(inside) for kind, inside in IN_ETHERTYPES
    ]),
    "sll2": (LinkType.LINUX_SLL2, [
        struct.pack(">HHIHBB8s", kind, 0, 2, 1, 0, 6, b"\2" * 8) + bytes(inside) for kind, inside in IN_ETHERTYPES
    ]),
    "null": (LinkType.NULL, [
        *(struct.pack(order + "I", 2) + bytes(V4 / TELEGRAM) for order in "<>"),
        *(struct.pack("<I", family) + bytes(V6 / TELEGRAM) for family in (24, 28, 30)),
        *(struct.pack("<I", family) + bytes(40) for family in (7, 16, 23, 99)),
    ]),
    "loop": (LinkType.LOOP, [struct.pack(">I", 2) + bytes(V4 / TELEGRAM), struct.pack(">I", 16) + bytes(40)]),
    "raw": (LinkType.RAW, [V4 / TELEGRAM, V6 / TELEGRAM, V4 / ICMP(type=8), *FRAGMENTS[:2], V4 / TCP(), b"\xf0" * 20]),
    "raw ipv4": (LinkType.IPV4, [V4 / TELEGRAM, FRAGMENTS[0]]),
    "raw ipv6": (LinkType.IPV6, [V6 / TELEGRAM, FRAGMENTS[-1]]),
    "can": (LinkType.CAN_SOCKETCAN, [
        *(can(number, bytes(size)) for number, size in ((0x110, 3), (0x7FF, 0), (1 << 31 | 0x110, 1), (0x9FFFFFFF, 8))),
        *(can(1 << 30 | number, length=size) for number, size in ((0x110, 0), (1 << 31 | 0x110, 4))),
        *(can(1 << 29 | classes, bytes(range(8))) for classes in (0, 4, 0x1FF)),
        *(can(0x123, bytes(size), 4 | more) for size, more in ((12, 0), (64, 1), (16, 2), (8, 3))),
        can(1 << 31 | 0x123, bytes(20), 7),
    ]),
}  # fmt: skip


@cache
def names() -> list[str]:
    """Return the fields of both, by which every frame can be found again in front."""
    told = run_text("keys", "--fields", "--json")
    own = {field["name"] for field in json.loads(told.stdout)["fields"] if field["output"]}
    every = subprocess.run(["tshark", "-G", "fields"], capture_output=True, text=True, check=True).stdout
    theirs = {line.split("\t")[2] for line in every.splitlines() if line.startswith("F")}
    return ["frame.number", *sorted((own & theirs) - TOLD_OTHERWISE - {"frame.number"})]


def ours(path: Path) -> list[dict[str, str]]:
    asked = [word for name in names() for word in ("-e", name)]
    done = run_text("packets", "-q", path, "--all-frames", "-T", "fields", *asked)
    assert done.returncode == 0, done.stderr
    return [dict(zip(names(), line.split("\t"), strict=True)) for line in done.stdout.splitlines()]


def theirs(path: Path) -> list[dict[str, str]]:
    """Return the same of tshark, with what the differences that are meant depend on."""
    wanted = [*names(), "frame.protocols", *OF_FRAGMENTS]
    asked = [word for name in wanted for word in ("-e", name)]
    command = ["tshark", "-n", "-o", "ip.defragment:FALSE", "-o", "ipv6.defragment:FALSE", "-r", str(path)]
    done = subprocess.run([*command, "-T", "fields", *asked], capture_output=True, text=True, check=True)
    return [dict(zip(wanted, line.split("\t"), strict=True)) for line in done.stdout.splitlines()]


def as_meant(told: dict[str, str]) -> dict[str, str]:
    """Return what tshark writes of a frame with the differences that README names."""
    meant = {name: told[name] for name in names()}
    layers = [layer for layer in told["frame.protocols"].split(":") if layer in ("ip", "ipv6")]
    for name in ("ip.src", "ip.dst"):
        both = [told[name], told[name.replace("ip.", "ipv6.")]]
        meant[name] = both[layers[0] == "ipv6"] if layers else ""
        if layers[:1] != ["ipv6"]:
            # That of a packet in another, not of the frame's own.
            meant[name.replace("ip.", "ipv6.")] = ""
    carried = len(layers) > 1
    if carried:
        meant |= {name: meant[name].split(",")[0] for name in meant if name in OF_PACKETS or name.startswith("icmp")}
    fragmented = any(told[name].split(",")[0] not in ("", "0") for name in OF_FRAGMENTS)
    if fragmented or carried:
        gone = OF_WHAT_IS_IN_THEM if fragmented else ("udp.", "tcp.")
        meant |= {name: "" for name in meant if name.startswith(gone)}
    if told["can.len"]:
        meant |= {name: meant[name] or "0" for name in CAN_FLAGS}
    return meant


def one_behind_the_other(captures: Sequence[Path]) -> Path:
    """Put captures of all link types into one, since the start of tshark takes longer than reading any of them."""
    whole = captures[0].parent / "whole.pcapng"
    subprocess.run(["mergecap", "-a", "-w", whole, *captures], capture_output=True, check=True)
    return whole


def whole_frames() -> dict[str, list[tuple[bytes, int]]]:
    """Return the frames of every kind with their lengths."""
    return {name: [(bytes(frame), len(frame)) for frame in frames] for name, (_, frames) in FRAMES.items()}


def of_every_kind(folder: Path, frames: dict[str, list[tuple[bytes, int]]]) -> Path:
    """Write frames of all kinds, with their lengths on the wire, one kind behind the other into a capture."""
    folder.mkdir()
    captures = [folder / f"{name}.pcap" for name in frames]
    for capture, own in zip(captures, frames.values(), strict=True):
        write(capture, FRAMES[capture.stem][0], [data for data, _ in own], [size for _, size in own])
    return one_behind_the_other(captures)


def compare(path: Path) -> None:
    own, other = ours(path), theirs(path)
    assert len(own) == len(other) > 0
    for row, told in zip(own, other, strict=True):
        assert row == as_meant(told), row["frame.number"]


def write(path: Path, link: int, frames: Sequence[bytes], original: Sequence[int]) -> None:
    write_pcap(
        [
            Frame(1_700_000_000_000_000_000 + number * 10_000_000, link, data, size)
            for number, (data, size) in enumerate(zip(frames, original, strict=True))
        ],
        path,
    )


@needs_tshark
def test_what_both_have_is_compared() -> None:
    assert {
        "ip.src",
        "ipv6.src",
        "ipv6.dst",
        "can.id",
        "vlan.id",
        "ieee8021ad.id",
        "udp.srcport",
        "tcp.dstport",
        "arp.opcode",
        "eth.type",
    } <= set(names())
    assert len(names()) > 40


@needs_tshark
@pytest.mark.parametrize("name", SAMPLES)
def test_samples_are_told_alike(name: str) -> None:
    compare(CAPTURES / name)


@needs_tshark
def test_scenarios_are_told_alike(tmp_path: Path) -> None:
    captures = [tmp_path / f"{name}.pcapng" for name in BUILT]
    for capture in captures:
        assert run_text("simulate", SCENARIOS / f"{capture.stem}.toml", "-w", capture).returncode == 0
    compare(one_behind_the_other(captures))


@needs_tshark
def test_frames_of_every_kind_are_told_alike(tmp_path: Path) -> None:
    compare(of_every_kind(tmp_path / "whole", whole_frames()))


@needs_tshark
def test_of_cut_frames_nothing_else_is_told(tmp_path: Path) -> None:
    """What a cut frame still has is what it has whole, whether tshark tells it or not; addresses and VLANs as there."""
    data = whole_frames()
    cut = {
        name: [(one[:size], len(one)) for one, _ in own for size in range(min(len(one), 100))]
        for name, own in data.items()
    }  # fmt: skip
    of_whole = [row for row, (one, _) in enumerate(row for own in data.values() for row in own) for _ in one[:100]]
    path = of_every_kind(tmp_path / "cut", cut)
    whole, told, other = ours(of_every_kind(tmp_path / "whole", data)), ours(path), theirs(path)
    assert len(told) == len(other) == len(of_whole)
    for row, own, their in zip(of_whole, told, other, strict=True):
        for field, value in own.items():
            if field.startswith(("eth.", "vlan.", "frame.")):
                assert value == their[field], (row, field)
            elif field == "udp.payload":
                assert whole[row][field].startswith(value), (row, field)
            else:
                assert value in ("", whole[row][field]), (row, field)


def test_an_identifier_is_filtered_by_in_any_base(tmp_path: Path) -> None:
    link, frames = FRAMES["can"]
    write(tmp_path / "a.pcap", link, [bytes(frame) for frame in frames], [len(frame) for frame in frames])
    for wanted in ("can.id == 0x110", "can.id == 272"):
        done = run_text("packets", "-q", tmp_path / "a.pcap", "-Y", wanted, "-e", "can.id")
        assert done.stdout.split() == ["272"] * 4


@needs_tshark
@pytest.mark.parametrize("wanted", ["ipv6.addr == fe80::9", "ipv6.src == fe80::9", "ipv6.dst == fe80::9", "!ipv6.src"])
def test_addresses_of_ipv6_are_filtered_by_as_in_tshark(wanted: str, tmp_path: Path) -> None:
    back = IPv6(src="fe80::9", dst="fe80::1") / TELEGRAM
    frames = [bytes(TO / packet) for packet in (V4 / TELEGRAM, V6 / TELEGRAM, back)]
    write(tmp_path / "a.pcap", LinkType.ETHERNET, frames, [len(frame) for frame in frames])
    done = run_text("packets", "-q", tmp_path / "a.pcap", "-Y", wanted, "-T", "fields", "-e", "frame.number")
    asked = ["tshark", "-n", "-r", str(tmp_path / "a.pcap"), "-Y", wanted, "-T", "fields", "-e", "frame.number"]
    told = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
    assert done.stdout.split() == told.split() != []
