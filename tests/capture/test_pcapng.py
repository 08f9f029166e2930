"""pcapng files: every kind of block, every clock, and damage, against a plain reader."""

from __future__ import annotations

import random
import struct
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.pcapng.reader import MAX_COMMENTS, MAX_INTERFACES
from nvscope.capture.reader import ReadingSizes
from nvscope.errors import UnreadableInput
from tests.capture import build
from tests.capture.reference import Content, Packet, read_pcapng
from tests.laws import some

_shared = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
_SIZES = ReadingSizes()


def assert_as_reference(
    path: Path, raw: bytes, sizes: ReadingSizes = _SIZES, small_file_bytes: int = 8 << 20, chunk_bytes: int = 1 << 20
) -> Content:
    expected = read_pcapng(raw)
    if not expected.readable:
        with pytest.raises(UnreadableInput):
            build.read(path, raw, sizes, small_file_bytes, chunk_bytes)
        return expected
    source, packets = build.read(path, raw, sizes, small_file_bytes, chunk_bytes)
    assert packets == expected.packets
    assert source.info.frames == len(packets)
    truncation = source.info.truncation
    assert (truncation.offset if truncation else None) == expected.cut
    assert bool(truncation and truncation.message.startswith("damaged")) == expected.damaged
    assert source.info.drops == expected.drops
    assert list(source.info.comments) == expected.comments
    assert source.info.format == "pcapng"
    return expected


@st.composite
def files(draw: st.DrawFn) -> bytes:
    """Sections of blocks of all kinds, mostly right."""
    parts = []
    for _ in range(draw(st.integers(1, 3))):
        order = draw(st.sampled_from("<>"))
        parts.append(build.section(order, build.option(order, 1, b"of a section") * draw(st.integers(0, 1))))
        interfaces = 0
        for kind in draw(st.lists(st.sampled_from("iieeeeeoosstnc"), max_size=16)):
            payload = draw(build.payloads)
            units = draw(st.one_of(st.integers(0, 2**64 - 1), st.integers(1, 2**40)))
            original = draw(st.sampled_from((None, 0, 2**32 - 1)))
            number = draw(st.integers(0, interfaces)) if draw(st.integers(0, 9)) == 0 else max(interfaces - 1, 0)
            match kind:
                case "i":
                    options = b""
                    if draw(st.booleans()):
                        options += build.option(order, 9, bytes((draw(st.integers(0, 255)),)))
                    if draw(st.booleans()):
                        offset_s = draw(st.one_of(st.integers(-(2**63), 2**63 - 1), st.integers(-100, 100)))
                        options += build.option(order, 14, struct.pack(order + "q", offset_s))
                    options += draw(_options(order))
                    link = draw(st.sampled_from((1, 1, 113, 276, 65535)))
                    parts.append(build.interface(order, link, draw(st.sampled_from((0, 5, 65535))), options))
                    interfaces += 1
                case "e":
                    options = draw(_options(order))
                    parts.append(
                        build.enhanced(order, units, payload, original=original, number=number, options=options)
                    )
                case "o":
                    drops = draw(st.sampled_from((0, 3, 0xFFFF)))
                    parts.append(build.obsolete(order, units, payload, original=original, number=number, drops=drops))
                case "s":
                    parts.append(build.simple(order, payload))
                case "t":
                    options = draw(_options(order)) + b"".join(
                        build.option(order, code, struct.pack(order + "Q", draw(st.sampled_from((0, 8, 2**64 - 1)))))
                        for code in draw(st.lists(st.sampled_from((4, 5, 6, 7)), max_size=3))
                    )
                    parts.append(build.statistics(order, number, options))
                case _:
                    unknown = draw(st.sampled_from((4, 0xBAD, 9, 0x80000001)))
                    parts.append(build.block(order, unknown, build.padded(payload)))
    return b"".join(parts)


@st.composite
def _options(draw: st.DrawFn, order: str) -> bytes:
    values = {1: b"a comment \xff", 2: bytes(4), 4: struct.pack(order + "Q", 7), 2988: b"custom"}
    codes = draw(st.lists(st.sampled_from((1, 2, 4, 2988, 0)), max_size=3))
    return b"".join(build.option(order, code, values.get(code, b"")) for code in codes)


