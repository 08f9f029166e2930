"""What is recorded is what is read again, whole, cut or damaged."""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.mcap.packets import LONGEST_NS, cut
from nvscope.capture.mcap.records import MAGIC, Op, record, text
from nvscope.capture.open import open_sink, open_source
from nvscope.capture.source import Attachment
from nvscope.errors import UnreadableInput
from tests.capture.mcap.recordings import (
    BEGIN_NS,
    SECOND_NS,
    Packet,
    batch,
    drawn_batches,
    packets_of,
    read,
    steady,
    write,
)
from tests.laws import examples, some

CHUNK_HEAD_BYTES = 32
"""What is in front of the name of a chunk's compression: two times, the size, a checksum, the length of the name."""

NAMES = ["eth0", "can0", "can1"]


@given(batches=drawn_batches(), flushed=st.booleans(), batch_packets=st.sampled_from([1, 7, 131_072]))
@examples(300)
def test_what_was_recorded_is_read_again(
    batches: list[list[Packet]], flushed: bool, batch_packets: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = write(tmp_path_factory.mktemp("r") / "x.mcap", *batches, channels=NAMES, flushed=flushed)
    found = read(path, batch_packets=batch_packets)
    assert found.packets == [packet for one in batches for packet in one]
    assert found.info.truncation is None
    assert found.info.format == "mcap"
    assert found.channels == NAMES


@given(batches=drawn_batches())
@examples(200)
def test_messages_hold_what_comes_within_a_second_and_none_later_than_their_own_time(
    batches: list[list[Packet]],
) -> None:
    for one in batches:
        parts = list(cut(batch(one)))
        assert [packet for part in parts for packet in packets_of(part)] == one
        for part in parts:
            times = part.ts_ns.tolist()
            assert max(times) == times[-1] < min(times) + LONGEST_NS


@given(
    batches=drawn_batches(),
    begin=st.integers(-(10**10), 10**10),
    length=st.one_of(st.integers(0, 10**9), st.integers(0, 10**11)),
)
@examples(300)
def test_a_span_of_time_is_that_of_the_packets(
    batches: list[list[Packet]], begin: int, length: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = write(tmp_path_factory.mktemp("r") / "x.mcap", *batches, flushed=True)
    first, last = BEGIN_NS + begin, BEGIN_NS + begin + length
    found = [packet for one in open_source([str(path)]).between(first, last) for packet in packets_of(one)]
    assert found == [packet for one in batches for packet in one if first <= packet.ts_ns <= last]


def test_channels_that_become_known_later_have_their_names(tmp_path: Path) -> None:
    names = ["can0"]
    with open_sink(str(tmp_path / "x.mcap"), names) as sink:
        sink.write(batch([Packet(b"1", 1, BEGIN_NS, 227, 0)]))
        names.append("can1")
        sink.write(batch([Packet(b"2", 1, BEGIN_NS, 227, 1)]))
    found = read(tmp_path / "x.mcap")
    assert found.channels == ["can0", "can1"]
    assert [packet.channel for packet in found.packets] == [0, 1]


def test_attachments_come_with_it(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with open_sink(str(path)) as sink:
        sink.attach(Attachment("plant.gvl", "text/plain", lambda: b"VAR_GLOBAL", 7))
        sink.write(batch(steady(3)))
        sink.attach(Attachment("later.toml", "application/toml", lambda: b"ports = [1202]"))
    told = [(one.name, one.media_type, one.read(), one.time_ns) for one in open_source([str(path)]).attachments]
    assert told == [
        ("plant.gvl", "text/plain", b"VAR_GLOBAL", 7),
        ("later.toml", "application/toml", b"ports = [1202]", None),
    ]


def test_what_was_flushed_is_read_while_the_rest_is_recorded(tmp_path: Path) -> None:
    packets = steady(5)
    sink = open_sink(str(tmp_path / "x.mcap"))
    sink.write(batch(packets[:3]))
    sink.flush()
    sink.write(batch(packets[3:]))
    assert read(tmp_path / "x.mcap").packets == packets[:3]
    sink.close()
    assert read(tmp_path / "x.mcap").packets == packets


def test_a_recording_cut_at_any_byte_is_a_prefix_and_says_so(tmp_path: Path) -> None:
    packets = steady(40)
    whole = write(tmp_path / "x.mcap", *(packets[begin : begin + 10] for begin in range(0, 40, 10)), flushed=True)
    data, part = whole.read_bytes(), tmp_path / "part.mcap"
    header_end = _places(data)[1]
    # Where a record begins, within what says how long it is, and right behind that.
    edges = {place + part for place in _places(data) for part in (-1, 0, 1, 8, 9, 10)}
    everywhere = range(len(MAGIC), len(data))
    counts = []
    for length in sorted({*some(everywhere), *edges & {*everywhere}}):
        part.write_bytes(data[:length])
        if length < header_end:
            with pytest.raises(UnreadableInput, match="cut short in its header"):
                read(part)
            continue
        found = read(part)
        assert found.packets == packets[: len(found.packets)]
        assert found.info.truncation is not None
        assert "cut short" in found.info.truncation.message
        counts.append(len(found.packets))
    assert counts == sorted(counts), "a longer part has fewer packets"
    assert set(counts) == {0, 10, 20, 30, 40}


@given(data=st.data())
@examples(200)
def test_what_is_damaged_in_a_chunk_is_that_chunk_alone(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    packets = steady(40)
    parts = [packets[begin : begin + 10] for begin in range(0, 40, 10)]
    path = write(tmp_path_factory.mktemp("r") / "x.mcap", *parts, flushed=True)
    content = bytearray(path.read_bytes())
    chunks = [place for place in _places(content) if content[place] == Op.CHUNK]
    number = data.draw(st.integers(0, len(chunks) - 1))
    begin = chunks[number] + 9 + CHUNK_HEAD_BYTES + len("zstd") + 8
    (length,) = struct.unpack_from("<Q", content, begin - 8)
    place = data.draw(st.integers(begin, begin + length - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    found = read(path)
    if found.info.truncation is None:  # some bits of a frame mean nothing
        assert found.packets == packets
        return
    assert found.packets == [packet for other, part in enumerate(parts) if other != number for packet in part]
    assert found.info.truncation.offset == chunks[number]
    assert "the rest is read" in found.info.truncation.message


def _places(content: bytes | bytearray) -> list[int]:
    """Return where the records of a file begin, walked one by one."""
    found, place = [], len(MAGIC)
    while place + 9 <= len(content) - len(MAGIC):
        found.append(place)
        place += 9 + struct.unpack_from("<Q", content, place + 1)[0]
    return found


@given(data=st.data())
@examples(400)
def test_no_bytes_are_too_strange(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = write(tmp_path_factory.mktemp("r") / "x.mcap", steady(5), steady(5), channels=NAMES, flushed=True)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(len(MAGIC), len(content) - 1))
        content[place : place + data.draw(st.integers(0, 9))] = data.draw(st.binary(max_size=9))
    path.write_bytes(content)
    with suppress(UnreadableInput):
        read(path)


def _with_chunk(tmp_path: Path, unpacked: int, compression: str, packed: bytes, crc: int = 0) -> Path:
    path = write(tmp_path / "x.mcap", steady(3))
    chunk = struct.pack("<QQQI", BEGIN_NS, BEGIN_NS, unpacked, crc) + text(compression)
    chunk += struct.pack("<Q", len(packed)) + packed
    content = path.read_bytes()
    place = next(place for place in _places(content) if content[place] == Op.CHUNK)
    path.write_bytes(content[:place] + record(Op.CHUNK, chunk) + content[place:])
    return path


@pytest.mark.parametrize(
    ("unpacked", "compression", "packed", "told"),
    [
        (300 << 20, "zstd", b"", "more than 256 MB"),
        (1 << 60, "", b"", "more than 256 MB"),
        (50, "", b"abc", "damaged: 3 bytes, 50 should be there"),
        (2, "", b"abc", "damaged: more than bytes, 2"),
        (2, "brotli", b"abc", "compressed with 'brotli', which is unknown"),
        (2, "zstd", b"abc", "damaged"),
        (2, "lz4", b"abc", "damaged"),
    ],
)
def test_a_chunk_that_is_not_what_it_says_is_told(
    unpacked: int, compression: str, packed: bytes, told: str, tmp_path: Path
) -> None:
    found = read(_with_chunk(tmp_path, unpacked, compression, packed))
    assert len(found.packets) == 3
    assert found.info.truncation is not None
    assert told in found.info.truncation.message


def test_a_frame_that_unpacks_to_more_than_it_says_takes_no_more_memory(tmp_path: Path) -> None:
    import zstandard  # noqa: PLC0415

    bomb = zstandard.ZstdCompressor().compress(bytes(200 << 20))
    found = read(_with_chunk(tmp_path, 1000, "zstd", bomb))
    assert len(found.packets) == 3
    assert found.info.truncation is not None
    assert "1000 should be there" in found.info.truncation.message


def test_a_recording_of_a_later_format_is_refused_with_the_next_step(tmp_path: Path) -> None:
    path = write(tmp_path / "x.mcap", steady(3))
    content = path.read_bytes()
    told = text("format") + text("1")
    assert content.count(told) == 1
    path.write_bytes(content.replace(told, text("format") + text("9")))
    with pytest.raises(UnreadableInput, match="a recording of format 9") as caught:
        read(path)
    assert "the version that wrote it" in caught.value.next_step


def test_checksums_of_the_data_and_of_the_summary_are_those_of_their_bytes(tmp_path: Path) -> None:
    content = write(tmp_path / "x.mcap", steady(30), steady(30), flushed=True).read_bytes()
    places = {content[place]: place for place in _places(content)}
    end = places[Op.DATA_END]
    assert struct.unpack_from("<I", content, end + 9) == (zlib.crc32(content[:end]),)
    footer = places[Op.FOOTER]
    summary, _, crc = struct.unpack_from("<QQI", content, footer + 9)
    assert crc == zlib.crc32(content[summary : footer + 25])


def test_a_minute_of_one_packet_a_second_is_small(tmp_path: Path) -> None:
    path = write(tmp_path / "x.mcap", *([one] for one in steady(60, SECOND_NS)), flushed=True)
    assert path.stat().st_size < 60 * 400 + 8000
