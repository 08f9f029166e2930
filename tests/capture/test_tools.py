"""What other programs write is read as they read it, and they read what is written here."""

from __future__ import annotations

import random
import shutil
import subprocess
from pathlib import Path

import pytest
from scapy.utils import RawPcapNgReader, RawPcapReader

from nvscope.capture.open import open_sink, open_source
from nvscope.capture.pcap import PcapSink
from tests.capture import build
from tests.capture.reference import Packet
from tests.laws import some

pytestmark = pytest.mark.skipif(
    any(shutil.which(tool) is None for tool in ("tshark", "editcap", "mergecap")),
    reason="needs tshark, editcap and mergecap",
)

_FIELDS = ("frame.time_epoch", "frame.len", "frame.cap_len")


def run(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def by_tshark(path: Path) -> list[tuple[int, int, int]]:
    """Time in ns, original and captured length of every frame that tshark sees before a fault."""
    done = subprocess.run(
        ["tshark", "-n", "-r", str(path), "-T", "fields", *(part for field in _FIELDS for part in ("-e", field))],
        capture_output=True,
        text=True,
        check=False,
    )
    frames = []
    for line in done.stdout.splitlines():
        time, original, captured = line.split("\t")
        seconds, _, fraction = time.partition(".")
        frames.append((int(seconds) * 10**9 + int(fraction.ljust(9, "0")), int(original), int(captured)))
    return frames


def by_us(path: Path) -> list[tuple[int, int, int]]:
    return [(packet.ts_ns, packet.original, len(packet.data)) for packet in build.packets_of(open_source([str(path)]))]


def some_packets(seed: int, count: int = 300) -> list[Packet]:
    chance = random.Random(seed)
    packets = []
    now = build.BASE_S * 10**9
    for _ in range(count):
        now += chance.randrange(10**7) - 10**6
        data = chance.randbytes(chance.choice((14, 60, 61, 62, 300, 1514)))
        packets.append(Packet(now, len(data) + chance.choice((0, 0, 40)), 1, data))
    return packets


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("nanoseconds", [True, False])
def test_pcap_is_read_like_tshark_does(tmp_path: Path, order: str, nanoseconds: bool) -> None:
    path = tmp_path / "a.pcap"
    path.write_bytes(build.pcap(some_packets(1), order=order, nanoseconds=nanoseconds))
    assert len(by_us(path)) == 300
    assert by_us(path) == by_tshark(path)


@pytest.mark.parametrize("order", ["<", ">"])
def test_pcapng_is_read_like_tshark_does(tmp_path: Path, order: str) -> None:
    """Sections, interfaces with their own clocks, all kinds of packet blocks, unknown blocks, options."""
    resolutions = (6, 9, 3, 0x80 | 20, 0x80 | 30)
    parts = []
    for _ in range(2):
        parts.append(build.section(order))
        for resolution in resolutions:
            options = build.option(order, 2, b"eth0") + build.option(order, 9, bytes((resolution,)))
            parts.append(build.interface(order, options=options + build.option(order, 0, b"")))
        for number, packet in enumerate(some_packets(2)):
            resolution = resolutions[number % 5]
            exponent = resolution & 0x7F
            base = 2 if resolution & 0x80 else 10
            units = packet.ts_ns * base**exponent // 10**9
            options = build.option(order, 1, b"noted") + build.option(order, 0, b"") if number % 7 == 0 else b""
            if number % 11 == 0:
                made = build.obsolete(order, units, packet.data, original=packet.original, number=number % 5)
            else:
                made = build.enhanced(
                    order, units, packet.data, original=packet.original, number=number % 5, options=options
                )
            parts.append(made)
            if number % 13 == 0:
                parts.append(build.block(order, 0x0BAD0BAD, b"unknown."))
        parts.append(build.statistics(order, 1))
        order = {"<": ">", ">": "<"}[order]
    path = tmp_path / "a.pcapng"
    path.write_bytes(b"".join(parts))
    assert len(by_us(path)) == 600
    assert by_us(path) == by_tshark(path)


@pytest.mark.parametrize("suffix", ["pcap", "pcapng"])
def test_a_cut_file_has_the_frames_that_tshark_sees(tmp_path: Path, suffix: str) -> None:
    packets = some_packets(3, 20)
    whole = tmp_path / f"whole.{suffix}"
    with open_sink(str(whole), 1) as sink:
        source = tmp_path / "source.pcap"
        source.write_bytes(build.pcap(packets))
        for batch in open_source([str(source)]):
            sink.write(batch)
    raw = whole.read_bytes()
    chance = random.Random(4)
    path = tmp_path / "cut"
    for cut in some([chance.randrange(100, len(raw)) for _ in range(12)]):
        path.write_bytes(raw[:cut])
        assert by_us(path) == by_tshark(path)


@pytest.mark.parametrize("kind", ["pcap", "nsecpcap", "pcapng"])
def test_files_of_editcap(tmp_path: Path, kind: str) -> None:
    packets = [packet._replace(original=len(packet.data)) for packet in some_packets(5)]
    source, snapped = tmp_path / "source.pcap", tmp_path / "snapped"
    source.write_bytes(build.pcap(packets))
    run("editcap", "-F", kind, "-s", "60", "-a", "3:a comment", str(source), str(snapped))
    assert by_us(snapped) == by_tshark(snapped)
    resolution = 1000 if kind == "pcap" else 1
    expected = [(p.ts_ns // resolution * resolution, len(p.data), min(len(p.data), 60)) for p in packets]
    assert by_us(snapped) == expected
    if kind == "pcapng":
        read = open_source([str(snapped)])
        list(read)
        assert (3, "a comment") in read.infos[0].comments


def test_several_files_are_merged_like_mergecap_does(tmp_path: Path) -> None:
    names = []
    for number in range(3):
        path = tmp_path / f"{number}.pcap"
        packets = some_packets(10 + number)
        path.write_bytes(build.pcap(packets))
        names.append(str(path))
    merged = tmp_path / "merged"
    run("mergecap", "-F", "nsecpcap", "-w", str(merged), *names)
    expected = build.packets_of(open_source([str(merged)]))
    assert len(expected) == 900
    assert build.packets_of(open_source(names, batch_packets=50)) == expected
    assert build.packets_of(open_source(names[::-1])) == expected


def test_interfaces_of_several_link_types_from_mergecap(tmp_path: Path) -> None:
    ethernet, cooked, merged = tmp_path / "e.pcap", tmp_path / "c.pcap", tmp_path / "m"
    ethernet.write_bytes(build.pcap(some_packets(20, 50)))
    cooked.write_bytes(build.pcap(some_packets(21, 50), link=113))
    run("mergecap", "-F", "pcapng", "-I", "none", "-w", str(merged), str(ethernet), str(cooked))
    found = build.packets_of(open_source([str(merged)]))
    assert sorted(packet.link for packet in found) == [1] * 50 + [113] * 50
    assert found == build.packets_of(open_source([str(ethernet), str(cooked)]))


@pytest.mark.parametrize("name", ["ns.pcap", "us.pcap", "a.pcapng"])
def test_what_sinks_write_is_read_by_tshark_and_scapy(tmp_path: Path, name: str) -> None:
    packets = some_packets(6)
    source, path = tmp_path / "source.pcap", tmp_path / name
    source.write_bytes(build.pcap(packets))
    with PcapSink(str(path), 1, nanoseconds=False) if name == "us.pcap" else open_sink(str(path), 1) as sink:
        for batch in open_source([str(source)], batch_packets=64):
            sink.write(batch)
    resolution = 1000 if name == "us.pcap" else 1
    expected = [(p.ts_ns // resolution * resolution, p.original, len(p.data)) for p in packets]
    assert by_tshark(path) == expected
    reader = RawPcapNgReader(str(path)) if name == "a.pcapng" else RawPcapReader(str(path))
    assert [data for data, _ in reader] == [packet.data for packet in packets]
