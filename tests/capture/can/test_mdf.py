"""MDF files, which are read on the other side of a pipe: what comes through it, and what if nothing does."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dissectors.batch import Direction
from nvscope.capture.can import mdf_child
from nvscope.capture.can.mdf_child import DONE, FAILED, FRAMES, HEAD, RECORD
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.reader import ReadingSizes
from tests.capture.can.logs import Frame, frames_of
from tests.capture.can.test_log import some_frames, written

MDF = b"MDF     4.10    "


def record(**told: object) -> bytes:
    one = np.zeros(1, RECORD)
    for name, value in told.items():
        one[name] = value
    return one.tobytes()


def block(kind: bytes, content: bytes = b"") -> bytes:
    return HEAD.pack(kind, len(content)) + content


@pytest.fixture
def child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A program in place of the one that reads; what it does is for the test to write."""
    program = tmp_path / "child.py"
    monkeypatch.setattr(mdf_child, "__file__", str(program))
    (tmp_path / "a.mf4").write_bytes(MDF.ljust(64, b"\0"))
    return program


def says(
    program: Path, content: bytes, then: str = "", first: str = "", sizes: ReadingSizes | None = None
) -> CaptureFile:  # fmt: skip
    written = f"sys.stdout.buffer.write({content!r})\nsys.stdout.flush()"
    program.write_text(f"import os, signal, sys, time\n{first}\n{written}\n{then}\n")
    return CaptureFile(str(program.parent / "a.mf4"), sizes=sizes)


ONE = block(FRAMES, record(ts_ns=5, identifier=0x123, dlc=2, held=2, data=[1, 2, *[0] * 62], channel=1))


@pytest.mark.skipif(sys.platform == "win32", reason="no signals")
@pytest.mark.parametrize(
    ("then", "told"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", "ended asammdf by SIGSEGV"),
        ("os.kill(os.getpid(), signal.SIGKILL)", "ended asammdf by SIGKILL"),
        ("sys.exit(3)", "ended asammdf with code 3"),
    ],
)
def test_a_file_that_ends_who_reads_it_is_damaged(child: Path, then: str, told: str) -> None:
    source = says(child, ONE, then)
    assert [frame.identifier for frame in frames_of(source)] == [0x123]
    truncation = source.infos[0].truncation
    assert truncation is not None
    assert told in truncation.message
    # One of which nothing can be read is no reason to leave out the files beside it.
    source = says(child, b"", then)
    assert not frames_of(source)
    assert told in str(source.infos[0].truncation)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (ONE + block(FAILED, b"MdfException: an invalid block"), "an invalid block"),
        (ONE, "ended asammdf with code 0"),
        (ONE + ONE[:20], "ended asammdf with code 0"),
    ],
)
def test_a_file_that_is_not_read_to_its_end_is_damaged(child: Path, content: bytes, told: str) -> None:
    source = says(child, content)
    assert len(frames_of(source)) == 1
    assert told in str(source.infos[0].truncation)


def test_frames(child: Path) -> None:
    content = b"".join(
        [
            record(ts_ns=1, identifier=0x123, dlc=2, held=2, data=[1, 2, *[9] * 62], channel=1, direction=1),
            record(ts_ns=2, identifier=0x123, extended=1, dlc=9, held=12, fd=1, brs=1, esi=1, channel=2),
            record(ts_ns=3, kind=2, identifier=0x123, dlc=4, channel=1),
            record(ts_ns=4, identifier=0x123, dlc=13, held=8, channel=-1, direction=-1),
            *(record(ts_ns=5 + kind, kind=1, identifier=0x2C0, dlc=kind, channel=1, direction=-1) for kind in range(7)),
        ]
    )
    source = says(child, block(FRAMES, content) + block(DONE))
    nothing = bytes(8)
    stuff = bytes((0, 0, 4, 0, 0, 0, 0, 0))
    assert frames_of(source) == [
        Frame(1, "can1", 0x123, "", 2, b"\1\2"),
        Frame(2, "can2", 0x123, "xfbs", 12, bytes(12)),
        Frame(3, "can1", 0x123, "r", 4, b""),
        Frame(4, "", 0x123, "", 8, nothing, 13),
        Frame(5, "can1", 0, "e", 8, nothing),
        Frame(6, "can1", 8, "e", 8, bytes((0, 0, 1, 0, 0, 0, 0, 0))),
        Frame(7, "can1", 8, "e", 8, bytes((0, 0, 2, 0, 0, 0, 0, 0))),
        Frame(8, "can1", 8, "e", 8, stuff),
        Frame(9, "can1", 8, "e", 8, bytes((0, 0, 0, 8, 0, 0, 0, 0))),
        Frame(10, "can1", 0x20, "e", 8, nothing),
        Frame(11, "can1", 0, "e", 8, nothing),
    ]
    assert source.infos[0].truncation is None
    (batch,) = source
    assert batch.directions.tolist() == [Direction.TX, Direction.RX, Direction.RX, *[Direction.UNKNOWN] * 8]