@_shared
@given(raw=files(), sizes=build.reading_sizes, small=build.small_files, chunk=build.chunks)
def test_files_are_read_like_block_by_block(
    tmp_path: Path, raw: bytes, sizes: ReadingSizes, small: int, chunk: int
) -> None:
    assert_as_reference(tmp_path / "a", raw, sizes, small, chunk)


@_shared
@given(data=st.data(), raw=files(), sizes=build.reading_sizes, small=build.small_files)
def test_mutated_files_are_read_like_block_by_block(
    tmp_path: Path, data: st.DataObject, raw: bytes, sizes: ReadingSizes, small: int
) -> None:
    mutated = bytearray(raw)
    for _ in range(data.draw(st.integers(1, 4))):
        mutated[data.draw(st.integers(0, len(raw) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    assert_as_reference(tmp_path / "a", bytes(mutated), sizes, small)


@pytest.mark.parametrize("seed", some(range(8)))
def test_large_files_of_deceptive_content(tmp_path: Path, seed: int) -> None:
    """Packets that hold blocks, runs of every kind of packet block, both byte orders; whole, cut, damaged."""
    chance = random.Random(seed)
    parts: list[bytes] = []
    order = "<"
    units = build.BASE_S * 10**6
    for stretch in range(30):
        if not stretch or chance.random() < 0.2:
            order = chance.choice("<>")
            parts += [build.section(order), build.interface(order), build.interface(order, 113)]
        inner = b"".join(build.enhanced(order, units, bytes(28)) for _ in range(chance.randint(1, 20)))
        kind = chance.choice(("enhanced", "enhanced", "inner", "shifted", "obsolete", "simple", "unknown", "zero"))
        for _ in range(chance.choice((5, 60, 500))):
            units += chance.randrange(1000)
            match kind:
                case "enhanced":
                    number = chance.randint(0, 1)
                    data = chance.randbytes(chance.choice((0, 3, 60, 300)))
                    parts.append(build.enhanced(order, units, data, number=number))
                case "inner":
                    parts.append(build.enhanced(order, units, inner))
                case "shifted":
                    parts.append(build.enhanced(order, units, inner[chance.randint(0, 59) :]))
                case "obsolete":
                    parts.append(build.obsolete(order, units, chance.randbytes(40), drops=chance.randint(0, 2)))
                case "simple":
                    parts.append(build.simple(order, chance.randbytes(chance.randint(0, 90))))
                case "unknown":
                    parts.append(build.block(order, 0xBAD, inner))
                case "zero":
                    parts.append(build.enhanced(order, units, bytes(chance.randint(0, 2000))))
    raw = b"".join(parts)
    cut = chance.randrange(28, len(raw))
    for lanes in (0, 30, 200):
        sizes = ReadingSizes(batch_packets=1000, stride_bytes=chance.choice((20_000, 1 << 20, 3 << 20)), lanes=lanes)
        assert len(assert_as_reference(tmp_path / "a", raw, sizes, 0).packets) > 100
        assert_as_reference(tmp_path / "a", raw[:cut], sizes, 0)
        assert_as_reference(tmp_path / "a", raw[:cut] + chance.randbytes(40) + raw[cut:], sizes, 0)


def test_a_file_cut_anywhere_gives_the_packets_before_the_cut(tmp_path: Path) -> None:
    order = ">"
    blocks = [build.section(order), build.interface(order)]
    blocks += [build.enhanced(order, n, bytes(range(n))) for n in range(6)]
    raw = b"".join(blocks)
    ends = {0}
    for each in blocks:
        ends.add(max(ends) + len(each))
    path = tmp_path / "a.pcapng"
    for cut in range(len(raw) + 1):
        if cut < 28:
            with pytest.raises(UnreadableInput) as caught:
                build.read(path, raw[:cut], ReadingSizes(), 0, 64)
            assert str(path) in caught.value.where
            continue
        source, found = build.read(path, raw[:cut], ReadingSizes(), 0, 64)
        assert [len(packet.data) for packet in found] == list(range(max(sum(end <= cut for end in ends) - 3, 0)))
        truncation = source.info.truncation
        assert (truncation is None) == (cut in ends)
        if truncation:
            assert truncation.offset == max(end for end in ends if end <= cut)
            assert truncation.message.startswith("cut short")


def test_a_simple_packet_has_the_time_of_the_packet_before(tmp_path: Path) -> None:
    order = "<"
    raw = b"".join(
        (
            build.section(order),
            build.interface(order, snap=4),
            build.simple(order, b"ab"),
            build.enhanced(order, 5, b"cd"),
            build.simple(order, b"efgh", original=900),
            build.section(order),
            build.interface(order, link=113),
            build.simple(order, b"i"),
        )
    )
    expected = [
        Packet(0, 2, 1, b"ab"),
        Packet(5000, 2, 1, b"cd"),
        Packet(5000, 900, 1, b"efgh"),
        Packet(5000, 1, 113, b"i"),
    ]
    for stride in (1, 1 << 20):
        _, found = build.read(tmp_path / "a", raw, ReadingSizes(stride_bytes=stride), 0, 64)
        assert found == expected


def test_drops_are_the_last_statistics_of_each_interface_or_the_sum_over_its_packets(tmp_path: Path) -> None:
    order = "<"

    def counted(number: int, **counts: int) -> bytes:
        codes = {"received": 4, "interface": 5, "system": 7}
        options = b"".join(build.option(order, codes[key], struct.pack("<Q", n)) for key, n in counts.items())
        return build.statistics(order, number, options)

    lost = build.option(order, 4, struct.pack("<Q", 100))
    head = build.section(order) + build.interface(order) * 3
    raw = b"".join(
        (
            head,
            build.enhanced(order, 1, b"", number=0, options=lost),
            build.enhanced(order, 2, b"", number=1, options=lost),
            build.enhanced(order, 3, b"", number=1, options=lost),
            build.obsolete(order, 4, b"", number=1, drops=7),
            build.obsolete(order, 4, b"", number=1, drops=0xFFFF),
            counted(0, interface=1, system=1),
            counted(2, interface=1000),
            counted(0, interface=5, system=20, received=5000),
            counted(1, received=5000),
            counted(77, interface=5000),
            head,
            counted(0, system=3),
        )
    )
    source, _ = build.read(tmp_path / "a", raw, _SIZES, 0, 64)
    assert source.info.drops == 25 + (200 + 7) + 1000 + 3
    assert source.info.drops_by == {"interface": 5 + 1000, "kernel": 20 + 3}


def test_comments_are_kept_in_order_with_their_frames(tmp_path: Path) -> None:
    order = ">"
    comment = {name: build.option(order, 1, name.encode()) for name in ("file", "port", "second", "again", "counts")}
    raw = b"".join(
        (
            build.section(order, comment["file"]),
            build.interface(order, options=comment["port"]),
            build.enhanced(order, 1, b"a"),
            build.enhanced(
                order, 2, b"b", options=build.option(order, 2, bytes(4)) + comment["second"] + comment["again"]
            ),
            build.statistics(order, 0, comment["counts"]),
        )
    )
    for stride in (1, 1 << 20):
        source, _ = build.read(tmp_path / "a", raw, ReadingSizes(stride_bytes=stride), 0, 64)
        assert list(source.info.comments) == [
            (None, "file"),
            (None, "port"),
            (2, "second"),
            (2, "again"),
            (None, "counts"),
        ]


def test_comments_are_limited(tmp_path: Path) -> None:
    noisy = build.enhanced("<", 1, b"", options=build.option("<", 1, b"hello"))
    raw = build.section("<") + build.interface("<") + noisy * (MAX_COMMENTS + 5)
    source, _ = build.read(tmp_path / "a", raw, _SIZES, 0, 64)
    assert source.info.frames == MAX_COMMENTS + 5
    assert len(source.info.comments) == MAX_COMMENTS


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("multiple of 4", struct.pack("<III", 0xBAD, 14, 0) + b"xx" + struct.pack("<I", 14)),
        ("12 to", struct.pack("<II", 0xBAD, 8)),
        ("12 to", struct.pack("<III", 0xBAD, 0, 0)),
        ("12 to", struct.pack("<II", 0xBAD, 0x7FFFFFF0) + bytes(40)),
        ("differs from its first", struct.pack("<III", 0xBAD, 16, 0) + struct.pack("<I", 20)),
        ("interface 1, which is not described", build.enhanced("<", 1, b"", number=1) + build.interface("<")),
        ("expected at most 8", build.block("<", 6, struct.pack("<IIIII", 0, 0, 0, 9, 9) + bytes(8))),
        ("version 2.0", build.block("<", 0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 2, 0, -1))),
        ("byte order magic 01 02", build.block("<", 0x0A0D0D0A, b"\1\2\3\4" + bytes(12))),
        ("type 1 and only 16 bytes", build.block("<", 1, bytes(4))),
    ],
)
def test_what_is_wrong_with_a_block_is_told(tmp_path: Path, name: str, bad: bytes) -> None:
    good = build.section("<") + build.interface("<") + build.enhanced("<", 1, b"abc") * 3
    source, found = build.read(tmp_path / "a", good + bad + good, _SIZES, 0, 64)
    assert len(found) == 3
    assert source.info.truncation is not None
    assert source.info.truncation.offset == len(good)
    assert name in source.info.truncation.message
    assert source.info.truncation.message.startswith("damaged")


