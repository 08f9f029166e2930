"""A clock that is set forward, and what looks like it: loss, one sender, lists of one node, restarts."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.causes.plants import causes_in, frames_of

NODES = """
title = "three controllers"
duration = "40s"

[[node]]
name = "press"
address = "10.0.0.1"
[[node]]
name = "saw"
address = "10.0.0.2"
[[node]]
name = "hmi"
address = "10.0.0.50"

[[list]]
name = "axis"
index = 1
sender = "press"
bytes = [88]
interval = "50ms"
jitter = "2ms"
[[list]]
name = "recipe"
index = 2
sender = "press"
bytes = [256, 40]
interval = "400ms"
"""
SAW = """
[[list]]
name = "blade"
index = 3
sender = "saw"
bytes = [40]
interval = "100ms"
[[list]]
name = "slow"
index = 4
sender = "saw"
bytes = [40]
interval = "5s"
"""
READ = 'acknowledge = true\ndestination = "hmi"\n[[reader]]\nnode = "hmi"\nlist = "slow"\ndelay = "2ms"\n'
SEEN = '[[traffic]]\nkind = "arp"\nnode = "hmi"\nto = "saw"\ninterval = "700ms"\n'
FORWARD = '[[clock_step]]\nat = "15s"\nby = "{}"\n'
LISTS = ("axis", "recipe", "blade", "slow")


def held_up(*lists: str, by: str = "2s") -> str:
    return "".join(f'[[pause]]\nlist = "{name}"\nat = "15s"\nby = "{by}"\n' for name in lists)


def lost(*lists: str) -> str:
    return "".join(f'[[loss]]\nlist = "{name}"\nfrom = "15s"\nuntil = "17s"\n' for name in lists)


@pytest.mark.parametrize("by", ["600ms", "2s", "7s"])
def test_a_clock_that_is_set_forward(by: str, tmp_path: Path) -> None:
    (cause,) = causes_in(frames_of(NODES + SAW + READ + FORWARD.format(by)), tmp_path)
    assert cause.kind.name == "clock"
    assert cause.title.startswith("The clock of the capture went forward by ")
    assert cause.title.endswith(" at 15.0 s, or the capture stood still")
    assert cause.until_ns is not None
    assert cause.since_ns is not None


def test_other_frames_go_on_meanwhile(tmp_path: Path) -> None:
    causes = causes_in(frames_of(NODES + SAW + SEEN + held_up(*LISTS)), tmp_path)
    assert "clock" not in {cause.kind.name for cause in causes}


def test_what_was_lost_was_sent(tmp_path: Path) -> None:
    causes = causes_in(frames_of(NODES + SAW + lost(*LISTS)), tmp_path)
    assert "clock" not in {cause.kind.name for cause in causes}


def test_one_sender_alone_is_late(tmp_path: Path) -> None:
    causes = causes_in(frames_of(NODES + FORWARD.format("600ms")), tmp_path)
    assert "clock" not in {cause.kind.name for cause in causes}


def test_a_node_beside_another_that_goes_on(tmp_path: Path) -> None:
    causes = causes_in(frames_of(NODES + SAW + held_up("axis", "recipe")), tmp_path)
    assert "clock" not in {cause.kind.name for cause in causes}


def test_two_nodes_that_start_anew_together(tmp_path: Path) -> None:
    restart = "".join(f'[[restart]]\nnode = "{node}"\nat = "15s"\noutage = "3s"\n' for node in ("press", "saw"))
    causes = causes_in(frames_of(NODES + SAW + restart), tmp_path)
    assert sorted(cause.kind.name for cause in causes) == ["node-restart", "node-restart"]
