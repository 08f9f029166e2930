"""Malformed telegrams, and those that the capture cut."""

from __future__ import annotations

import pytest

from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.reference import reference_report
from tests.oracle.wire import ALL, A, B, Wire


@pytest.mark.parametrize(
    ("payload", "codes"),
    [
        (telegram()[:12], {"NV101": 1}),
        (telegram()[:19], {"NV101": 1}),
        (telegram(length=23), {"NV102": 1}),
        (telegram(length=22 << 8), {"NV105": 1}),
        (telegram(7), {"NV103": 1}),
        (telegram(7, length=23), {"NV102": 1}),
        (telegram(7)[:15], {"NV101": 1}),
        (telegram(flags=8), {"NV104": 1}),
        (telegram(flags=8, length=23), {"NV102": 1}),
        (telegram(identity=b"0-S3"), {"NV106": 1}),
    ],
)
def test_malformed(payload: bytes, codes: dict[str, int]) -> None:
    wire = Wire().send(0, A, ALL, payload)
    assert wire.codes() == codes
    malformed = int(not codes.keys() & {"NV104", "NV106"})
    assert wire.counters("malformed", "truncated") == (malformed, 0)
    entry = wire.only_list
    is_data = payload[4] == 0
    assert (entry["diag"]["nSendCount"], entry["diag"]["nReceiveCount"]) == (int(is_data), 1)
    assert (len(entry["streams"]), entry["diag"]["nWriteCount"]) == (1 - malformed, 1 - malformed)
    assert entry["senders"] == ([A] if is_data else [])


def cut(frame: Frame, payload_bytes: int) -> Frame:
    return frame._replace(data=frame.data[: 42 + payload_bytes])


@pytest.mark.parametrize(
    ("payload", "captured", "codes", "malformed", "received"),
    [
        (telegram(), 21, {"NV107": 1}, 0, 1),
        (telegram(), 20, {"NV107": 1}, 0, 1),
        (telegram(), 19, {"NV107": 1}, 0, 0),
        (telegram(), 12, {"NV107": 1}, 0, 0),
        (telegram(length=3), 20, {"NV102": 1, "NV107": 1}, 1, 1),
        (telegram(7), 20, {"NV103": 1, "NV107": 1}, 1, 1),
        (telegram()[:19], 18, {"NV107": 1}, 0, 0),
    ],
)
def test_truncated(payload: bytes, captured: int, codes: dict[str, int], malformed: int, received: int) -> None:
    wire = Wire().send(0, A, ALL, payload)
    wire.frames[0] = cut(wire.frames[0], captured)
    assert wire.codes() == codes
    assert wire.counters("malformed", "truncated") == (malformed, 1)
    assert wire.only_list["diag"]["nReceiveCount"] == received
    assert wire.report["capture"]["telegrams"] == 1


def test_eleven_captured_bytes_are_no_telegram() -> None:
    report = reference_report([cut(data_frame(0, A, B, telegram()), 11)])
    assert report["capture"] | {"start_ns": None, "end_ns": None} == {
        "frames": 1,
        "telegrams": 0,
        "other_frames": 1,
        "drops": 0,
        "drops_by": {},
        "start_ns": None,
        "end_ns": None,
        "until_ns": None,
    }
    assert report["lists"] == []
