"""Times in pcapng files: every clock that an interface may have, and times that no frame can have."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.pcapng.interfaces import Interface, InterfaceTable
from nvscope.capture.reader import ReadingSizes
from tests.capture import build
from tests.capture.reference import to_ns

_SIZES = ReadingSizes()
_seconds = st.one_of(st.integers(-(1 << 63), (1 << 63) - 1), st.integers(-12_000_000_000, 12_000_000_000), st.just(0))


@given(units=st.integers(0, 2**64 - 1), resolution=st.integers(0, 255), offset_s=_seconds)
def test_every_resolution_and_offset_is_exact(units: int, resolution: int, offset_s: int) -> None:
    interface = Interface(0, 1, 0, resolution=resolution, offset_s=offset_s)
    for others in ([], [Interface(0, 1, 0, resolution=3)]):
        table = InterfaceTable([interface, *others])
        ts_ns, known = table.ts_ns(np.array([units, 0], np.uint64), np.zeros(2, np.int64))
        expected = [to_ns(units, resolution, offset_s), to_ns(0, resolution, offset_s)]
        told = [True, True] if known is None else known.tolist()
        assert [time if sure else None for time, sure in zip(ts_ns.tolist(), told, strict=True)] == expected


def test_times_that_no_frame_can_have_are_told_and_the_frames_kept(tmp_path: Path) -> None:
    """The first with a time is the second; what follows has no time of its own but in the end."""
    late = [(1 << 64) - 1, 5_000_000, (1 << 63) + 7, (1 << 64) - 1, 6_000_000]
    packets = [build.enhanced("<", units, bytes([row])) for row, units in enumerate(late)]
    head = build.section("<") + build.interface("<")
    for stride, batch in ((1, 1), (1 << 20, 131_072)):
        sizes = ReadingSizes(stride_bytes=stride, batch_packets=batch)
        source, found = build.read(tmp_path / "a", head + b"".join(packets), sizes, 0, 64)
        assert [packet.data for packet in found] == [bytes([row]) for row in range(5)]
        assert [packet.ts_ns // 1_000_000_000 for packet in found] == [0, 5, 5, 5, 6]
        told = source.info.truncation
        assert told is not None
        assert told.offset == len(head)
        assert told.message.startswith("frame 1 has a time before 1823 or after 2116")
        assert told.message.endswith("; 3 such frames")
    source, found = build.read(tmp_path / "a", head + b"".join(packets) + packets[0][:-3], _SIZES, 0, 64)
    told = source.info.truncation
    assert told is not None
    assert told.offset == len(head) + sum(map(len, packets))
    assert "cut short" in told.message
    assert "before that, frame 1 has a time" in told.message


@pytest.mark.parametrize(
    ("resolution", "offset_s", "units", "ts_ns"),
    [
        (6, 0, 1_700_000_000_123_456, 1_700_000_000_123_456_000),
        (9, 0, 1_700_000_000_123_456_789, 1_700_000_000_123_456_789),
        (3, 0, 1_700_000_000_123, 1_700_000_000_123_000_000),
        (0, -5, 1_700_000_000, 1_699_999_995_000_000_000),
        (12, 0, 1_700_000_123_456_789_012, 1_700_000_123_456_789),
        (0x80 | 10, 0, 1024 * 1_700_000_000 + 512, 1_700_000_000_500_000_000),
        (0x80 | 32, 0, (1_700_000_000 << 32) + (1 << 30), 1_700_000_000_250_000_000),
        (6, 1_700_000_000, 1, 1_700_000_000_000_001_000),
        # Windows counts 100 ns since 1601.
        (7, -11_644_473_600, 116_444_736_000_000_000 + 17_000_000_000_000_005, 1_700_000_000_000_000_500),
        (6, -4_000_000_000, 0, -4_000_000_000_000_000_000),
    ],
)
def test_clocks_of_interfaces(tmp_path: Path, resolution: int, offset_s: int, units: int, ts_ns: int) -> None:
    options = build.option("<", 9, bytes((resolution,))) + build.option("<", 14, struct.pack("<q", offset_s))
    raw = build.section("<") + build.interface("<", options=options) + build.enhanced("<", units, b"x")
    _, found = build.read(tmp_path / "a", raw, _SIZES, 0, 64)
    assert [packet.ts_ns for packet in found] == [ts_ns]
