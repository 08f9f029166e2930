"""candump logs that we write: read back frame by frame, by us and by python-can."""

from __future__ import annotations

import struct
import subprocess
from pathlib import Path

import can
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dissectors.batch import PAD_BYTES, LinkType, PacketBatch
from nvscope.capture.open import open_sink, open_source
from nvscope.errors import UsageError
from tests.capture.can import logs
from tests.capture.can.logs import Frame, frames_of, line_of, message_of
from tests.records import replace

CAN_ERR_BUSERROR = 0x80
NAMES = ("can0", "vcan12", "PCAN_USBBUS1")


def packed(frame: Frame) -> bytes:
    word = frame.identifier
    fd_flags = 0
    for letter, bit in {"x": 1 << 31, "r": 1 << 30, "e": 1 << 29}.items():
        word |= bit if letter in frame.flags else 0
    for letter, bit in {"f": 4, "b": 1, "s": 2}.items():
        fd_flags |= bit if letter in frame.flags else 0
    return struct.pack(">IBBxB", word, frame.length, fd_flags, frame.raw_dlc) + frame.data


def batch_of(frames: list[Frame], names: tuple[str, ...] = NAMES) -> PacketBatch:
    raw = [packed(frame) for frame in frames]
    captured = np.array([len(one) for one in raw], np.int64)
    return PacketBatch(
        np.frombuffer(b"".join(raw) + bytes(PAD_BYTES), np.uint8),
        np.cumsum(captured) - captured,
        captured.astype(np.int32),
        captured,
        np.array([frame.ts_ns for frame in frames], np.int64),
        PacketBatch.link_column(LinkType.CAN_SOCKETCAN, len(frames)),
        np.array([names.index(frame.channel) for frame in frames], np.uint16),
    )


def write(path: Path, frames: list[Frame], cut: int = 0) -> None:
    with open_sink(str(path), NAMES) as sink:
        for part in (frames[:cut], frames[cut:]):
            sink.write(batch_of(part))


_slow = settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow], deadline=None)
_logs = st.lists(logs.frames(channels=NAMES), max_size=60)


@_slow
@given(log=_logs, cut=st.integers(0, 60), finer=st.lists(st.integers(-(10**12), 10**12), max_size=60))
def test_we_read_what_was_written(tmp_path: Path, log: list[Frame], cut: int, finer: list[int]) -> None:
    """Times in microseconds or nanoseconds, before 1970 too."""
    for place, shift in enumerate(finer[: len(log)]):
        log[place] = log[place]._replace(ts_ns=log[place].ts_ns + shift if shift % 3 else shift)
    path = tmp_path / "a.log"
    write(path, log, cut)
    lines = path.read_text().splitlines()
    for frame, line in zip(log, lines, strict=True):
        if frame.ts_ns >= 0:
            assert line == line_of(frame, decimals=9 if frame.ts_ns % 1000 else 6)
    assert (frames_of(open_source([str(path)])) if log else []) == log


@_slow
@given(log=_logs)
def test_python_can_reads_what_was_written(tmp_path: Path, log: list[Frame]) -> None:
    """It reads no raw DLC of a frame of 8 bytes, and knows no error frames but those of the class bus error."""
    log = [frame._replace(raw_dlc=0) for frame in log]
    path = tmp_path / "a.log"
    write(path, log)
    with can.LogReader(str(path)) as reader:
        found = list(reader)
    for frame, message in zip(log, found, strict=True):
        expected = message_of(frame, frame.channel)
        if "e" in frame.flags and frame.identifier & CAN_ERR_BUSERROR:
            assert message.is_error_frame
            continue
        if "e" in frame.flags:
            expected.is_error_frame, expected.is_extended_id = False, True
        assert message.equals(expected, timestamp_delta=5e-7, check_direction=False), (message, expected)


@_slow
@given(log=_logs.filter(len))
def test_pcapng_keeps_channels(tmp_path: Path, log: list[Frame]) -> None:
    path = tmp_path / "a.pcapng"
    write(path, log)
    assert frames_of(open_source([str(path)])) == log


def test_can_utils_read_what_was_written(tmp_path: Path) -> None:
    """log2asc of can-utils says the same of our log as of one that candump would have written."""
    log = [Frame(10**15 + 1000 * n, "can0", n * 37 % 2048, "", n % 9, bytes(range(n % 9))) for n in range(300)]
    ours, theirs = tmp_path / "ours.log", tmp_path / "theirs.log"
    write(ours, log)
    theirs.write_text("".join(line_of(frame) + "\n" for frame in log))
    try:
        said = [
            subprocess.run(["log2asc", "-I", str(path), "can0"], capture_output=True, check=True).stdout
            for path in (ours, theirs)
        ]
    except FileNotFoundError:
        pytest.skip("needs can-utils")
    assert said[0].splitlines()[1:] == said[1].splitlines()[1:]
    assert len(said[0].splitlines()) >= 300


def test_what_a_log_cannot_hold(tmp_path: Path) -> None:
    path = str(tmp_path / "a.log")
    ethernet = replace(batch_of([Frame(0, "can0", 1, "", 0, b"")]), link=PacketBatch.link_column(LinkType.ETHERNET, 1))
    with open_sink(path) as sink, pytest.raises(UsageError, match="frames of CAN only"):
        sink.write(ethernet)
    good = Frame(0, "can0", 1, "", 2, b"ab")
    with open_sink(path) as sink:
        sink.write(batch_of([good]))
        for bad in (good._replace(length=4), good._replace(length=12), good._replace(identifier=0x800)):
            with pytest.raises(UsageError, match="frame 3 is no whole CAN frame"):
                sink.write(batch_of([good, bad]))


def test_names_of_channels_are_one_word(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    with open_sink(str(path), ["my bus", ""]) as sink:
        sink.write(batch_of([Frame(0, "a", 1, "", 0, b""), Frame(0, "b", 1, "", 0, b"")], ("a", "b")))
    assert [line.split()[1] for line in path.read_text().splitlines()] == ["my_bus", "can1"]
