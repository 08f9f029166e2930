"""CAN frames in PDUs that Wireshark exported: what it makes of a log, and tags that are wrong."""

from __future__ import annotations

import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from dissectors.batch import LinkType, PacketBatch
from dissectors.can.frame import dissect_can
from dissectors.sorter import Sorter
from nvscope.capture.capture_file import CaptureFile
from tests.capture.can import logs
from tests.capture.can.logs import Frame, line_of
from tests.laws import examples

_slow = examples(25, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
LITTLE = struct.pack("<IB3x", 0x123, 2) + b"\x11\x22".ljust(8, b"\0")
BIG = struct.pack(">IB3x", 0x123, 2) + b"\x11\x22".ljust(8, b"\0")
END = bytes(4)


def tag(kind: int, value: bytes, size: int | None = None) -> bytes:
    padded = value.ljust((len(value) + 3) // 4 * 4, b"\0")
    return struct.pack(">HH", kind, len(padded) if size is None else size) + padded


def named(name: bytes) -> bytes:
    return tag(12, name)


def frames_of(*pdus: bytes) -> list[tuple[int, int, bytes]]:
    found = dissect_can(PacketBatch.of(pdus, LinkType.UPPER_PDU))
    return [(int(found.row[n]), int(found.identifier[n]), found.payload(n)) for n in range(len(found))]


@pytest.mark.parametrize(
    ("name", "frame"),
    [(b"can-hostendian", LITTLE), (b"can-bigendian", BIG), (b"canfd", LITTLE), (b"canfd\0\0\0", LITTLE)],
)
@pytest.mark.parametrize("before", [b"", tag(20, bytes(4)), tag(99, b"")])
@pytest.mark.parametrize("behind", [b"", tag(25, b"1234")])
def test_a_frame_is_found_behind_its_tags(name: bytes, frame: bytes, before: bytes, behind: bytes) -> None:
    pdu = before + named(name) + behind + END + frame
    assert frames_of(b"", pdu, named(b"http") + END + frame, pdu) == [(1, 0x123, b"\x11\x22"), (3, 0x123, b"\x11\x22")]
    (is_fd,) = dissect_can(PacketBatch.of([pdu], LinkType.UPPER_PDU)).fd.tolist()
    assert is_fd == name.startswith(b"canfd")


@pytest.mark.parametrize(
    "pdu",
    [
        b"", b"\0", END, END + LITTLE, named(b"http") + END + LITTLE, named(b"can-hostendian"),
        named(b"can-hostendian") + END[:3], tag(12, b"can-hostendian", 60_000),
        named(b"can-hostendian-2") + END + LITTLE, named(b"can-hostendia") + END + LITTLE,
        named(b"canf") + END + LITTLE,
        tag(13, b"can-hostendian") + END + LITTLE, tag(99, b"") * 40 + named(b"canfd") + END + LITTLE,
    ],
)  # fmt: skip
def test_what_is_no_can_frame(pdu: bytes) -> None:
    assert frames_of(pdu) == []


@given(st.lists(st.binary(max_size=60) | st.binary(max_size=30).map(lambda rest: named(b"canfd") + END + rest)))
def test_no_bytes_raise(pdus: list[bytes]) -> None:
    assert len(frames_of(*pdus)) <= len(pdus)


def test_pdus_of_other_protocols_are_told_not_to_be_read() -> None:
    """A capture with such a frame has NV904."""
    can, other = named(b"can-hostendian") + END + LITTLE, named(b"http") + END + b"GET"
    told = Sorter().sort(PacketBatch.of([can, other, can], LinkType.UPPER_PDU))
    assert told.unsupported is not None
    assert told.unsupported.tolist() == [False, True, False]


@pytest.mark.skipif(not shutil.which("tshark"), reason="no tshark")
@_slow
@given(log=st.lists(logs.frames(), min_size=1, max_size=20))
def test_what_tshark_makes_of_a_log_is_the_log(tmp_path: Path, log: list[Frame]) -> None:
    """Wireshark 4.0 reads no remote frame's length and no other DLC of 8 bytes."""
    log = [frame._replace(raw_dlc=0, length=0 if "r" in frame.flags else frame.length) for frame in log]
    (tmp_path / "a.log").write_text("".join(line_of(frame) + "\n" for frame in log))
    command = ["tshark", "-r", str(tmp_path / "a.log"), "-w", str(tmp_path / "a.pcapng")]
    subprocess.run(command, capture_output=True, check=True)
    found = []
    for batch in CaptureFile(str(tmp_path / "a.pcapng")):
        frames = dissect_can(batch)
        assert batch.single_link == LinkType.UPPER_PDU
        for place in range(len(frames)):
            marks = (frames.extended, frames.remote, frames.error, frames.fd, frames.brs, frames.esi)
            flags = "".join(letter for letter, mark in zip("xrefbs", marks, strict=True) if mark[place])
            found.append((int(frames.ts_ns[place]), int(frames.identifier[place]), flags, frames.payload(place)))
    assert found == [(frame.ts_ns, frame.identifier, frame.flags, frame.data) for frame in log]
