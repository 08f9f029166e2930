"""Telegrams that overtake each other, and what looks like it: loss, and what is lost beside."""

from __future__ import annotations

from pathlib import Path

from nvscope.causes.cause import Cause
from tests.causes.plants import causes_in, frames_of, from_hardware
from tests.oracle.frame import Frame

PLANT = """
title = "a ring"
duration = "40s"

[[node]]
name = "press"
address = "10.0.0.1"
[[node]]
name = "saw"
address = "10.0.0.2"

[[list]]
name = "axis"
index = 1
sender = "press"
bytes = [88]
interval = "100ms"
[[list]]
name = "recipe"
index = 2
sender = "press"
bytes = [40]
interval = "100ms"
phase = "30ms"
[[list]]
name = "blade"
index = 3
sender = "saw"
bytes = [40]
interval = "100ms"
"""
OVERTAKEN = '[[overtaken]]\nlist = "{}"\ntelegrams = [{}]\nby = {}\n'


def told(causes: list[Cause]) -> list[tuple[str, str]]:
    return [(cause.kind.name, cause.title) for cause in causes]


def by_a_longer_way(frames: list[Frame]) -> list[Frame]:
    """Return frames of which each tenth of the press came through another device."""
    return [
        from_hardware(frame, "02:00:00:00:00:cc") if frame.data[26:30] == b"\n\0\0\1" and number % 10 == 0 else frame
        for number, frame in enumerate(frames)
    ]


def test_one_cause_says_how_far_and_by_which_ways(tmp_path: Path) -> None:
    frames = frames_of(PLANT + OVERTAKEN.format("axis", "100, 150, 200", 3) + OVERTAKEN.format("recipe", "120, 170", 1))
    (cause,) = causes_in(by_a_longer_way(frames), tmp_path)
    assert cause.kind.name == "two-paths"
    assert cause.title == "Telegrams of lists 1 and 2 of 10.0.0.1 overtook each other, 5 times from 10.0 s to 20.3 s"
    assert cause.checked[0] == "up to 3 later telegrams came before"
    assert cause.checked[1].startswith("it came with different hardware addresses 02:00:")
    assert cause.checked[1].endswith("02:00:00:00:00:cc; times to live 64 and 63")
    assert {finding.code for finding in cause.findings} >= {"NV203"}


def test_by_one_way_it_says_so(tmp_path: Path) -> None:
    (cause,) = causes_in(frames_of(PLANT + OVERTAKEN.format("axis", "100", 4)), tmp_path)
    assert cause.title == "Telegrams of list 1 of 10.0.0.1 overtook each other, at 10.0 s"
    assert cause.checked == (
        "4 later telegrams came before", "all of it came from one hardware address, equally far",
    )  # fmt: skip


def test_what_is_lost_beside_is_not_what_was_filled(tmp_path: Path) -> None:
    lost = '[[loss]]\nlist = "axis"\ntelegrams = [300]\nrun = 2\n'
    causes = causes_in(frames_of(PLANT + lost + OVERTAKEN.format("axis", "100, 130, 160", 3)), tmp_path)
    assert sorted(kind for kind, _ in told(causes)) == ["loss-of-list", "two-paths"]
    (loss,) = (cause for cause in causes if cause.kind.name == "loss-of-list")
    assert loss.title == "List 1 of 10.0.0.1 lost 2 telegrams, at 29.9 s"
    assert loss.count == 1
