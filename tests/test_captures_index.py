"""The captures in ``captures/`` are all in its index, tshark reads them, and those made here are made of what they say.

Run as a program, this file writes the captures that it makes: ``python -m tests.test_captures_index``.
"""

from __future__ import annotations

import csv
import shutil
import struct
import subprocess
import tomllib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from scapy.layers.inet import IP, UDP, fragment
from scapy.layers.inet6 import IPv6
from scapy.layers.l2 import ARP, CookedLinux, CookedLinuxV2, Dot1AD, Dot1Q, Ether
from scapy.packet import Packet, Raw

from dissectors.batch import LinkType
from dissectors.scapy_layers import NetVar

CAPTURES = Path(__file__).parents[1] / "captures"
INDEX: dict[str, list[dict[str, Any]]] = tomllib.loads((CAPTURES / "index.toml").read_text())
CAPTURE_ENTRIES = INDEX["capture"]
KEYS = {
    "capture": ({"file", "frames", "telegrams", "origin", "shows"}, {"licence", "truncated"}),
    "definition": ({"file", "origin", "shows"}, {"licence"}),
    "values": ({"file", "origin", "shows"}, {"licence"}),
    "scenario": ({"file", "origin", "shows"}, {"licence"}),
    "rules": ({"file", "origin", "shows"}, {"licence"}),
    "database": ({"file", "origin", "shows"}, {"licence"}),
    "configuration": ({"file", "origin", "shows"}, {"licence"}),
    "licence": ({"file", "origin", "shows"}, set()),
}
TIMES_START_NS = 1_700_000_000_000_000_000
MILLISECOND_NS = 1_000_000


def on_the_wire(frame: Packet) -> bytes:
    """Return a frame as a mirror port shows it: never shorter than Ethernet allows."""
    return bytes(frame).ljust(60, b"\x00")


def tsv_rows() -> list[dict[str, str]]:
    with (CAPTURES / "telegrams.tsv").open(newline="") as file:
        return list(csv.DictReader(file, delimiter="\t"))


