"""Logs that python-can wrote: our frames are those that python-can reads, for every format, whole or damaged."""

from __future__ import annotations

import gzip
import math
import random
import sqlite3
import subprocess
import sys
import zlib
from pathlib import Path

import can
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from nvscope.capture.can.blf_containers import BlfContainers
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.open import open_source
from nvscope.capture.reader import ReadingSizes
from nvscope.errors import UnreadableInput
from tests.capture.can import logs
from tests.capture.can.logs import Frame, frames_of, message_of
from tests.laws import examples, share_of, some

_slow = examples(40, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
FD_FORMATS = (".asc", ".blf", ".mf4")
ALL_FORMATS = (".log", ".asc", ".blf", ".trc", ".csv", ".db", ".mf4")
TEXTS = (".log", ".asc", ".trc", ".csv")


def written(path: Path, frames: list[Frame], channel: int | None = 0) -> Path:
    with can.Logger(str(path)) as logger:
        for frame in frames:
            logger.on_message_received(message_of(frame, channel))
    return path


def by_python_can(path: Path) -> list[tuple[object, ...]]:
    """What python-can reads: identifier, kind, data; absolute times where the format has a date."""
    arguments = {"relative_timestamp": False} if path.suffix == ".asc" else {}
    with can.LogReader(str(path), **arguments) as reader:
        return [
            (
                message.timestamp,
                message.arbitration_id,
                message.is_remote_frame,
                message.is_error_frame,
                message.is_extended_id and not message.is_error_frame,
                message.is_fd,
                bytes(message.data),
            )
            for message in reader
        ]


def compared(ours: list[Frame], theirs: list[tuple[object, ...]], knows_fd: bool, is_log: bool) -> None:
    assert len(ours) == len(theirs)
    for frame, (time, identifier, remote, error, extended, fd, data) in zip(ours, theirs, strict=True):
        assert isinstance(time, float)
        assert math.isclose(frame.ts_ns / 1e9, time, abs_tol=1e-6)
        assert ("e" in frame.flags) == error
        if error:
            # The identifier and the data that logs have beside it are the disturbed frame's, and no class of an error.
            assert is_log or (frame.identifier, frame.data) == (0, bytes(8))
            continue
        # python-can takes an empty frame of CAN FD in an .asc for a remote frame.
        assert (frame.identifier, "r" in frame.flags, "x" in frame.flags, frame.data) == (
            identifier,
            remote and not fd,
            extended,
            data,
        )
        if knows_fd:
            assert ("f" in frame.flags) == fd


@pytest.mark.parametrize("suffix", ALL_FORMATS)
@_slow
@given(data=st.data())
def test_frames_are_those_that_python_can_reads(tmp_path: Path, suffix: str, data: st.DataObject) -> None:
    fd = suffix in (*FD_FORMATS, ".log")
    frames = logs.frames(fd=fd, remote=suffix != ".trc", error=suffix != ".trc")
    log = sorted(data.draw(st.lists(frames, min_size=1, max_size=30)))
    log = [frame._replace(raw_dlc=0) for frame in log]
    path = tmp_path / f"a{suffix}"
    path.unlink(missing_ok=True)
    written(path, log)
    source = CaptureFile(str(path), sizes=ReadingSizes(batch_packets=data.draw(st.sampled_from((1, 7, 131_072)))))
    ours = frames_of(source)
    compared(ours, by_python_can(path), fd, suffix == ".log")
    info = source.infos[0]
    assert info.truncation is None
    assert info.frames == len(ours) == len(log)
    assert source.position_bytes == source.size_bytes


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc", ".csv", ".db", ".mf4"])
def test_compressed_piped_and_under_another_name(tmp_path: Path, suffix: str) -> None:
    log = some_frames(1, 200)
    path = written(tmp_path / f"a{suffix}", log)
    expected = frames_of(CaptureFile(str(path)))
    assert len(expected) == 200
    other = tmp_path / "other.bin"
    other.write_bytes(path.read_bytes())
    assert frames_of(CaptureFile(str(other))) == expected
    other.write_bytes(gzip.compress(path.read_bytes()))
    assert frames_of(CaptureFile(str(other))) == expected
    script = (
        "from nvscope.capture.open import open_source; source = open_source(['-']);"
        "print(sum(len(batch) for batch in source), source.infos[0].truncation)"
    )
    done = subprocess.run([sys.executable, "-c", script], input=path.read_bytes(), capture_output=True, check=True)
    assert done.stdout.decode().split() == ["200", "None"]
    assert done.stderr == b""


def some_frames(seed: int, count: int) -> list[Frame]:
    chance = random.Random(seed)
    frames = []
    now = logs.BASE_US
    for _ in range(count):
        now += chance.randrange(1, 5000)
        extended = chance.random() < 0.2
        data = chance.randbytes(chance.randrange(9))
        identifier = chance.randrange(1 << (29 if extended else 11))
        frames.append(Frame(1000 * now, "can0", identifier, "x" * extended, len(data), data))
    return frames


@pytest.mark.parametrize(
    ("suffix", "names"),
    [
        (".log", ["can0", "can1"]),
        (".asc", ["can1", "can2"]),
        (".blf", ["can1", "can2"]),
        (".mf4", ["can0", "can1"]),
        (".csv", []),
        (".db", []),
    ],
)
def test_channels(tmp_path: Path, suffix: str, names: list[str]) -> None:
    path = tmp_path / f"a{suffix}"
    frames = some_frames(2, 20)
    with can.Logger(str(path)) as logger:
        for number, frame in enumerate(frames):
            logger.on_message_received(message_of(frame, number % 2))
    source = CaptureFile(str(path))
    found = frames_of(source)
    assert list(source.channels) == names
    assert [frame.channel for frame in found] == [names[n % 2] if names else "" for n in range(20)]


@pytest.mark.parametrize("suffix", [".asc", ".trc", ".csv"])
def test_a_wrong_line_is_named_and_the_others_are_read(tmp_path: Path, suffix: str) -> None:
    path = written(tmp_path / f"a{suffix}", some_frames(3, 50))
    whole = frames_of(CaptureFile(str(path)))
    lines = path.read_bytes().splitlines(keepends=True)
    rows = [n for n, line in enumerate(lines) if (b"Rx" in line or b",0x" in line) and not line.startswith(b";")]
    lines[rows[20]] = lines[rows[20]].replace(b"Rx", b"Rx   d g").replace(b",0x", b",0y").replace(b" -  ", b" - z")
    path.write_bytes(b"".join(lines))
    source = CaptureFile(str(path))
    found = frames_of(source)
    assert found == whole[:20] + whole[21:]
    truncation = source.infos[0].truncation
    assert truncation is not None
    assert truncation.message.startswith(f"line {rows[20] + 1}: ")
    assert suffix == ".trc" or truncation.offset == sum(map(len, lines[: rows[20]]))


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc", ".csv", ".db", ".mf4"])
def test_cut_logs_give_a_prefix_and_never_a_traceback(
    tmp_path: Path, suffix: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path / f"a{suffix}", some_frames(4, 30))
    raw = path.read_bytes()
    whole = frames_of(CaptureFile(str(path)))
    cut = tmp_path / "cut"
    # A process is started for each .mf4.
    every = 1 if len(raw) < 3000 else len(raw) // (40 if suffix == ".mf4" else 150)
    capfd.readouterr()
    for end in some(range(0, len(raw), every)):
        cut.write_bytes(raw[:end])
        try:
            source = CaptureFile(str(cut))
            found = frames_of(source)
        except UnreadableInput:
            continue
        # The last line of a text may be cut within its data, and still be a line.
        assert [frame._replace(data=b"", length=0) for frame in found] == [
            frame._replace(data=b"", length=0) for frame in whole[: len(found)]
        ] or suffix in TEXTS
        assert found[:-1] == whole[: max(len(found) - 1, 0)]
        if suffix in (".blf", ".db", ".mf4"):
            assert source.infos[0].truncation is not None
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc", ".csv", ".db", ".mf4"])
def test_damaged_logs_never_raise(tmp_path: Path, suffix: str, capfd: pytest.CaptureFixture[str]) -> None:
    raw = written(tmp_path / f"a{suffix}", some_frames(5, 40)).read_bytes()
    chance = random.Random(6)
    path = tmp_path / "damaged"
    read = 0
    for _ in range(share_of(30 if suffix == ".mf4" else 300)):
        mutated = bytearray(raw)
        for _ in range(chance.choice((1, 3, 20))):
            at = chance.randrange(len(mutated))
            told = chance.randbytes(chance.choice((1, 1, 3)))
            # In an .mf4, whose blocks tell where others are, nothing is left of what bytes are missing before.
            gone = len(told) if suffix == ".mf4" else chance.choice((0, 1, 1, 40))
            mutated[at : at + gone] = told
        path.write_bytes(mutated)
        try:
            frames_of(CaptureFile(str(path)))
            read += 1
        except UnreadableInput:
            continue
    assert read
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".csv", ".db", ".mf4"])
def test_what_stands_beside_an_error_frame_is_no_class_of_an_error(tmp_path: Path, suffix: str) -> None:
    """0x2C0 has the bits of "bus off" and "bus error": of the frame that was disturbed it says nothing."""
    frame = Frame(1000 * logs.BASE_US, "can0", 0x2C0, "e", 8, bytes(range(8)))
    (found,) = frames_of(CaptureFile(str(written(tmp_path / f"a{suffix}", [frame]))))
    assert found[2:] == (0, "e", 8, bytes(8), 0)


