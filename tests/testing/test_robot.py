"""The library of Robot Framework, run by its own runner."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.check.test_verdicts import STEADY, ruled, sent

pytest.importorskip("robot")

ROBOT = [sys.executable, "-m", "robot", "--output", "NONE"]
SUITE = """*** Settings ***
Library    nvscope.testing.robot.Nvscope

*** Test Cases ***
Kept
    Open Capture           x.pcap
    List Should Keep       7    cycle    interval=100ms    exceptions=2%
    List Should Keep       7    gap    max=1
    Capture Should Keep    capture_quality    min_duration=5s
Broken
    Open Capture           x.pcap
    List Should Keep       7    loss    max=0.5%
Broken Rules
    Open Capture           x.pcap
    Rules Should Be Kept   x.rules.toml
"""


def test_keywords_have_the_words_of_rules(tmp_path: Path) -> None:
    sent(tmp_path, [one for one in STEADY if one != 50])
    ruled(tmp_path, 'check = "gap"', 'check = "restarts"')
    (tmp_path / "plant.robot").write_text(SUITE)
    done = subprocess.run(
        [*ROBOT, "--consolecolors", "off", "--consolewidth", "200", "plant.robot"], cwd=tmp_path, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done.stdout
    told = " ".join(done.stdout.split())
    assert "Kept | PASS |" in told
    assert "Broken | FAIL | loss (loss) is broken list 7, worst 1.0 %, limit 0.5 %, margin −100 %" in told
    assert "r0 (gap) is broken" in told
    assert "3 tests, 1 passed, 2 failed" in told


def test_without_a_capture_nothing_can_be_kept(tmp_path: Path) -> None:
    (tmp_path / "plant.robot").write_text(
        "*** Settings ***\nLibrary    nvscope.testing.robot.Nvscope\n\n"
        "*** Test Cases ***\nEmpty\n    List Should Keep    7    loss\n"
    )
    done = subprocess.run([*ROBOT, "plant.robot"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, "no capture is open: use Open Capture first" in done.stdout) == (1, True)
