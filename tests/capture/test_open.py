"""Opening by content: compressions, streams, directories, and what is told where it cannot be."""

from __future__ import annotations

import gzip
import io
import os
import shutil
import subprocess
import sys
import threading
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.compressed import Decompressed
from nvscope.capture.open import open_source
from nvscope.capture.reader import ReadingSizes
from nvscope.errors import ExitCode, UnreadableInput, UsageError
from tests.capture import build
from tests.capture.reference import Packet

COMPRESSIONS: dict[str, Callable[[bytes], bytes]] = {
    "gz": lambda data: gzip.compress(data, 1),
    "zst": lambda data: zstandard.ZstdCompressor(level=1).compress(data),
    "lz4": lz4.frame.compress,
}
_by_compression = pytest.mark.parametrize("compress", COMPRESSIONS.values(), ids=COMPRESSIONS.keys())

PACKETS = [Packet(build.BASE_S * 10**9 + n, 80, 1, bytes((n % 251,)) * (n % 90)) for n in range(500)]
RAW = build.pcap(PACKETS)


def write(path: Path, data: bytes) -> str:
    path.write_bytes(data)
    return str(path)


@_by_compression
@pytest.mark.parametrize("name", ["a.pcap", "a"])
def test_compressed_files_are_told_by_content(tmp_path: Path, compress: Callable[[bytes], bytes], name: str) -> None:
    data = compress(RAW)
    source = open_source([write(tmp_path / name, data)], batch_packets=64)
    assert build.packets_of(source) == PACKETS
    (info,) = source.infos
    assert (info.format, info.bytes, info.frames, info.truncation) == ("pcap", len(data), 500, None)
    assert source.position_bytes == source.size_bytes == len(data)


@_by_compression
def test_several_members_are_one_stream(tmp_path: Path, compress: Callable[[bytes], bytes]) -> None:
    data = b"".join(compress(RAW[begin : begin + 700]) for begin in range(0, len(RAW), 700))
    source = open_source([write(tmp_path / "a", data)])
    assert build.packets_of(source) == PACKETS
    assert source.infos[0].truncation is None


def test_zeros_after_the_last_gzip_member_are_no_data(tmp_path: Path) -> None:
    source = open_source([write(tmp_path / "a", gzip.compress(RAW) + bytes(5000))])
    assert build.packets_of(source) == PACKETS
    assert source.infos[0].truncation is None


@_by_compression
def test_something_else_behind_compressed_data_is_told(tmp_path: Path, compress: Callable[[bytes], bytes]) -> None:
    source = open_source([write(tmp_path / "a", compress(RAW) + b"something else")])
    assert build.packets_of(source) == PACKETS
    assert source.infos[0].truncation is not None
    assert "something else follows" in source.infos[0].truncation.message


@_by_compression
def test_a_compressed_file_cut_anywhere_gives_a_prefix_and_says_so(
    tmp_path: Path, compress: Callable[[bytes], bytes]
) -> None:
    raw = build.pcap(PACKETS[:40])
    data = compress(raw[:1000]) + compress(raw[1000:])
    whole_member = len(compress(raw[:1000]))
    most = unreadable = 0
    for cut in range(len(data)):
        path = write(tmp_path / "a", data[:cut])
        try:
            source = open_source([path])
        except UnreadableInput:
            # Not even the header of the capture can be had of so little.
            unreadable += 1
            continue
        found = build.packets_of(source)
        assert found == PACKETS[: len(found)]
        assert len(found) >= most
        most = len(found)
        truncation = source.infos[0].truncation
        assert truncation is not None
        assert truncation.offset == len(build.pcap(found))
        if cut == whole_member:
            assert truncation.offset <= 1000
        else:
            assert "end early" in truncation.message
    assert most
    assert unreadable <= whole_member


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data(), compress=st.sampled_from(list(COMPRESSIONS.values())))
def test_damaged_compressed_data_never_give_more_than_an_error_or_told_damage(
    tmp_path: Path, data: st.DataObject, compress: Callable[[bytes], bytes]
) -> None:
    mutated = bytearray(compress(RAW[:2000]))
    for _ in range(data.draw(st.integers(1, 3))):
        mutated[data.draw(st.integers(0, len(mutated) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    try:
        source = open_source([write(tmp_path / "a", bytes(mutated))])
        build.packets_of(source)
    except UnreadableInput:
        return


@_by_compression
def test_what_expands_greatly_comes_in_small_pieces(compress: Callable[[bytes], bytes]) -> None:
    data = compress(bytes(200 << 20))
    largest = total = 0
    for piece in Decompressed(iter([data]), {b"\x1f": "gzip", b"\x28": "zstd", b"\x04": "lz4"}[data[:1]]):
        largest = max(largest, len(piece))
        total += len(piece)
    assert total == 200 << 20
    assert largest <= 32 << 20


@_by_compression
def test_garbage_inside_compressed_data(tmp_path: Path, compress: Callable[[bytes], bytes]) -> None:
    path = write(tmp_path / "notes.txt.gz", compress(b"These are some notes."))
    with pytest.raises(UnreadableInput, match="54 68 65 73, expected a pcap") as caught:
        open_source([path])
    assert caught.value.where.startswith(f"{path}, offset 0 of the ")
    with pytest.raises(UnreadableInput, match="with nothing in them"):
        open_source([write(tmp_path / "empty.gz", compress(b""))])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"empty \(0 bytes\), expected a pcap, pcapng or mcap"),
        (b"no capture at all", "6e 6f 20 63, expected a pcap, pcapng or mcap"),
        (b"\x00", "00, expected a pcap, pcapng or mcap"),
        (RAW[:20], "20 bytes, expected a pcap header of 24"),
        (build.section(">")[:9], "9 bytes, expected a section header of 28"),
        (b"\x1f\x8b", "the gzip data end early"),
        (b"\x1f\x8b\x08\x00 not really gzip", "the gzip data"),
    ],
)
def test_what_is_no_capture_is_told_with_offset_and_expectation(tmp_path: Path, content: bytes, message: str) -> None:
    path = write(tmp_path / "a.pcap", content)
    with pytest.raises(UnreadableInput, match=message) as caught:
        open_source([path])
    assert caught.value.where.startswith(path)
    assert caught.value.exit_code == ExitCode.UNREADABLE


