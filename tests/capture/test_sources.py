"""What every source promises: infos at any time, an end when somebody says so, and nothing left open then."""

from __future__ import annotations

import gzip
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dissectors.batch import PacketBatch
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.open import open_source
from nvscope.capture.reader import ReadingSizes
from nvscope.capture.source import FileSource, SourceInfo
from tests.capture import build
from tests.capture.can.test_blf import container, file_head, item, message
from tests.capture.reference import Packet
from tests.records import replace

PACKETS = [Packet(build.BASE_S * 10**9 + n, 40, 1, bytes((n % 251,)) * 40) for n in range(3000)]
RAW = build.pcap(PACKETS)
LINES = b"".join(b"(1436509052.%06d) can0 123#%02X\n" % (n, n % 256) for n in range(3000))
NAMES = ("a.pcap", "a.pcapng", "a.log", "a.pcap.gz", "a.log.gz", "a.asc", "a.trc", "a.blf", "a.txt")
WHOLE = ("a.pcap", "a.pcapng", "a.log")
"""Those of them that are read into memory at once, since they are small."""

pytestmark = pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="needs to see what is open")


def write(path: Path) -> str:
    blocks = b"".join(build.enhanced("<", packet.ts_ns // 1000, packet.data) for packet in PACKETS)
    pcapng = build.section("<") + build.interface("<") + blocks
    asc = b"date Mon Jan 1 10:00:00 2024\nbase hex timestamps absolute\nno internal events logged\n" + b"".join(
        b" %d.%06d 1 123 Rx d 1 0%d\n" % (n // 1000, n % 1000, n % 8) for n in range(3000)
    )
    trc = b";$FILEVERSION=1.1\n;$STARTTIME=45292.5\n" + b"".join(
        b" %d) %d.5 Rx 0123 1 0%d\n" % (n + 1, n, n % 8) for n in range(3000)
    )
    blf = file_head() + b"".join(
        container(b"".join(item(1, message(), time=1000 * (100 * part + n)) for n in range(100))) for part in range(30)
    )
    screen = b"".join(b" (1436509052.%06d)  can0  123   [1]  %02X\n" % (n, n % 256) for n in range(3000))
    raws = {"pcap": RAW, "pcapng": pcapng, "log": LINES, "asc": asc, "trc": trc, "blf": blf, "txt": screen}
    raw = raws[path.name.split(".")[1]]
    path.write_bytes(gzip.compress(raw, 1) if path.suffix == ".gz" else raw)
    return str(path)


def sources(folder: Path, name: str) -> Iterator[FileSource]:
    """A file alone, a file in a timeline, and parts of both; each with small batches."""
    path, other = write(folder / name), write(folder / f"b{name}")
    for paths in ([path], [path, other]):
        yield open_source(paths, batch_packets=50)
        yield open_source(paths, batch_packets=50).between(0, None)


def open_files() -> list[str]:
    """What is open and has a name in the file system, other than devices."""
    found = []
    for number in os.listdir("/proc/self/fd"):
        try:
            target = os.readlink(f"/proc/self/fd/{number}")
        except OSError:
            continue  # the one that the listing itself needed
        if "/a." in target or "/ba." in target or target.endswith("/pipe"):
            found.append(target)
    return found


@pytest.mark.parametrize("name", NAMES)
def test_a_stopped_source_ends_after_the_batch_in_hand_and_has_nothing_open(tmp_path: Path, name: str) -> None:
    for source in sources(tmp_path, name):
        batches = iter(source)
        frames = len(next(batches)) + len(next(batches))
        assert bool(open_files()) is (name not in WHOLE)
        stopper = threading.Thread(target=source.stop)
        stopper.start()
        stopper.join()
        assert not open_files()
        assert next(batches, None) is None
        source.stop()
        assert [info.truncation for info in source.infos] == [None] * len(source.infos)
        assert sum(info.frames for info in source.infos) >= frames
        assert list(source) == []
        assert not open_files()


@pytest.mark.parametrize("name", NAMES)
def test_a_source_can_be_stopped_before_it_is_read(tmp_path: Path, name: str) -> None:
    for source in sources(tmp_path, name):
        source.stop()
        assert list(source) == []
        assert not open_files()


def _feed(path: str, content: bytes, ended: threading.Event) -> threading.Thread:
    def run() -> None:
        with open(path, "wb") as pipe:
            pipe.write(content)
            pipe.flush()
            ended.wait(20)

    feeder = threading.Thread(target=run)
    feeder.start()
    return feeder


@pytest.mark.parametrize("content", [RAW, LINES, gzip.compress(RAW)[:-40]], ids=["pcap", "candump", "gzip"])
@pytest.mark.parametrize("alone", [True, False])
def test_a_silent_pipe_is_left_when_the_source_is_stopped(tmp_path: Path, content: bytes, alone: bool) -> None:
    """The reader waits for bytes that never come; nobody takes that for a file that was cut."""
    path, ended = str(tmp_path / "pipe"), threading.Event()
    os.mkfifo(path)
    feeder = _feed(path, content, ended)
    source = open_source([path] if alone else [path, write(tmp_path / "a.pcap")])
    timer = threading.Timer(1.0, source.stop)
    timer.start()
    begun = time.monotonic()
    frames = sum(len(batch) for batch in source)
    assert time.monotonic() - begun < 10
    ended.set()
    feeder.join()
    assert not open_files()
    assert frames
    assert [info.truncation for info in source.infos] == [None] * len(source.infos)


def test_a_pipe_that_nobody_reads_is_closed(tmp_path: Path) -> None:
    path, ended = str(tmp_path / "pipe"), threading.Event()
    os.mkfifo(path)
    feeder = _feed(path, RAW, ended)
    source = CaptureFile(path)
    assert source.first_ts_ns() == PACKETS[0].ts_ns
    assert len(open_files()) == 2
    source.stop()
    source.stop()
    assert len(open_files()) == 1
    assert list(source) == []
    ended.set()
    feeder.join()


def test_who_forgets_a_reading_closes_its_file(tmp_path: Path) -> None:
    mapped = CaptureFile(
        write(tmp_path / "a.pcap"), sizes=ReadingSizes(batch_packets=50, stride_bytes=4096), small_file_bytes=0
    )  # fmt: skip
    for source in (mapped, *sources(tmp_path, "a.pcap.gz")):
        batches = iter(source)
        next(batches)
        assert open_files()
        del batches
        assert not open_files()


def test_infos_are_frozen_values_that_follow_the_reading(tmp_path: Path) -> None:
    source = CaptureFile(write(tmp_path / "a.pcap"), sizes=ReadingSizes(batch_packets=100, stride_bytes=4096))
    before = source.info
    assert before == SourceInfo(source.path, "pcap", len(RAW))
    with pytest.raises(AttributeError):
        before.frames = 1  # type: ignore[misc]
    seen: list[int] = []
    looked = threading.Event()

    def look() -> None:
        while not looked.is_set():
            seen.append(source.info.frames)

    onlooker = threading.Thread(target=look)
    onlooker.start()
    counts = []
    for batch in source:
        counts.append(source.info.frames)
        assert counts[-1] >= len(batch)
    looked.set()
    onlooker.join()
    assert counts == sorted(counts)
    assert seen == sorted(seen)
    assert (before.frames, counts[0] < len(PACKETS), source.info.frames) == (0, True, len(PACKETS))
    assert hash(source.info) == hash(source.info)
    assert (source.info.drops, dict(source.info.drops_by), source.info.clock_steps) == (0, {}, 0)


def test_slices_say_nothing_of_the_time_behind_them() -> None:
    batch = replace(_two_packets(), until_ns=9)
    assert [part.until_ns for part in (batch[:], batch[0:2], batch[:1], batch[1:], batch[0:0])] == [9, 9] + [None] * 3
    assert PacketBatch.nothing(9)[0:5].until_ns == 9
    assert len(PacketBatch.nothing(9).with_margin()) == 0


def _two_packets() -> PacketBatch:
    from tests.capture.test_sinks import batch_of  # noqa: PLC0415

    return batch_of(PACKETS[:2])
