"""The file holds the frames."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from tests.oracle.frame import Frame
from tests.oracle.pcap import in_microseconds, write_pcap
from tests.oracle.traffic import generate
from tests.oracle.wire import SECOND


@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("nanoseconds", [False, True])
def test_pcap_holds_the_frames(tmp_path: Path, nanoseconds: bool, big_endian: bool) -> None:
    frames = generate(3, 50)
    write_pcap(frames, tmp_path / "x.pcap", nanoseconds=nanoseconds, big_endian=big_endian)
    data = (tmp_path / "x.pcap").read_bytes()
    order = ">" if big_endian else "<"
    assert struct.unpack_from(order + "I", data)[0] == (0xA1B23C4D if nanoseconds else 0xA1B2C3D4)
    at, back = 24, []
    while at < len(data):
        seconds, rest, captured, original = struct.unpack_from(order + "IIII", data, at)
        time = seconds * SECOND + rest * (1 if nanoseconds else 1000)
        back.append(Frame(time, 1, data[at + 16 : at + 16 + captured], original))
        at += 16 + captured
    assert back == (frames if nanoseconds else in_microseconds(frames))