def test_files_that_cannot_be_opened(tmp_path: Path) -> None:
    with pytest.raises(UnreadableInput, match="No such file") as caught:
        open_source([str(tmp_path / "missing.pcap")])
    assert caught.value.where == str(tmp_path / "missing.pcap")
    with pytest.raises(UnreadableInput, match="a directory, expected a file"):
        CaptureFile(str(tmp_path))
    with pytest.raises(UsageError):
        open_source([])
    with pytest.raises(UsageError, match="more than once"):
        open_source(["-", "-"])


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read everything")
def test_a_file_without_permission(tmp_path: Path) -> None:
    path = tmp_path / "a.pcap"
    path.write_bytes(RAW)
    path.chmod(0)
    with pytest.raises(UnreadableInput, match="Permission denied"):
        open_source([str(path)])


def test_a_directory_is_all_captures_in_it(tmp_path: Path) -> None:
    later = [packet._replace(ts_ns=packet.ts_ns + 10**9) for packet in PACKETS]
    write(tmp_path / "b.bin", build.pcap(PACKETS))
    write(tmp_path / "a.pcap.gz", gzip.compress(build.pcap(later)))
    write(tmp_path / "notes.txt", b"about this")
    write(tmp_path / "empty.pcap", b"")
    (tmp_path / "sub").mkdir()
    source = open_source([str(tmp_path)])
    assert build.packets_of(source) == PACKETS + later
    assert [Path(info.path).name for info in source.infos] == ["a.pcap.gz", "b.bin"]
    with pytest.raises(UnreadableInput, match="no capture file among 0 files"):
        open_source([str(tmp_path / "sub")])


def test_a_file_can_be_read_twice(tmp_path: Path) -> None:
    source = open_source([write(tmp_path / "a", RAW[:-1])])
    for _ in range(2):
        assert build.packets_of(source) == PACKETS[:-1]
        assert source.infos[0].frames == 499
        assert source.infos[0].truncation is not None


def test_batches_stay_valid_when_the_next_ones_are_read(tmp_path: Path) -> None:
    data = RAW + RAW[24:] * 20
    for small_file_bytes, content in ((0, data), (0, gzip.compress(data))):
        path = write(tmp_path / "a", content)
        sizes = ReadingSizes(batch_packets=100)
        source = CaptureFile(path, sizes=sizes, small_file_bytes=small_file_bytes, chunk_bytes=4096)
        assert build.packets_of(list(source)) == PACKETS * 21


def test_progress_reaches_the_size(tmp_path: Path) -> None:
    for content in (RAW * 1, gzip.compress(RAW)):
        source = CaptureFile(write(tmp_path / "a", content), sizes=ReadingSizes(batch_packets=50, stride_bytes=1000))
        positions = [source.position_bytes for _ in source]
        assert positions == sorted(positions)
        assert positions[0] > 0
        assert source.position_bytes == source.size_bytes == len(content)


