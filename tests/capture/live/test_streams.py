"""Captures that are read while they are written: by a pipe, or as a file that grows."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.live.byte_feed import ByteFeed, FileFeed, PipeFeed, ThreadFeed
from nvscope.capture.live.live_source import Autostop
from nvscope.capture.live.stream_clock import SLACK_NS, StreamClock
from nvscope.capture.live.stream_inlet import StreamInlet
from nvscope.capture.live.stream_source import StreamSource
from nvscope.capture.live.wait import Wait
from nvscope.capture.open import open_sink
from nvscope.capture.output import ChannelNames
from nvscope.capture.reader import Progress
from nvscope.capture.source import SourceInfo
from nvscope.errors import UnreadableInput, UsageError
from tests.capture.build import BASE_S, packets_of, pcap
from tests.capture.mcap.recordings import steady, write
from tests.capture.reference import Packet
from tests.laws import examples
from tests.program import COMMAND

_CAPTURES = Path(__file__).parents[3] / "captures"
_SECOND_NS = 1_000_000_000


def _in_blocks(content: bytes) -> bytes:
    """Return what a compressor writes that lets go of what it has every now and then."""
    stream = zstandard.ZstdCompressor().compressobj()
    parts = [
        stream.compress(content[at : at + 1000]) + stream.flush(zstandard.COMPRESSOBJ_FLUSH_BLOCK)
        for at in range(0, len(content), 1000)
    ]
    return b"".join([*parts, stream.flush()])


def _recorded(path: Path) -> bytes:
    """Return a recording of a capture, with a chunk for every seven packets."""
    source = CaptureFile(str(path))
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "x.mcap"
        with open_sink(str(recording), ChannelNames(lambda: source.channels)) as sink:
            for batch in source:
                for begin in range(0, len(batch), 7):
                    sink.write(batch[begin : begin + 7])
                    sink.flush()
        return recording.read_bytes()


_CONTENTS = {
    path: (_CAPTURES / path).read_bytes()
    for path in ("telegrams.pcap", "interfaces.pcapng", "truncated.pcap", "plant.pcapng.gz", "can/press.log")
}
_CONTENTS["truncated.pcap.zst"] = _in_blocks(_CONTENTS["truncated.pcap"])
_CONTENTS["plant.mcap"] = _recorded(_CAPTURES / "plant.pcapng.gz")
_CONTENTS["interfaces.mcap"] = _recorded(_CAPTURES / "interfaces.pcapng")
_CONTENTS["cut.log"] = _CONTENTS["can/press.log"][:-7]

pytestmark = pytest.mark.skipif(os.name == "nt", reason="pipes that can be waited for")


def _packets(count: int, begin_ns: int = BASE_S * _SECOND_NS, step_ns: int = 1000) -> list[Packet]:
    return [Packet(begin_ns + number * step_ns, 60, 1, bytes([number % 256]) * 60) for number in range(count)]


def _known(told: SourceInfo | Progress) -> tuple[Any, ...]:
    return told.frames, told.drops, told.drops_by, told.truncation, tuple(told.comments)


def _as_files_say(content: bytes, path: Path) -> tuple[list[Packet], SourceInfo, list[str]]:
    path.write_bytes(content)
    whole = CaptureFile(str(path))
    return packets_of(whole), whole.info, list(whole.channels)


def _of(batches: Iterator[PacketBatch]) -> list[Packet]:
    return packets_of(batch for batch in batches if len(batch))


@given(st.sampled_from(sorted(_CONTENTS)), st.lists(st.floats(0, 1), max_size=12), st.floats(0.8, 1), st.booleans())
@examples(60)
def test_in_any_pieces_it_is_what_a_file_would_be(
    tmp_path_factory: pytest.TempPathFactory, name: str, places: list[float], part: float, grows: bool
) -> None:
    content = _CONTENTS[name][: round(len(_CONTENTS[name]) * part)]
    directory = tmp_path_factory.mktemp("streams")
    expected = _as_files_say(content, directory / "whole")
    cuts = sorted(round(place * len(content)) for place in places)
    grows = grows and not name.endswith((".gz", ".zst"))
    growing = directory / "growing"
    growing.touch()
    ours, theirs = os.pipe()
    out = growing.open("wb", buffering=0) if grows else os.fdopen(theirs, "wb", buffering=0)
    feed: ByteFeed = FileFeed(str(growing)) if grows else PipeFeed(ours, owned=True)
    inlet = StreamInlet("-", feed, grows=grows, gather_ns=0)
    found: list[Packet] = []
    for begin, end in zip([0, *cuts], [*cuts, len(content)], strict=True):
        out.write(content[begin:end])
        while (batch := inlet.take()) is not None:
            found += packets_of([batch])
    out.close()
    while not grows and not inlet.ended:
        while (batch := inlet.take()) is not None:
            found += packets_of([batch])
    found += packets_of(inlet.drain())
    inlet.close()
    if grows:
        os.close(theirs)
        os.close(ours)
    # The last line of a text may be cut as long as nobody says that it is the last one.
    last = int(grows and name.endswith(".log") and len(found) < len(expected[0]))
    assert found == expected[0][: len(expected[0]) - last]
    assert list(inlet.channels) == expected[2]
    if not grows:
        assert (inlet.format, *_known(inlet.progress)) == (expected[1].format, *_known(expected[1]))


@pytest.mark.parametrize("make", [PipeFeed, ThreadFeed])
def test_packets_come_with_their_bytes_and_stop_ends_a_pipe_that_is_silent(make: Callable[[int], ByteFeed]) -> None:
    ours, theirs = os.pipe()
    source = StreamSource(StreamInlet("-", make(ours), grows=False), Wait(), Autostop())
    content = pcap(_packets(3))
    os.write(theirs, content[:-20])
    batches = iter(source)
    found = _of(batch for batch in (next(batches), next(batches)) if len(batch))
    assert len(found) == 2  # of the third one, some bytes are missing
    os.write(theirs, content[-20:])
    while not len(batch := next(batches)):
        pass
    assert len(batch) == 1
    threading.Timer(0.1, source.stop).start()
    assert not _of(batches)  # it ends, and its writer has not closed it
    assert source.infos[0].truncation is None
    os.close(theirs)
    os.close(ours)


def _followed(path: Path, *, seconds: float = 10.0) -> StreamSource:
    return StreamSource(
        StreamInlet(str(path), FileFeed(str(path)), grows=True), Wait(), Autostop(int(seconds * _SECOND_NS))
    )


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda path: path.write_bytes(b""), "the file was cut to 0 bytes, of which 252 had been read"),
        (lambda path: path.unlink(), "the file was deleted or renamed"),
        (lambda path: path.with_suffix(".new").rename(path), "another file has taken the place of this one"),
    ],
)
def test_a_file_that_is_another_one_ends(tmp_path: Path, change: Callable[[Path], Any], told: str) -> None:
    path = tmp_path / "capture.pcap"
    path.write_bytes(pcap(_packets(3)))
    path.with_suffix(".new").write_bytes(pcap(_packets(5)))
    source = _followed(path)
    found: list[Packet] = []
    for batch in source:
        if len(batch):
            found += packets_of([batch])
            change(path)
    assert found == _packets(3)
    assert source.infos[0].failure == told


def test_a_file_may_come_later_and_begin_with_a_part_of_its_header(tmp_path: Path) -> None:
    path = tmp_path / "capture.pcap"
    source = _followed(path)
    batches, content = iter(source), pcap(_packets(2))
    assert not len(next(batches))
    with path.open("wb", buffering=0) as file:
        file.write(content[:10])
        assert not len(next(batches))
        file.write(content[10:])
        while not len(batch := next(batches)):
            pass
        assert packets_of([batch]) == _packets(2)
        source.stop()
        assert not _of(batches)


def test_a_recording_that_has_its_end_is_followed_no_longer(tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.mcap", steady(20)).read_bytes()
    path = tmp_path / "x.mcap"
    path.write_bytes(whole[:-5])
    source = _followed(path, seconds=600)
    found: list[Any] = []
    for batch in source:
        found += [batch.ts_ns.tolist()] * bool(len(batch))
        if path.stat().st_size < len(whole):
            assert not source.infos[0].failure
            with path.open("ab") as file:
                file.write(whole[-5:])
    assert [time_ns for part in found for time_ns in part] == [packet.ts_ns for packet in steady(20)]
    assert source.infos[0].truncation is None
    assert source.infos[0].failure == ""


def test_a_file_that_never_comes_is_an_error_and_one_that_stays_empty_is_none(tmp_path: Path) -> None:
    with pytest.raises(UnreadableInput, match="no file had this name until the end"):
        list(_followed(tmp_path / "nothing.pcap", seconds=0.01))
    (tmp_path / "empty.pcap").touch()
    source = _followed(tmp_path / "empty.pcap", seconds=0.01)
    assert not _of(iter(source))
    assert not source.infos[0].failure


@pytest.mark.parametrize("name", ["plant.pcapng.gz", "plant.mf4"])
def test_what_cannot_be_followed_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(_CONTENTS[name] if name in _CONTENTS else b"MDF     " + bytes(100))
    with pytest.raises(UsageError, match=r"gzip data cannot be followed|of the format mf4 can be read when"):
        list(_followed(path))


class _Steady:
    """A clock that stands until somebody moves it."""

    now_ns = 5_000 * _SECOND_NS

    def __call__(self) -> int:
        return self.now_ns


def test_time_passes_in_the_stream_s_own_time() -> None:
    steady = _Steady()
    clock = StreamClock(steady)
    assert clock.until_ns() is None
    remote_ns = 1_000 * _SECOND_NS  # of a machine whose clock is elsewhere
    for late_ns in (0, 900_000_000, 200_000_000):
        clock.came(remote_ns - late_ns, remote_ns - late_ns)
        assert clock.until_ns() is None  # the packet tells more
    steady.now_ns += 10 * _SECOND_NS
    # What comes now can be as late as the latest one so far, and by the slack later.
    assert clock.until_ns() == remote_ns + 10 * _SECOND_NS - 900_000_000 - SLACK_NS


def test_a_writer_with_a_buffer_is_not_silent_while_it_fills() -> None:
    steady = _Steady()
    clock = StreamClock(steady)
    remote_ns = 1_000 * _SECOND_NS
    for _ in range(12):
        clock.came(remote_ns, remote_ns + 20 * _SECOND_NS)  # 20 s of packets at once
        remote_ns += 21 * _SECOND_NS
        steady.now_ns += 20 * _SECOND_NS
        assert (clock.until_ns() or 0) < remote_ns  # of which the next burst begins
        steady.now_ns += _SECOND_NS


def test_a_burst_is_forgotten_when_packets_come_as_they_are_captured() -> None:
    steady = _Steady()
    clock = StreamClock(steady)
    remote_ns = 1_000 * _SECOND_NS
    clock.came(remote_ns - 3_600 * _SECOND_NS, remote_ns)  # `tail -c +1 -f` of an hour
    for _ in range(100):
        steady.now_ns += _SECOND_NS
        remote_ns += _SECOND_NS
        clock.came(remote_ns, remote_ns)
    steady.now_ns += 10 * _SECOND_NS
    assert clock.until_ns() == remote_ns + 10 * _SECOND_NS - SLACK_NS


def test_what_a_file_held_before_is_not_late(tmp_path: Path) -> None:
    steady = _Steady()
    clock = StreamClock(steady)
    clock.came(0, 3_600 * _SECOND_NS, old=True)
    steady.now_ns += 10 * _SECOND_NS
    assert clock.until_ns() == 3_610 * _SECOND_NS - SLACK_NS
    clock.came(7_200 * _SECOND_NS, 7_200 * _SECOND_NS)
    steady.now_ns += 10 * _SECOND_NS
    assert clock.until_ns() == 7_210 * _SECOND_NS - SLACK_NS


def test_an_interrupt_ends_a_stream_with_its_result() -> None:
    ours, theirs = os.pipe()
    program = subprocess.Popen(
        [*COMMAND, "packets", "-", "--for", "60s", "--all-frames"],
        stdin=ours, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert program.stdout
    os.write(theirs, pcap(_packets(4, time.time_ns()))[:-1])
    lines = [program.stdout.readline() for _ in range(3)]  # which come although the stream goes on
    program.send_signal(signal.SIGTERM)
    rest, said = program.communicate(timeout=30)
    os.close(theirs)
    os.close(ours)
    assert all(lines)
    assert not rest
    assert program.returncode == 0, said
