"""Channels where several captures are read together: each is called what it is called where its capture is alone."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from itertools import permutations
from pathlib import Path

import pytest

from dissectors.batch import LinkType
from dissectors.can.frame import dissect_can
from dissectors.can.pdo import channel_name
from nvscope.capture.open import open_source
from tests.capture import build
from tests.capture.reference import Packet

SECOND_NS = 10**9


def packet(ts_ns: int, data: bytes) -> Packet:
    return Packet(build.BASE_S * SECOND_NS + ts_ns, len(data), 0, data)


def cooked(interface: int, identifier: int) -> bytes:
    """Return a CAN frame as tcpdump -i any writes it."""
    head = struct.pack(">HHIHBB8s", 0x000C, 0, interface, 280, 4, 0, b"")
    return head + struct.pack("<IB3x", identifier, 1) + b"\1"


def socketcan(identifier: int) -> bytes:
    return struct.pack(">IB3x", identifier, 1) + b"\1"


def channels_seen(paths: Sequence[Path], batch_packets: int = 131_072) -> set[tuple[int, str]]:
    """Return identifier and channel of all frames."""
    source = open_source([str(path) for path in paths], batch_packets=batch_packets)
    return {
        (identifier, channel_name(source.channels, channel))
        for batch in source
        for frames in [dissect_can(batch)]
        for identifier, channel in zip(frames.identifier.tolist(), frames.channel.tolist(), strict=True)
    }


def written(path: Path, link: int, packets: Iterable[Packet]) -> Path:
    path.write_bytes(build.pcap(packets, link=link))
    return path


@pytest.fixture
def captures(tmp_path: Path) -> list[Path]:
    """Ethernet, CAN without a name of its channel, CAN of two interfaces by number, and a log that names channels.

    Each holds frames of its own identifiers; they lie so that some pieces of the timeline are of one capture alone.
    """
    log = tmp_path / "named.log"
    lines = [f"({build.BASE_S}.{at:06d}) {name} {at:03X}#01" for at, name in ((0x10, "can0"), (0x500, "can7"))]
    log.write_text("\n".join(lines))
    return [
        written(tmp_path / "ethernet.pcap", LinkType.ETHERNET, [packet(at, bytes(60)) for at in (0, 900_000, 950_000)]),
        written(
            tmp_path / "unnamed.pcap", LinkType.CAN_SOCKETCAN,
            [packet(1000 * at, socketcan(at)) for at in (0x100, 0x101, 0x600)],
        ),
        written(
            tmp_path / "cooked.pcap", LinkType.LINUX_SLL2,
            [packet(1000 * at, cooked(at % 2 + 7, at)) for at in (0x200, 0x201, 0x300, 0x601, 0x700)],
        ),
        log,
    ]  # fmt: skip


def test_a_channel_is_called_the_same_alone_and_among_others(captures: list[Path]) -> None:
    alone = set().union(*(channels_seen([path]) for path in captures))
    assert {name for _, name in alone} == {"can0", "can7", "can8"}
    for order in permutations(captures):
        for batch_packets in (1, 3, 1000):
            assert channels_seen(order, batch_packets) == alone


def test_a_channel_without_a_name_is_the_one_that_has_its_name(captures: list[Path]) -> None:
    """Else two channels of a report would have one name."""
    source = open_source([str(captures[1]), str(captures[3])])
    assert sum(len(batch) for batch in source) == 5
    assert list(source.channels) == ["can0", "can7"]
