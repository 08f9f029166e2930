"""Cycles that the capture's clock cuts in two, so that neither part has all telegrams."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from tests.causes.told import causes_of
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap

MS = 1_000_000
CUT_MS = 20_001
"""Between two telegrams of a cycle."""


def frames_by(moved_ms: int) -> list[Frame]:
    """Return the frames of three senders, by a clock that is moved by some time between two telegrams of a cycle."""
    sent = sorted(
        (at_ms * MS + subindex * 3 * MS + node * MS // 9, node, subindex, counter)
        for node in (1, 2, 3) for counter, at_ms in enumerate(range(0, 60_000, 50), 1) for subindex in (0, 1)
    )  # fmt: skip
    return [
        data_frame(
            ts_ns + (moved_ms * MS if ts_ns >= CUT_MS * MS else 0), f"10.0.0.{node}", "10.0.0.255",
            telegram(list_id=node, subindex=subindex, items=2, counter=counter + 900 * subindex),
        )
        for ts_ns, node, subindex, counter in sent
    ]  # fmt: skip


@pytest.mark.parametrize(("moved_ms", "codes"), [(9_000, {"NV501", "NV505"}), (-5_000, {"NV902"})])
def test_cycles_that_the_clock_cut_are_the_clocks(moved_ms: int, codes: set[str], tmp_path: Path) -> None:
    path = tmp_path / "frames.pcap"
    write_pcap(frames_by(moved_ms), path)
    _, causes = causes_of(Inquiry([str(path)]))
    assert [cause.kind.name for cause in causes] == ["clock"]
    assert codes <= {finding.code for finding in causes[0].findings}
