"""Two devices that send one identifier of CAN with frames of different lengths, and what looks like it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.causes.cause import Cause
from nvscope.definition.project import Project
from tests.causes.told import causes_of

Sent = tuple[int, int]
"""When in ms, and how many bytes."""


def told(frames: Sequence[Sent], directory: Path) -> list[Cause]:
    path = directory / "bus.log"
    lines = (
        f"({1_700_000_000 + ms // 1000}.{ms % 1000:03}000) can0 110#{number % 256:02X}{'00' * (size - 1)}"
        for number, (ms, size) in enumerate(sorted(frames))
    )
    path.write_text("\n".join(lines) + "\n")
    return causes_of(Inquiry([str(path)], Project()))[1]


def sent(size: int, every_ms: int, since_ms: int = 0, until_ms: int = 40_000) -> list[Sent]:
    return [(ms, size) for ms in range(since_ms, until_ms, every_ms)]


@pytest.mark.parametrize(("own_ms", "other_ms"), [(100, 250), (250, 100), (100, 103)])
def test_two_devices_send_one_identifier(own_ms: int, other_ms: int, tmp_path: Path) -> None:
    causes = told([*sent(8, own_ms), *sent(4, other_ms, 10_007)], tmp_path)
    (cause,) = (one for one in causes if one.kind.name == "identifier-collision")
    assert cause.title == "Two devices send identifier 0x110 of can0 since 10.0 s"
    assert cause.checked[0] == "frames of 8 and, since then, of 4 bytes take turns"
    assert cause.until_ns is None
    assert cause.channel == "can0"
    assert "NV603" in {finding.code for finding in cause.findings}


def test_a_pause_of_the_bus_does_not_hide_that_two_take_turns(tmp_path: Path) -> None:
    frames = [*sent(8, 100), *sent(4, 100, 10_050)]
    causes = told([(ms, size) for ms, size in frames if not 11_500 < ms < 13_000], tmp_path)
    assert "identifier-collision" in {one.kind.name for one in causes}


@pytest.mark.parametrize(
    "frames",
    [
        [*sent(8, 100, 0, 20_000), *sent(4, 100, 20_000)],  # a download
        [*sent(8, 100), (3_050, 4), (4_150, 4), (19_050, 4), (33_050, 4)],  # single faults
        [*sent(8, 100), *((ms, 4) for ms in (3_050, 4_150, 9_050, 19_050, 20_050, 33_050, 33_250))],
        [(ms, 2 + ms * 7 % 5) for ms in range(0, 40_000, 101)],  # frames of no fixed length
        [*sent(8, 100, 0, 9_000), *sent(4, 100, 9_000, 18_000), *sent(8, 100, 18_000, 27_000), *sent(4, 100, 27_000)],
    ],
)
def test_other_changes_of_length_are_no_second_device(frames: Sequence[Sent], tmp_path: Path) -> None:
    assert "identifier-collision" not in {cause.kind.name for cause in told(frames, tmp_path)}