def test_data_of_more_than_8_bytes_are_fd_where_the_format_cannot_say_so(tmp_path: Path) -> None:
    frame = Frame(1000 * logs.BASE_US, "can0", 0x88, "f", 12, bytes(range(12)))
    (found,) = frames_of(CaptureFile(str(written(tmp_path / "a.csv", [frame]))))
    assert (found.flags, found.length, found.data) == ("f", 12, bytes(range(12)))


def test_an_sqlite_file_that_is_no_log(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE records (t INTEGER)")
    with pytest.raises(UnreadableInput, match="without a table 'messages'") as caught:
        open_source([str(path)])
    assert "DataLogger" in caught.value.next_step


def test_a_container_that_expands_greatly_is_bounded(tmp_path: Path) -> None:
    """128 MiB of zeros in one container: told as damage, without holding them."""
    raw = written(tmp_path / "a.blf", some_frames(8, 3)).read_bytes()
    content = raw[144 + 16 : 144 + 32] + zlib.compress(bytes(128 << 20))
    size = 16 + len(content)
    bomb = raw[:144] + raw[144:152] + size.to_bytes(4, "little") + raw[156:160] + content + bytes(size % 4)
    largest = max(len(piece.data) for piece in BlfContainers(iter([bomb])))
    assert largest < 2 << 20
    (tmp_path / "b.blf").write_bytes(bomb)
    source = CaptureFile(str(tmp_path / "b.blf"))
    assert frames_of(source) == []
    assert source.infos[0].truncation is not None


@pytest.mark.parametrize("date", ["Fri Jul 10 06:17:32.000 am 2015", "Fr Mär 10 06:17:32 2015", "no date at all"])
def test_dates_of_asc(tmp_path: Path, date: str) -> None:
    path = tmp_path / "a.asc"
    path.write_bytes(
        f"date {date}\nbase hex  timestamps absolute\nno internal events logged\n"
        "   0.001500 1  123             Rx   d 2 01 02\n".encode("cp1252")
    )
    (frame,) = frames_of(CaptureFile(str(path)))
    assert frame.data == b"\x01\x02"
    assert (frame.ts_ns < 10**9) == ("at all" in date)
    assert frame.ts_ns % 10**9 == 1_500_000


def test_can_logs_beside_other_files_in_a_directory(tmp_path: Path) -> None:
    for number, suffix in enumerate((".asc", ".blf", ".log")):
        written(tmp_path / f"{number}{suffix}", some_frames(10 + number, 5))
    (tmp_path / "notes.txt").write_text("about this plant, recorded in 2015 by the night shift\n")
    with sqlite3.connect(tmp_path / "other.db") as database:
        database.execute("CREATE TABLE records (t INTEGER)")
    source = open_source([str(tmp_path)])
    assert len(frames_of(source)) == 15
    assert [info.format for info in source.infos] == ["asc", "blf", "candump"]
