"""Sinks: what they write is what a source reads, and what they cannot write is told."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dissectors.batch import PAD_BYTES, LinkType, PacketBatch
from nvscope.capture.open import open_sink, open_source
from nvscope.capture.pcap import PcapSink
from nvscope.capture.pcapng.sink import PcapngSink
from nvscope.capture.source import Sink
from nvscope.errors import CaptureError, UsageError
from tests.capture import build
from tests.capture.reference import Packet, read_pcap, read_pcapng


def batch_of(packets: list[Packet]) -> PacketBatch:
    """The packets in one buffer, last first, with other bytes between them."""
    data = b"\xee"
    offsets = []
    for packet in reversed(packets):
        offsets.append(len(data))
        data += packet.data + b"\xee\xee"
    return PacketBatch(
        np.frombuffer(data + bytes(PAD_BYTES), np.uint8),
        np.array(offsets[::-1], np.int64),
        np.array([len(packet.data) for packet in packets], np.int32),
        np.array([packet.original for packet in packets], np.int64),
        np.array([packet.ts_ns for packet in packets], np.int64),
        np.array([packet.link for packet in packets], np.uint16),
    )


def write(sink: Sink, packets: list[Packet], cut: int) -> None:
    for part in (packets[:cut], packets[cut:]):
        sink.write(batch_of(part))
    sink.close()


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(packets=build.packet_lists(), cut=st.integers(0, 40))
def test_pcap_holds_what_was_written(tmp_path: Path, packets: list[Packet], cut: int) -> None:
    path = tmp_path / "a.pcap"
    write(PcapSink(str(path)), packets, cut)
    content = read_pcap(path.read_bytes())
    assert content.cut is None
    assert content.packets == packets
    write(PcapSink(str(path), nanoseconds=False), packets, cut)
    in_microseconds = [packet._replace(ts_ns=packet.ts_ns // 1000 * 1000) for packet in packets]
    assert read_pcap(path.read_bytes()).packets == in_microseconds


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data(), packets=build.packet_lists(), cut=st.integers(0, 40))
def test_pcapng_holds_what_was_written_of_any_link_type(
    tmp_path: Path, data: st.DataObject, packets: list[Packet], cut: int
) -> None:
    links = data.draw(st.sampled_from(([1], [1, 113, 65535])))
    packets = [packet._replace(link=data.draw(st.sampled_from(links))) for packet in packets]
    path = tmp_path / "a.pcapng"
    write(PcapngSink(str(path)), packets, cut)
    content = read_pcapng(path.read_bytes())
    assert content.cut is None
    assert content.packets == packets


@pytest.mark.parametrize("name", ["a.pcap", "a.pcapng"])
def test_what_the_formats_cannot_hold_becomes_the_nearest_they_can(tmp_path: Path, name: str) -> None:
    path = str(tmp_path / name)
    huge = bytes(262_145)
    with open_sink(path) as sink:
        sink.write(batch_of([Packet(-5, 3, 1, b"old"), Packet(2**62 - 1, 2**40, 1, huge), Packet(7, 1, 1, b"x")]))
    first, second, third = build.packets_of(open_source([path]))
    assert first == Packet(0, 3, 1, b"old")
    assert second.data == huge[:-1]
    assert second.original == 2**32 - 1
    assert second.ts_ns == (2**32 * 10**9 - 1 if name == "a.pcap" else 2**62 - 1)
    assert third == Packet(7, 1, 1, b"x")


def test_pcap_is_for_one_link_type(tmp_path: Path) -> None:
    with open_sink(str(tmp_path / "a.pcap")) as sink:
        sink.write(batch_of([Packet(0, 1, 1, b"x")]))
        for packets in ([Packet(0, 1, 113, b"x")], [Packet(0, 1, 1, b"x"), Packet(0, 1, 113, b"x")]):
            with pytest.raises(UsageError, match="link type"):
                sink.write(batch_of(packets))
    assert len(build.packets_of(open_source([str(tmp_path / "a.pcap")]))) == 1


def test_headers_of_files_without_packets(tmp_path: Path) -> None:
    open_sink(str(tmp_path / "a.pcap")).close()
    open_sink(str(tmp_path / "A.PCAPNG")).close()
    assert struct.unpack("=I16xI", (tmp_path / "a.pcap").read_bytes()) == (0xA1B23C4D, LinkType.ETHERNET)
    assert build.packets_of(open_source([str(tmp_path / "a.pcap"), str(tmp_path / "A.PCAPNG")])) == []


def test_what_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"'\.txt'"):
        open_sink(str(tmp_path / "a.txt"))
    with pytest.raises(CaptureError, match="cannot be written") as caught:
        open_sink(str(tmp_path / "missing" / "a.pcap"))
    assert caught.value.where == str(tmp_path / "missing" / "a.pcap")


def test_a_full_disk_is_told() -> None:
    with pytest.raises(CaptureError, match="No space left"):
        PcapSink("/dev/full").close()