def test_a_packet_without_any_interface(tmp_path: Path) -> None:
    raw = build.section("<") + build.enhanced("<", 1, b"abc") + build.interface("<")
    source, found = build.read(tmp_path / "a", raw, _SIZES, 0, 64)
    assert found == []
    assert source.info.truncation is not None
    assert source.info.truncation.offset == 28


def test_a_section_cut_anywhere_is_told(tmp_path: Path) -> None:
    first = build.section("<") + build.interface("<") + build.enhanced("<", 1, b"abc")
    for second in (build.section("<"), build.section(">")):
        for cut in range(1, len(second)):
            source, found = build.read(tmp_path / "a", first + second[:cut], _SIZES, 0, 64)
            assert len(found) == 1
            assert source.info.truncation is not None
            assert source.info.truncation.offset == len(first)
            assert source.info.truncation.message.startswith("cut short")


def test_interfaces_are_limited(tmp_path: Path) -> None:
    raw = build.section("<") + build.interface("<") * (MAX_INTERFACES + 1) + build.enhanced("<", 1, b"")
    source, found = build.read(tmp_path / "a", raw, _SIZES, 0, 64)
    assert found == []
    assert source.info.truncation is not None
    assert source.info.truncation.offset == 28 + 20 * MAX_INTERFACES
    assert "interfaces" in source.info.truncation.message


def test_many_sections_of_alternating_byte_order(tmp_path: Path) -> None:
    parts = []
    for number in range(400):
        order = "<>"[number % 2]
        parts += [build.section(order), build.interface(order, link=number)]
        parts.append(build.enhanced(order, number, bytes(number)))
    source, found = build.read(tmp_path / "a", b"".join(parts), _SIZES, 0, 64)
    assert [(packet.ts_ns, packet.link, len(packet.data)) for packet in found] == [(n * 1000, n, n) for n in range(400)]
    assert source.info.truncation is None


def test_a_section_header_of_unknown_order_or_version_is_not_read(tmp_path: Path) -> None:
    raw = bytearray(build.section("<"))
    (tmp_path / "order").write_bytes(bytes(raw[:8] + b"\x1a\x2b\x3c\x4e" + raw[12:]))
    with pytest.raises(UnreadableInput, match="expected 1a 2b 3c 4d"):
        CaptureFile(str(tmp_path / "order"))
    (tmp_path / "version").write_bytes(bytes(raw[:12] + b"\x02\x00" + raw[14:]))
    with pytest.raises(UnreadableInput, match=r"version 2\.0"):
        CaptureFile(str(tmp_path / "version"))
