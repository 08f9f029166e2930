"""pcap files: what is written is read, in any cut of the work, and what is damaged is told exactly."""

from __future__ import annotations

import random
import struct
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nvscope.capture.reader import ReadingSizes
from nvscope.errors import UnreadableInput
from tests.capture import build
from tests.capture.build import BASE_S
from tests.capture.reference import Packet, read_pcap
from tests.laws import some

_shared = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)


def assert_as_reference(path: Path, raw: bytes, sizes: ReadingSizes, small_file_bytes: int, chunk_bytes: int) -> None:
    expected = read_pcap(raw)
    if not expected.readable:
        with pytest.raises(UnreadableInput):
            build.read(path, raw, sizes, small_file_bytes, chunk_bytes)
        return
    source, packets = build.read(path, raw, sizes, small_file_bytes, chunk_bytes)
    assert packets == expected.packets
    assert source.info.frames == len(packets)
    truncation = source.info.truncation
    assert (truncation.offset if truncation else None) == expected.cut
    assert bool(truncation and truncation.message.startswith("damaged")) == expected.damaged


@_shared
@given(
    packets=build.packet_lists(step_ns=1000),
    order=st.sampled_from("<>"),
    nanoseconds=st.booleans(),
    sizes=build.reading_sizes,
    small_file_bytes=build.small_files,
)
def test_packets_written_are_the_packets_read(
    tmp_path: Path,
    packets: list[Packet],
    order: str,
    nanoseconds: bool,
    sizes: ReadingSizes,
    small_file_bytes: int,
) -> None:
    raw = build.pcap(packets, order=order, nanoseconds=nanoseconds)
    source, found = build.read(tmp_path / "a.pcap", raw, sizes, small_file_bytes, 1 << 20)
    assert found == packets
    assert source.info.truncation is None
    assert source.info.bytes == len(raw) == source.size_bytes == source.position_bytes
    assert source.info.format == "pcap"


@_shared
@given(data=st.data(), packets=build.packet_lists(max_size=12), sizes=build.reading_sizes, small=build.small_files)
def test_mutated_files_are_read_like_record_by_record(
    tmp_path: Path, data: st.DataObject, packets: list[Packet], sizes: ReadingSizes, small: int
) -> None:
    raw = bytearray(build.pcap(packets))
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    assert_as_reference(tmp_path / "a", bytes(raw), sizes, small, 4096)


@pytest.mark.parametrize("seed", some(range(12)))
def test_large_files_of_deceptive_content(tmp_path: Path, seed: int) -> None:
    """Stretches of tiny, of huge and of empty packets, of packets full of records, and clocks that jump."""
    chance = random.Random(seed)
    packets: list[Packet] = []
    seconds = build.BASE_S
    inner = build.pcap([Packet(build.BASE_S * 10**9 + n, 60, 1, bytes(60)) for n in range(30)])[24:]
    for _ in range(40):
        kind = chance.choice(("tiny", "huge", "empty", "inner", "shifted", "mixed", "zero"))
        seconds = chance.choice((seconds, seconds + 1, seconds + 70_000, 5, build.BASE_S))
        for _ in range(chance.choice((3, 60, 300))):
            data = {
                "tiny": lambda: chance.randbytes(chance.randint(1, 4)),
                "huge": lambda: chance.randbytes(chance.choice((1500, 9000))),
                "empty": lambda: b"",
                "inner": lambda: inner,
                "shifted": lambda: inner[chance.randint(0, 75) :],
                "mixed": lambda: chance.randbytes(chance.choice((46, 60, 300, 1400))),
                "zero": lambda: bytes(chance.randint(0, 2000)),
            }[kind]()
            packets.append(Packet(seconds * 10**9 + chance.randrange(10**9), len(data), 1, data))
    order = chance.choice("<>")
    raw = build.pcap(packets, order=order)
    cut = chance.randrange(len(raw))
    for lanes in (0, 30, 200):
        sizes = ReadingSizes(batch_packets=1000, stride_bytes=chance.choice((20_000, 1 << 20, 3 << 20)), lanes=lanes)
        assert_as_reference(tmp_path / "a", raw, sizes, 0, 1 << 20)
        assert_as_reference(tmp_path / "a", raw[:cut], sizes, 0, 1 << 20)
        damaged = raw[:cut] + chance.randbytes(40) + raw[cut:]
        assert_as_reference(tmp_path / "a", damaged, sizes, 0, 1 << 20)


