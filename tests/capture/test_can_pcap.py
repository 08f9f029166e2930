"""CAN in pcap and pcapng: frames as they are, as tshark reads them, and interfaces as channels."""

from __future__ import annotations

import random
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from dissectors.batch import LinkType
from nvscope.capture.open import open_sink, open_source
from tests.capture import build
from tests.capture.can import logs
from tests.capture.can.logs import Frame, frames_of, line_of
from tests.capture.reference import Packet

needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")


def some_log(tmp_path: Path, count: int = 200) -> Path:
    chance = random.Random(1)
    lines = []
    for n in range(count):
        kind = chance.choices(("", "f", "r", "e"), (12, 3, 1, 1))[0]
        extended = kind != "e" and chance.random() < 0.3
        size = 8 if kind == "e" else chance.choice(logs.FD_LENGTHS if kind == "f" else range(9))
        lines.append(
            line_of(
                Frame(
                    (logs.BASE_US + 100 * n) * 1000,
                    f"can{n % 2}",
                    chance.randrange(1, 1 << (29 if extended else 9)),
                    "x" * extended + kind,
                    size,
                    b"" if kind == "r" else chance.randbytes(size),
                )
            )
            + "\n"
        )
    path = tmp_path / "a.log"
    path.write_text("".join(lines))
    return path


@needs_tshark
@pytest.mark.parametrize("suffix", ["pcap", "pcapng"])
def test_what_we_built_from_a_log_is_what_tshark_sees(tmp_path: Path, suffix: str) -> None:
    """A log written to a pcap file of link type 227 and read by tshark; and read again by us."""
    log = some_log(tmp_path)
    path = tmp_path / f"a.{suffix}"
    with open_sink(str(path)) as sink:
        for batch in open_source([str(log)]):
            sink.write(batch)
    frames = frames_of(open_source([str(log)]))
    again = frames_of(open_source([str(path)]))
    assert [frame._replace(channel="") for frame in again] == [frame._replace(channel="") for frame in frames]
    names = ("can.id", "can.len", "can.flags.xtd", "can.flags.rtr", "can.flags.err", "canfd.flags.esi", "data.data")
    done = subprocess.run(
        ["tshark", "-n", "-r", str(path), "-T", "fields", *(part for name in names for part in ("-e", name))],
        capture_output=True,
        text=True,
        check=True,
    )
    seen = [line.split("\t") for line in done.stdout.splitlines()]
    assert len(seen) == len(frames)
    for frame, (identifier, length, *flags, data) in zip(frames, seen, strict=True):
        assert int(length) == frame.length
        extended, remote, error, state = flags
        if "e" in frame.flags:
            assert error == "1"  # whose identifier and data tshark shows as what they mean
            continue
        assert ("x" in frame.flags, "r" in frame.flags, "f" in frame.flags) == (
            extended == "1",
            remote == "1",
            state != "",
        )
        assert (int(identifier), data) == (frame.identifier, frame.data.hex())


def test_interfaces_of_a_pcapng_file_are_channels(tmp_path: Path) -> None:
    """Two buses and an Ethernet interface, in two sections which number them differently."""

    def named(name: bytes, link: int) -> bytes:
        return build.interface("<", link, options=build.option("<", 2, name) + build.option("<", 0, b""))

    can_bytes = struct.pack(">IB3x", 0x181, 2) + b"\1\2"
    time = logs.BASE_US
    raw = (
        build.section("<")
        + named(b"eth0", 1)
        + named(b"can0", 227)
        + build.enhanced("<", time, bytes(60), number=0)
        + build.enhanced("<", time + 1, can_bytes, number=1)
        + build.section("<")
        + named(b"can1", 227)
        + named(b"can0", 227)
        + build.enhanced("<", time + 2, can_bytes, number=0)
        + build.enhanced("<", time + 3, can_bytes, number=1)
    )
    path = tmp_path / "a.pcapng"
    path.write_bytes(raw)
    for batch_packets in (1, 100):
        source = open_source([str(path)], batch_packets=batch_packets)
        found = [
            (source.channels[number], link)
            for batch in source
            for number, link in zip(batch.channels.tolist(), batch.link.tolist(), strict=True)
        ]
        assert found == [("eth0", 1), ("can0", 227), ("can1", 227), ("can0", 227)]
        assert list(source.channels) == ["eth0", "can0", "can1"]


def test_interfaces_without_names(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    one = build.section("<") + build.interface("<", 227) + build.enhanced("<", 5, bytes(16))
    path.write_bytes(one)
    source = open_source([str(path)])
    assert [batch.channel for batch in source] == [None]
    assert list(source.channels) == []
    path.write_bytes(one + build.interface("<", 227) + build.enhanced("<", 6, bytes(16), number=1))
    source = open_source([str(path)])
    assert [number for batch in source for number in batch.channels.tolist()] == [0, 1]
    assert list(source.channels) == ["interface 0", "interface 1"]


def test_cooked_frames_of_a_capture_of_all_interfaces_stay_as_they_are(tmp_path: Path) -> None:
    """As tcpdump -i any writes them: SLL (protocol 0x000C), whose header the dissector takes off."""
    sll = struct.pack(">HHH8sH", 1, 280, 0, bytes(8), 0x000C)
    packet = Packet(build.BASE_S * 10**9, 32, LinkType.LINUX_SLL, sll + struct.pack(">IB3x8s", 0x181, 8, b"8 bytes."))
    path = tmp_path / "a.pcap"
    path.write_bytes(build.pcap([packet], link=LinkType.LINUX_SLL))
    assert build.packets_of(open_source([str(path)])) == [packet]
