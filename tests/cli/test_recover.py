"""``nvscope recover``: what is whole of a recording is a file that other tools read, and what is not is told."""

from __future__ import annotations

import struct
from io import BytesIO
from pathlib import Path

import pytest
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.writer import Writer

from nvscope.capture.mcap.records import MAGIC, Op
from tests.capture.mcap.recordings import read, steady, write
from tests.program_here import run_text

PEERS = Path(__file__).parents[2] / "captures" / "peers"
STEP_BYTES = 97


def places_of(content: bytes) -> list[tuple[int, int]]:
    """Return kind and place of each record of a file."""
    found, place = [], len(MAGIC)
    while place + 9 <= len(content) - len(MAGIC):
        found.append((content[place], place))
        place += 9 + struct.unpack_from("<Q", content, place + 1)[0]
    return found


def recovered(content: bytes, tmp_path: Path, code: int = 0) -> tuple[Path, str]:
    (tmp_path / "cut.mcap").write_bytes(content)
    done = run_text("recover", tmp_path / "cut.mcap", "-w", tmp_path / "whole.mcap", "--force")
    assert (done.returncode, done.stdout) == (code, ""), done.stderr
    assert (tmp_path / "cut.mcap").read_bytes() == content
    return tmp_path / "whole.mcap", done.stderr


def messages_in(path: Path) -> list[tuple[str, int, bytes]]:
    with path.open("rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        return [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in reader.iter_messages(log_time_order=False)
        ]


def test_what_is_cut_off_anywhere_is_whole_as_far_as_it_goes(tmp_path: Path) -> None:
    packets = steady(40)
    whole = write(tmp_path / "x.mcap", *(packets[begin : begin + 10] for begin in range(0, 40, 10)), flushed=True)
    content = whole.read_bytes()
    chunks = [place for kind, place in places_of(content) if kind == Op.CHUNK]
    for length in range(chunks[-2], len(content), STEP_BYTES):
        path, told = recovered(content[:length], tmp_path)
        (tmp_path / "part.mcap").write_bytes(content[:length])
        assert read(path).packets == read(tmp_path / "part.mcap").packets
        assert read(path).info.truncation is None
        assert messages_in(path)
        assert f"nvscope: {len(read(path).packets)} frames in" in told


def test_a_whole_one_comes_out_as_it_is(tmp_path: Path) -> None:
    done = run_text("record", PEERS / "peers.pcap", "--gvl", PEERS, "-w", tmp_path / "x.mcap")
    assert done.returncode == 0
    path, told = recovered((tmp_path / "x.mcap").read_bytes(), tmp_path)
    assert path.read_bytes() == (tmp_path / "x.mcap").read_bytes()
    assert "864 frames and " in told
    assert "nothing was lost" in told


def test_what_was_in_a_damaged_chunk_is_told_in_packets_and_seconds(tmp_path: Path) -> None:
    packets = steady(40, 100_000_000)
    whole = write(tmp_path / "x.mcap", *(packets[begin : begin + 10] for begin in range(0, 40, 10)), flushed=True)
    content = bytearray(whole.read_bytes())
    chunks = [place for kind, place in places_of(bytes(content)) if kind == Op.CHUNK]
    content[chunks[1] + 100] ^= 1
    path, told = recovered(bytes(content), tmp_path, code=3)
    assert read(path).packets == packets[:10] + packets[20:]
    assert "10 frames lost within 1.1 s" in told
    assert f"offset {chunks[1]}: " in told


def test_the_next_chunk_is_found_behind_bytes_that_are_gone(tmp_path: Path) -> None:
    packets = steady(40, 100_000_000)
    whole = write(tmp_path / "x.mcap", *(packets[begin : begin + 10] for begin in range(0, 40, 10)), flushed=True)
    content = whole.read_bytes()
    chunks = [place for kind, place in places_of(content) if kind == Op.CHUNK]
    for begin, gone in ((chunks[1] + 60, 20), (chunks[1], 5), (chunks[1] - 3, 60)):
        path, told = recovered(content[:begin] + content[begin + gone :], tmp_path, code=3)
        assert read(path).packets == packets[:10] + packets[20:], told
        assert "bytes that are no record" in told or "offset" in told
        assert "10 frames lost within 1.1 s" in told