def telegrams_pcap() -> bytes:
    """Put every row of ``telegrams.tsv`` into a frame: one sender per provenance, one frame per 100 ms."""
    sources: dict[str, int] = {}
    capture = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, LinkType.ETHERNET)
    for number, row in enumerate(tsv_rows()):
        host = sources.setdefault(row["provenance"], len(sources) + 1)
        frame = on_the_wire(
            Ether(src=f"02:00:00:00:00:{host:02x}", dst="ff:ff:ff:ff:ff:ff")
            / IP(src=f"192.0.2.{host}", dst="255.255.255.255", id=number)
            / UDP(sport=1202, dport=1202)
            / Raw(bytes.fromhex(row["hex"]))
        )
        seconds, rest_ns = divmod(TIMES_START_NS + number * 100 * MILLISECOND_NS, 1_000_000_000)
        capture += struct.pack("<IIII", seconds, rest_ns // 1000, len(frame), len(frame)) + frame
    return capture


def cut_pcap() -> bytes:
    """Cut the peers' capture in the middle of its hundredth record."""
    whole = (CAPTURES / "peers" / "peers.pcap").read_bytes()
    position = 24
    for _ in range(99):
        position += 16 + struct.unpack_from("<I", whole, position + 8)[0]
    return whole[: position + 16 + 30]


def padded(content: bytes) -> bytes:
    return content.ljust(-(-len(content) // 4) * 4, b"\x00")


class PcapngWriter:
    """Blocks of one byte order, one after the other, as draft-ietf-opsawg-pcapng orders them."""

    def __init__(self, order: str, comment: str) -> None:
        self.order = order
        self.blocks = b""
        self.resolutions: list[tuple[int, int]] = []
        options = self._option(1, comment.encode()) + self._option(0, b"")
        self._block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1) + options)

    def _option(self, code: int, value: bytes) -> bytes:
        return struct.pack(self.order + "HH", code, len(value)) + padded(value)

    def _block(self, kind: int, body: bytes) -> None:
        body = padded(body)
        length = struct.pack(self.order + "I", 12 + len(body))
        self.blocks += struct.pack(self.order + "I", kind) + length + body + length

    def interface(
        self,
        link: LinkType,
        name: str,
        ticks_per_second: int = 1_000_000,
        resolution: int | None = None,
        offset_s: int = 0,
    ) -> None:
        options = self._option(2, name.encode())
        if resolution is not None:
            options += self._option(9, bytes((resolution,)))
        if offset_s:
            options += self._option(14, struct.pack(self.order + "q", offset_s))
        self.resolutions.append((ticks_per_second, offset_s))
        self._block(1, struct.pack(self.order + "HHI", link, 0, 262144) + options + self._option(0, b""))

    def _ticks(self, interface: int, time_ns: int) -> tuple[int, int]:
        per_second, offset_s = self.resolutions[interface]
        return divmod((time_ns - offset_s * 1_000_000_000) * per_second // 1_000_000_000, 1 << 32)

    def packet(self, interface: int, time_ns: int, frame: bytes, comment: str = "") -> None:
        """Write an enhanced packet block."""
        options = self._option(1, comment.encode()) + self._option(0, b"") if comment else b""
        head = struct.pack(self.order + "IIIII", interface, *self._ticks(interface, time_ns), len(frame), len(frame))
        self._block(6, head + padded(frame) + options)

    def obsolete_packet(self, interface: int, time_ns: int, frame: bytes, drops: int) -> None:
        head = struct.pack(
            self.order + "HHIIII", interface, drops, *self._ticks(interface, time_ns), len(frame), len(frame)
        )
        self._block(2, head + frame)

    def statistics(self, interface: int, time_ns: int, received: int, dropped: int) -> None:
        options = self._option(4, struct.pack(self.order + "Q", received))
        options += self._option(5, struct.pack(self.order + "Q", dropped)) + self._option(0, b"")
        self._block(5, struct.pack(self.order + "III", interface, *self._ticks(interface, time_ns)) + options)

    def unknown(self, kind: int, body: bytes) -> None:
        self._block(kind, body)


def interfaces_pcapng() -> bytes:
    """One list seen through every kind of interface, its counter rising without a gap; then a second section."""
    counter = 0

    def telegram(*network: Packet) -> Packet:
        nonlocal counter
        counter += 1
        content = NetVar(index=7, items=2, counter=counter) / Raw(struct.pack("<HH", counter, 2 * counter))
        datagram = UDP(sport=1202, dport=1202) / content
        return (network[0] if network else IP(src="192.0.2.1", dst="255.255.255.255", id=counter)) / datagram

    def ethernet(*layers: Packet) -> bytes:
        frame: Packet = Ether(src="02:00:00:00:00:01", dst="ff:ff:ff:ff:ff:ff")
        for layer in layers:
            frame /= layer
        return on_the_wire(frame)

    def cooked(layer: Packet) -> bytes:
        return bytes(CookedLinux(pkttype=1, lladdrlen=6, src=b"\x02\0\0\0\0\x01\0\0", proto=0x0800) / layer)

    def cooked_v2(layer: Packet) -> bytes:
        head = CookedLinuxV2(pkttype=1, lladdrlen=6, src=b"\x02\0\0\0\0\x01\0\0", proto=0x0800, ifindex=2)
        return bytes(head / layer)

    def loopback(layer: Packet) -> bytes:
        return struct.pack("<I", 2) + bytes(layer)

    first = PcapngWriter("<", "list 7 of one controller through five kinds of interfaces")
    first.interface(LinkType.ETHERNET, "mirror")
    first.interface(LinkType.LINUX_SLL, "any", 1_000_000_000, 9)
    first.interface(LinkType.LINUX_SLL2, "any2", 1000, 3, offset_s=1_600_000_000)
    first.interface(LinkType.RAW, "tun0", 1 << 20, 0x80 | 20)
    first.interface(LinkType.NULL, "lo0")
    time_ns = TIMES_START_NS
    plan: list[tuple[int, Callable[[Packet], bytes]]] = [
        (0, ethernet), (1, cooked), (2, cooked_v2), (3, bytes), (4, loopback),
        (0, lambda packet: ethernet(Dot1Q(vlan=10), packet)),
        (0, lambda packet: ethernet(Dot1AD(vlan=20), Dot1Q(vlan=10), packet)),
    ]  # fmt: skip
    for turn in range(3):
        for interface, framed in plan:
            comment = "first telegram after the restart of the press" if not turn and framed is cooked else ""
            first.packet(interface, time_ns, framed(telegram()), comment)
            time_ns += 50 * MILLISECOND_NS
    first.packet(0, time_ns, ethernet(ARP(psrc="192.0.2.9", pdst="192.0.2.1", hwsrc="02:00:00:00:00:09")))
    first.obsolete_packet(0, time_ns + MILLISECOND_NS, ethernet(telegram()), drops=0)
    first.unknown(0x80000001, b"a block for local use")
    long = (
        IP(src="192.0.2.5", dst="192.0.2.255", id=99) / UDP(sport=1202, dport=1202) / NetVar(index=8) / Raw(bytes(100))
    )
    for part in fragment(IP(bytes(long)), 64):  # type: ignore[no-untyped-call]  # Scapy leaves this one function untyped
        first.packet(0, time_ns + 2 * MILLISECOND_NS, ethernet(part))
    first.statistics(0, time_ns + 3 * MILLISECOND_NS, received=100, dropped=4)
    first.statistics(1, time_ns + 3 * MILLISECOND_NS, received=3, dropped=1)

    counter = 0
    second = PcapngWriter(">", "the other byte order, and IPv6")
    second.interface(LinkType.ETHERNET, "mirror", 1_000_000_000, 9)
    for _ in range(4):
        time_ns += 50 * MILLISECOND_NS
        second.packet(0, time_ns, ethernet(telegram(IPv6(src="2001:db8::1", dst="ff02::1"))))
    return first.blocks + second.blocks


MADE_HERE: dict[str, Callable[[], bytes]] = {
    "telegrams.pcap": telegrams_pcap,
    "truncated.pcap": cut_pcap,
    "interfaces.pcapng": interfaces_pcapng,
}


def tshark(capture: str, *arguments: str, truncated: bool) -> list[str]:
    """Return the lines that tshark prints; a truncated file makes it end with 2 after the last whole record."""
    command = ["tshark", "-n", "-r", str(CAPTURES / capture), "-o", "ip.defragment:FALSE", *arguments]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (finished.returncode, "cut short" in finished.stderr) == ((2, True) if truncated else (0, False))
    return finished.stdout.splitlines()


def test_every_file_is_in_the_index_once_and_every_entry_is_a_file() -> None:
    listed = [entry["file"] for entries in INDEX.values() for entry in entries]
    present = [path.relative_to(CAPTURES).as_posix() for path in CAPTURES.rglob("*") if path.is_file()]
    assert sorted([*listed, "index.toml"]) == sorted(present)


@pytest.mark.parametrize("kind", INDEX)
def test_entries_say_where_a_file_comes_from_and_what_it_shows(kind: str) -> None:
    required, optional = KEYS[kind]
    for entry in INDEX[kind]:
        assert required <= entry.keys() <= required | optional, entry["file"]
        assert all(len(entry[key].split()) >= 3 for key in ("origin", "shows")), entry["file"]


@pytest.mark.parametrize("name", MADE_HERE)
def test_files_made_here_are_what_their_maker_makes(name: str) -> None:
    assert (CAPTURES / name).read_bytes() == MADE_HERE[name]()


needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
each_capture = pytest.mark.parametrize("entry", CAPTURE_ENTRIES, ids=[entry["file"] for entry in CAPTURE_ENTRIES])


@needs_tshark
@each_capture
def test_tshark_counts_the_frames_and_telegrams_of_the_index(entry: dict[str, Any]) -> None:
    truncated = entry.get("truncated", False)
    is_telegram = (
        "udp.length >= 20 && (udp.payload[0:4] == 00:2d:53:33 || udp.payload[0:4] == 30:2d:53:33)"
        " && !icmp && !icmpv6 && !(ip.flags.mf == 1 || ip.frag_offset > 0) && !ipv6.fraghdr"
    )
    fields = ("-T", "fields", "-e", "frame.number")
    assert len(tshark(entry["file"], *fields, truncated=truncated)) == entry["frames"]
    assert len(tshark(entry["file"], "-Y", is_telegram, *fields, truncated=truncated)) == entry["telegrams"]


@needs_tshark
def test_tshark_finds_every_row_of_the_table_of_telegrams() -> None:
    lines = tshark("telegrams.pcap", "-T", "fields", "-e", "udp.payload", "-e", "frame.time_relative", truncated=False)
    assert [line.split("\t")[0] for line in lines] == [row["hex"] for row in tsv_rows()]
    assert [round(float(line.split("\t")[1]) * 10) for line in lines] == list(range(len(lines)))


@needs_tshark
def test_tshark_finds_interfaces_times_and_comments() -> None:
    columns = ("frame.time_epoch", "frame.interface_name", "frame.comment", "udp.payload")
    selected = [word for column in columns for word in ("-e", column)]
    lines = tshark(
        "interfaces.pcapng", "-Y", "udp.payload && !(ip.flags.mf == 1)", "-T", "fields", *selected, truncated=False
    )
    rows = [line.split("\t") for line in lines]
    assert {row[1] for row in rows} == {"mirror", "any", "any2", "tun0", "lo0"}
    assert [row[2] for row in rows if row[2]] == ["first telegram after the restart of the press"]
    times = [float(row[0]) for row in rows]
    assert all(0 < after - before < 0.1 for before, after in pairwise(times))
    counters = [int.from_bytes(bytes.fromhex(row[3])[16:18], "little") for row in rows]
    assert counters == [*range(1, 23), *range(1, 5)]


if __name__ == "__main__":
    for name, make in MADE_HERE.items():
        (CAPTURES / name).write_bytes(make())