@pytest.mark.parametrize("small_file_bytes", [0, 1 << 20])
def test_a_file_cut_anywhere_gives_the_packets_before_the_cut(tmp_path: Path, small_file_bytes: int) -> None:
    packets = [Packet(build.BASE_S * 10**9 + n, 9 + n, 1, bytes(range(n))) for n in range(8)]
    raw = build.pcap(packets)
    ends = {24}
    for packet in packets:
        ends.add(max(ends) + 16 + len(packet.data))
    path = tmp_path / "a.pcap"
    for cut in range(len(raw) + 1):
        if cut < 24:
            with pytest.raises(UnreadableInput) as caught:
                build.read(path, raw[:cut], ReadingSizes(), small_file_bytes, 64)
            assert str(path) in caught.value.where
            continue
        source, found = build.read(path, raw[:cut], ReadingSizes(), small_file_bytes, 64)
        whole = sum(end <= cut for end in ends) - 1
        assert found == packets[:whole]
        truncation = source.info.truncation
        if cut in ends:
            assert truncation is None
        else:
            assert truncation is not None
            assert truncation.offset == max(end for end in ends if end <= cut)
            assert truncation.message.startswith("cut short")


def test_a_record_longer_than_any_packet_is_where_the_file_is_damaged(tmp_path: Path) -> None:
    packets = [Packet(build.BASE_S * 10**9, 4, 1, b"good")] * 3
    longest, longer = (Packet(0, 0, 1, bytes(262_144 + more)) for more in (0, 1))
    path = tmp_path / "a.pcap"
    source, found = build.read(path, build.pcap([*packets, longest, *packets]), ReadingSizes(), 0, 64)
    assert len(found) == 7
    assert source.info.truncation is None
    source, found = build.read(path, build.pcap([*packets, longer, *packets], snap=0), ReadingSizes(), 0, 64)
    assert found == packets
    assert source.info.truncation is not None
    assert source.info.truncation.offset == 24 + 3 * 20
    assert "262145 bytes" in source.info.truncation.message
    source, found = build.read(path, build.pcap([*packets, longer, *packets], snap=300_000), ReadingSizes(), 0, 64)
    assert len(found) == 7


@pytest.mark.parametrize(("field", "link"), [(0x1400_0001, 1), (0xFFFF_0071, 113), (0x0000_FFFE, 0xFFFE)])
def test_the_link_type_is_the_low_half_of_its_field(tmp_path: Path, field: int, link: int) -> None:
    raw = build.pcap([Packet(0, 1, field, b"x")], link=field)
    _, found = build.read(tmp_path / "a.pcap", raw, ReadingSizes(), 0, 64)
    assert [packet.link for packet in found] == [link]


def test_a_fraction_of_a_second_and_more_is_added(tmp_path: Path) -> None:
    raw = bytearray(build.pcap([Packet(7 * 10**9, 0, 1, b"")], nanoseconds=False))
    raw[28:32] = (2_500_000).to_bytes(4, "little")
    _, found = build.read(tmp_path / "a.pcap", bytes(raw), ReadingSizes(), 0, 64)
    assert found[0].ts_ns == 9_500_000_000


def test_another_version_is_not_read(tmp_path: Path) -> None:
    raw = bytearray(build.pcap([]))
    raw[4] = 3
    with pytest.raises(UnreadableInput, match=r"version 3\.4, expected 2"):
        build.read(tmp_path / "a.pcap", bytes(raw), ReadingSizes(), 0, 64)


@pytest.mark.parametrize(("nanoseconds", "unit", "second"), [(True, "ns", 10**9), (False, "µs", 10**6)])
def test_parts_of_a_second_that_are_more_than_one_are_told(
    tmp_path: Path, nanoseconds: bool, unit: str, second: int
) -> None:
    packets = [Packet(BASE_S * 10**9 + row, 1, 1, bytes([row])) for row in range(4)]
    raw = bytearray(build.pcap(packets, nanoseconds=nanoseconds))
    for row, fraction in ((1, second), (3, 0xFFFFFFFF), (0, second - 1)):
        struct.pack_into("<I", raw, 24 + 17 * row + 4, fraction)
    source, found = build.read(tmp_path / "a.pcap", bytes(raw), ReadingSizes(), 0, 64)
    assert [packet.data for packet in found] == [bytes([row]) for row in range(4)]
    told = source.info.truncation
    assert told is not None
    assert told.offset == 24 + 17
    assert told.message == f"frame 2 has a time of {second} {unit} after a whole second; 2 such frames"
