"""Requests and replies of which a capture lacks bytes: whether a report says that it is no picture of the whole."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap
from tests.program_here import run_text
from tests.tracker.visu.test_names import panel, told, writes

SNAP_BYTES = 100
"""Enough for all headers of TCP, and for none of a message."""


def conversation(client_port: int = 50_000, server: str = "10.0.0.5") -> list[Frame]:
    line = panel(server, client_port=client_port)
    for value in range(20):
        line.now += 10**9
        writes(line, "4,0,4,6", f"{value}.5")
    return line.frames


def snapped(frames: Sequence[Frame]) -> list[Frame]:
    return [one._replace(data=one.data[:SNAP_BYTES]) for one in frames]


def lacking(report: dict[str, Any]) -> list[str]:
    return [one["message"] for one in report["findings"] if one["code"] == "NV808"]


def test_a_snap_length_leaves_nothing_that_can_be_judged(tmp_path: Path) -> None:
    report = told(snapped(conversation()), tmp_path)
    (row,) = report["visu"]
    assert (row["writes"], row["replies"]) == (0, 0)
    assert row["cut"] > 0
    (message,) = lacking(report)
    assert message.startswith(f"The capture lacks bytes of {row['cut']} of {row['cut']} requests and replies")
    (cause,) = [one for one in report["causes"] if one["kind"] == "capture-incomplete"]
    assert cause["findings"][0]["code"] == "NV808"
    assert report["causes"] == [cause]


@pytest.mark.parametrize(("cut", "many"), [(1, False), (3, False), (4, True), (20, True)])
def test_it_is_told_where_one_of_ten_lacks_bytes(tmp_path: Path, cut: int, many: bool) -> None:
    frames = conversation()
    replies = [place for place, one in enumerate(frames) if b"|0|" in one.data[-4:]][:cut]
    gone = [one._replace(data=one.data[:-1]) if place in replies else one for place, one in enumerate(frames)]
    report = told(gone, tmp_path)
    assert report["visu"][0]["cut"] == cut
    assert bool(lacking(report)) is many


def test_several_conversations_are_one_cause(tmp_path: Path) -> None:
    frames = [*snapped(conversation()), *snapped(conversation(50_001, "10.0.0.6"))]
    report = told(frames, tmp_path)
    assert len(lacking(report)) == 2
    (cause,) = report["causes"]
    assert "between 2 pairs of client and controller" in cause["title"]


def test_a_rule_says_why_it_cannot_be_judged(tmp_path: Path) -> None:
    write_pcap(snapped(conversation()), tmp_path / "x.pcap")
    (tmp_path / "a.rules.toml").write_text('[[rule]]\nid = "a"\ncheck = "transaction"\nmax_unanswered = 0\n')
    done = run_text("check", tmp_path / "x.pcap", tmp_path / "a.rules.toml")
    assert "none of its requests is whole in the capture" in done.stdout