def test_readers_find_the_next_chunk_too(tmp_path: Path) -> None:
    packets = steady(40, 100_000_000)
    whole = write(tmp_path / "x.mcap", *(packets[begin : begin + 10] for begin in range(0, 40, 10)), flushed=True)
    content = whole.read_bytes()
    chunks = [place for kind, place in places_of(content) if kind == Op.CHUNK]
    for begin, gone in ((chunks[1] + 60, 20), (chunks[1], 5), (chunks[1] - 3, 60)):
        (tmp_path / "y.mcap").write_bytes(content[:begin] + content[begin + gone :])
        found = read(tmp_path / "y.mcap")
        assert found.packets == packets[:10] + packets[20:]
        assert found.info.truncation is not None
        assert "; the rest is read" in found.info.truncation.message
        done = run_text("packets", tmp_path / "y.mcap", "--all-frames")
        assert (done.returncode, len(done.stdout.splitlines())) == (3, 30), done.stderr


def test_topics_that_are_told_in_the_summary_alone_are_recovered(tmp_path: Path) -> None:
    assert run_text("record", PEERS / "peers.pcap", "--gvl", PEERS, "-w", tmp_path / "x.mcap").returncode == 0
    content = (tmp_path / "x.mcap").read_bytes()
    before = messages_in(tmp_path / "x.mcap")
    places = places_of(content)
    channels = [place for kind, place in places[: len(places) // 2] if kind == Op.CHANNEL]
    damaged = bytearray(content)
    damaged[channels[2] : channels[2] + 3] = b"\0\0\0"
    path, told = recovered(bytes(damaged), tmp_path, code=3)
    assert messages_in(path) == before, told


def test_messages_of_topics_that_nobody_tells_of_are_left_out_and_told(tmp_path: Path) -> None:
    assert run_text("record", PEERS / "peers.pcap", "--gvl", PEERS, "-w", tmp_path / "x.mcap").returncode == 0
    content = (tmp_path / "x.mcap").read_bytes()
    places = places_of(content)
    channels = [place for kind, place in places[: len(places) // 2] if kind == Op.CHANNEL]
    end = next(place for kind, place in places if kind == Op.DATA_END)
    damaged = bytearray(content[:end])
    damaged[channels[2] : channels[2] + 3] = b"\0\0\0"
    path, told = recovered(bytes(damaged), tmp_path, code=3)
    assert messages_in(path)
    assert "messages of topics that are not told any more" in told
    assert "864 frames" in told


def test_packets_that_are_lost_at_the_end_are_told_in_seconds(tmp_path: Path) -> None:
    packets = steady(40, 100_000_000)
    whole = write(tmp_path / "x.mcap", *(packets[begin : begin + 20] for begin in range(0, 40, 20)), flushed=True)
    content = bytearray(whole.read_bytes())
    chunks = [place for kind, place in places_of(bytes(content)) if kind == Op.CHUNK]
    content[chunks[1] + 100] ^= 1
    _, told = recovered(bytes(content), tmp_path, code=3)
    assert "what came within the last 2.0 s is lost." in told


def test_seconds_are_told_where_the_only_packets_are_lost(tmp_path: Path) -> None:
    content = bytearray(write(tmp_path / "x.mcap", steady(10, 100_000_000)).read_bytes())
    chunk = next(place for kind, place in places_of(bytes(content)) if kind == Op.CHUNK)
    content[chunk + 100] ^= 1
    path, told = recovered(bytes(content), tmp_path, code=3)
    assert read(path).packets == []
    assert "what came within 1.0 s at most is lost with it" in told


def test_what_nothing_else_covers_is_told_by_the_whole(tmp_path: Path) -> None:
    content = bytearray(write(tmp_path / "x.mcap", steady(10)).read_bytes())
    schema = content.index(b"nvscope.packets")
    content[schema] ^= 1
    _, told = recovered(bytes(content), tmp_path, code=3)
    assert "not what was written (CRC of all of it)" in told or "CRC" in told


def test_a_summary_that_is_cut_off_is_made_anew_and_that_is_told(tmp_path: Path) -> None:
    content = write(tmp_path / "x.mcap", steady(10)).read_bytes()
    end = next(place for kind, place in places_of(content) if kind == Op.DATA_END)
    for length in (len(content) - 3, len(content) - 20, end + 13, end + 40):
        path, told = recovered(content[:length], tmp_path)
        assert path.read_bytes() == content
        assert "its summary is cut off, and was made anew; nothing was lost." in told


def test_what_other_tools_wrote_is_recovered_too(tmp_path: Path) -> None:
    out = BytesIO()
    writer = Writer(out, chunk_size=200)
    writer.start("ros1", "somebody")
    writer.add_attachment(3, 5, "map.png", "image/png", b"\x89PNG")
    schema = writer.register_schema("pose", "jsonschema", b'{"type": "object"}')
    channel = writer.register_channel("/pose", "json", schema, {"a": "b"})
    for number in range(50):
        writer.add_message(channel, 10**18 + number, b'{"x": %d}' % number, 10**18, number)
    writer.add_metadata("run", {"who": "me"})
    writer.finish()
    content = out.getvalue()
    end = next(place for kind, place in places_of(content) if kind == Op.DATA_END)
    path, told = recovered(content[: end + 3], tmp_path)
    assert messages_in(path) == [("/pose", 10**18 + number, b'{"x": %d}' % number) for number in range(50)]
    assert "0 frames and 50 messages of topics" in told
    assert "cut off: 3 bytes behind the last whole record" in told
    with path.open("rb") as file:
        reader = NonSeekingReader(file, validate_crcs=True)
        assert [(one.name, one.data, one.create_time) for one in reader.iter_attachments()] == [
            ("map.png", b"\x89PNG", 3)
        ]
    with path.open("rb") as file:
        assert {one.name: one.metadata for one in NonSeekingReader(file).iter_metadata()} == {"run": {"who": "me"}}


@pytest.mark.parametrize(
    ("content", "words", "told"),
    [
        (b"", (), "no MCAP file, or its begin is gone"),
        (b"something else", (), "no MCAP file, or its begin is gone"),
        (MAGIC, ("-w", "x.pcap"), "recover writes an .mcap file"),
        (MAGIC + b"\x01\x90\0\0\0\0\0\0\0", (), "cut short in its header"),
    ],
)
def test_what_cannot_be_recovered_is_told_with_the_next_step(
    content: bytes, words: tuple[str, ...], told: str, tmp_path: Path
) -> None:
    (tmp_path / "cut.mcap").write_bytes(content)
    done = run_text("recover", "cut.mcap", *(words or ("-w", "x.mcap")), cwd=tmp_path)
    assert done.returncode in (2, 4)
    assert told in done.stderr
    assert [one.name for one in tmp_path.iterdir()] == ["cut.mcap"]


def test_files_are_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "x.mcap", steady(3))
    for target, told in ((path, "one of the inputs"), (write(tmp_path / "y.mcap", steady(4)), "exists already")):
        before = target.read_bytes()
        done = run_text("recover", path, "-w", target)
        assert (done.returncode, told in done.stderr, target.read_bytes()) == (2, True, before)
    assert "no file to write is named" in run_text("recover", path).stderr


def test_what_is_in_recordings_of_others_is_told(tmp_path: Path) -> None:
    out = BytesIO()
    writer = Writer(out)
    writer.start("ros1", "somebody")
    schema = writer.register_schema("pose", "jsonschema", b"{}")
    for topic in ("/pose", "/tf\x1b[31m"):
        writer.add_message(writer.register_channel(topic, "json", schema), 10**18, b"{}", 10**18)
    writer.finish()
    (tmp_path / "x.mcap").write_bytes(out.getvalue())
    for verb in (("report",), ("packets",), ("convert", "-w", str(tmp_path / "y.pcap"))):
        done = run_text(verb[0], tmp_path / "x.mcap", *verb[1:])
        assert done.returncode == 0, done.stderr
        assert "x.mcap: no packets are in it; its topics are /pose, /tf\\x1b[31m." in done.stderr