class _Stdin:
    """A pipe in place of stdin, and its other end."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        read_end, self.write_end = os.pipe()
        self._file = os.fdopen(read_end, "rb")
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(self._file))

    def feed(self, pieces: Iterator[bytes]) -> threading.Thread:
        def work() -> None:
            with os.fdopen(self.write_end, "wb", buffering=0) as file:
                for piece in pieces:
                    file.write(piece)

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        return thread


@pytest.mark.parametrize("compress", [bytes, *COMPRESSIONS.values()], ids=["plain", *COMPRESSIONS])
def test_stdin(monkeypatch: pytest.MonkeyPatch, compress: Callable[[bytes], bytes]) -> None:
    data = compress(RAW)
    thread = _Stdin(monkeypatch).feed(iter([data[:5], data[5:1000], data[1000:]]))
    source = open_source(["-"])
    assert build.packets_of(source) == PACKETS
    thread.join()
    assert source.size_bytes is None
    assert source.position_bytes == source.infos[0].bytes == len(data)
    assert source.infos[0].path == "-"


def test_stdin_that_is_a_file_and_one_that_was_read_from(tmp_path: Path) -> None:
    script = (
        "import sys; from nvscope.capture.open import open_source; source = open_source(['-']);"
        "print(sum(len(batch) for batch in source), source.size_bytes)"
    )
    path = write(tmp_path / "a", b"before" + RAW)
    for skip, expected in ((0, None), (6, "500 None\n")):
        with open(path, "rb") as file:
            os.lseek(file.fileno(), skip, os.SEEK_SET)
            done = subprocess.run(
                [sys.executable, "-c", script], stdin=file, capture_output=True, text=True, check=False
            )
        assert done.stdout == (expected or "")
        assert ("expected a pcap, pcapng or mcap file" in done.stderr) == (expected is None)
    with open(write(tmp_path / "b", RAW), "rb") as file:
        done = subprocess.run([sys.executable, "-c", script], stdin=file, capture_output=True, text=True, check=True)
    assert done.stdout == f"500 {len(RAW)}\n"


def test_a_pipe_that_pauses_gives_what_has_come(monkeypatch: pytest.MonkeyPatch) -> None:
    goes_on = threading.Event()
    first = len(build.pcap(PACKETS[:3])) + 7

    def pieces() -> Iterator[bytes]:
        yield RAW[:first]
        assert goes_on.wait(20)
        yield RAW[first:]

    thread = _Stdin(monkeypatch).feed(pieces())
    batches = iter(open_source(["-"]))
    assert len(next(batches)) == 3
    goes_on.set()
    assert sum(len(batch) for batch in batches) == 497
    thread.join()


def test_a_compressed_pipe_that_pauses_gives_what_has_come(monkeypatch: pytest.MonkeyPatch) -> None:
    goes_on = threading.Event()
    compressor = zlib.compressobj(wbits=31)
    first = len(build.pcap(PACKETS[:3])) + 7

    def pieces() -> Iterator[bytes]:
        yield compressor.compress(RAW[:first]) + compressor.flush(zlib.Z_SYNC_FLUSH)
        assert goes_on.wait(20)
        yield compressor.compress(RAW[first:]) + compressor.flush()

    thread = _Stdin(monkeypatch).feed(pieces())
    batches = iter(open_source(["-"]))
    assert len(next(batches)) == 3
    goes_on.set()
    assert sum(len(batch) for batch in batches) == 497
    thread.join()


def test_a_pipe_that_flows_gives_large_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    body = RAW[24:] * 100
    thread = _Stdin(monkeypatch).feed(iter([RAW[:24], *(body[at : at + 3000] for at in range(0, len(body), 3000))]))
    lengths = [len(batch) for batch in open_source(["-"])]
    thread.join()
    assert sum(lengths) == 50_000
    assert len(lengths) < 10


def test_stdin_beside_files(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    later = [packet._replace(ts_ns=packet.ts_ns + 250) for packet in PACKETS]
    thread = _Stdin(monkeypatch).feed(iter([RAW]))
    source = open_source([write(tmp_path / "a", build.pcap(later)), "-"], batch_packets=20)
    found = build.packets_of(source)
    thread.join()
    assert found == sorted(PACKETS + later, key=lambda packet: packet.ts_ns)
    assert [info.path for info in source.infos] == [str(tmp_path / "a"), "-"]
    assert source.size_bytes is None


@pytest.mark.parametrize("name", ["a.pcap", "b.gz"])
def test_memory_does_not_grow_with_the_file(tmp_path: Path, name: str) -> None:
    """Two files, one eight times the other: the peak of the process's own memory differs by little."""
    script = (
        "import sys; from nvscope.capture.open import open_source\n"
        "for batch in open_source(sys.argv[1:]): pass\n"
        "lines = dict(line.split(':') for line in open('/proc/self/status'))\n"
        "print(int(lines['VmHWM'].split()[0]))"
    )
    body = build.pcap([Packet(build.BASE_S * 10**9 + n, 160, 1, os.urandom(20) * 8) for n in range(10_000)])
    peaks = []
    for times in (10, 80):
        data = body + body[24:] * times
        path = write(tmp_path / name, zlib.compress(data, 1, wbits=31) if name.endswith("gz") else data)
        done = subprocess.run([sys.executable, "-c", script, path], capture_output=True, text=True, check=True)
        peaks.append(int(done.stdout))
        shutil.rmtree(tmp_path / name, ignore_errors=True)
    assert peaks[1] < peaks[0] + 40_000