def test_frames_that_cannot_be_are_left_out(child: Path) -> None:
    late = record(ts_ns=1 << 62) + record(ts_ns=-(1 << 63))
    content = record(identifier=0x800) + late + record(dlc=16) + record(ts_ns=7, identifier=1)
    source = says(child, block(FRAMES, content) + block(DONE))
    assert [frame.ts_ns for frame in frames_of(source)] == [7]
    assert "4 such frames are left out" in str(source.infos[0].truncation)


@pytest.mark.skipif(sys.platform == "win32", reason="to ask for a process there is to end it")
def test_who_stops_leaves_no_process_behind(child: Path) -> None:
    tells = f"open({str(child) + '.pid'!r}, 'w').write(str(os.getpid()))"
    batches = iter(says(child, ONE, "time.sleep(60)", first=tells, sizes=ReadingSizes(batch_packets=1)))
    assert len(next(batches)) == 1
    process = int(Path(f"{child}.pid").read_text())
    os.kill(process, 0)  # it is there, since it has not ended
    del batches
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


@pytest.mark.parametrize("whole", [0, 1, 5, 16_383, 16_384, 16_385, 20_000])
def test_all_before_a_record_that_cannot_be_read_is(whole: int) -> None:
    """Whoever asks for a record that is cut, be it among others, gets none."""

    def get(name: str, *, group: int, raw: bool, record_offset: int, record_count: int) -> SimpleNamespace:
        assert (name, group, raw) == ("CAN_DataFrame", 0, False)
        if record_offset + record_count > whole:
            raise ValueError("array-shape mismatch")
        identifier = np.arange(record_offset, record_offset + record_count, dtype=np.uint32)
        return SimpleNamespace(
            samples=identifier.view([("CAN_DataFrame.ID", "u4")]), timestamps=np.zeros(record_count, np.float64)
        )

    head = SimpleNamespace(channel_group=SimpleNamespace(cycles_nr=30_000))
    group = mdf_child._Group(SimpleNamespace(groups=[head], get=get), 0, 0, 0)
    found = [one["identifier"] for records in mdf_child._merged([group]) for one in records]
    assert found == list(range(whole))
    assert group.fault == f"frame {whole + 1} of channel group 1 is cut or broken"


@pytest.mark.parametrize("size", [64, 100, 500, 1000])
def test_a_file_that_is_cut_early_is_told_in_words_for_people(tmp_path: Path, size: int) -> None:
    path = written(tmp_path / "a.mf4", some_frames(1, 20))
    path.write_bytes(path.read_bytes()[:size])
    source = CaptureFile(str(path))
    assert not frames_of(source)
    assert "damaged: " in str(source.infos[0].truncation)
    assert "Error" not in str(source.infos[0].truncation)
    assert "mmap" not in str(source.infos[0].truncation)


def test_a_file_that_its_logger_did_not_finish(tmp_path: Path) -> None:
    """As a CANedge writes it: the counts of records are 0, and the head says which to fill in."""
    path = written(tmp_path / "a.mf4", some_frames(1, 20))
    whole = frames_of(CaptureFile(str(path)))
    raw = bytearray(path.read_bytes())
    raw[:8] = b"UnFinMF "
    raw[60:64] = (1).to_bytes(2, "little") + bytes(2)
    (tmp_path / "b.mf4").write_bytes(raw)
    source = CaptureFile(str(tmp_path / "b.mf4"))
    assert source.infos[0].format == "mf4"
    assert frames_of(source) == whole


class Group:
    """A group of frames in chunks of two."""

    def __init__(self, kind: int, times: list[int]) -> None:
        self.records = np.empty(0, RECORD)
        self.kind, self.times = kind, times

    @property
    def ended(self) -> bool:
        return not self.times

    def fill(self) -> None:
        if not len(self.records):
            self.records = np.zeros(len(self.times[:2]), RECORD)
            self.records["ts_ns"], self.records["kind"] = self.times[:2], self.kind
            self.times = self.times[2:]


def test_groups_are_merged_by_time() -> None:
    """A chunk is not written beyond what others can still have; each group keeps its own order."""
    groups = [Group(0, [1, 5, 6, 7, 9, 8]), Group(1, [2, 3, 4, 10]), Group(2, [])]
    merged = np.concatenate(list(mdf_child._merged(groups)))  # type: ignore[arg-type]
    assert merged["ts_ns"].tolist() == [1, 2, 3, 4, 5, 6, 7, 9, 8, 10]
    assert merged["kind"].tolist() == [0, 1, 1, 1, 0, 0, 0, 0, 0, 1]


@pytest.mark.parametrize("start_ns", [0, 1 << 61, -(1 << 61), 1 << 63, -(1 << 80)])
def test_times_that_no_integer_holds_are_none(start_ns: int) -> None:
    seconds = [0.0, 1.5, 1e10, -1e10, 1e300, float("inf"), float("nan")]
    group = object.__new__(mdf_child._Group)
    group._start_ns, group._kind = start_ns, 0
    samples = np.zeros(len(seconds), [("CAN_DataFrame.ID", "u4")])
    with np.errstate(all="raise"):
        found = group._of(samples, np.array(seconds))["ts_ns"].tolist()
    none = -(1 << 63)
    first = [start_ns, start_ns + 1_500_000_000] if abs(start_ns) < 1 << 62 else [none] * 2
    assert found == [*first, *[none] * 5]
