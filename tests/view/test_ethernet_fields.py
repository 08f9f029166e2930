"""Hardware addresses and VLANs as tshark tells them, on captures of all link types."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.program_here import run_text

ROOT = Path(__file__).parents[2]
FIELDS = ("frame.number", "eth.src", "eth.dst", "vlan.id", "ieee8021ad.id")
NAMES = [word for name in FIELDS for word in ("-e", name)]


def written(scenario: str, path: Path) -> Path:
    capture = path / f"{scenario}.pcap"
    done = run_text("simulate", ROOT / "tests" / "scenarios" / f"{scenario}.toml", "-w", capture)
    assert done.returncode == 0
    return capture


def shown(capture: Path, *more: str) -> list[list[str]]:
    done = run_text("packets", capture, "-T", "fields", *NAMES, *more)
    assert done.returncode == 0, done.stderr
    return [line.split("\t") for line in done.stdout.splitlines()]


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
@pytest.mark.parametrize("scenario", ["vlan", "loss", "second-sender", "link-sll", "link-raw", "snap-length"])
def test_the_fields_are_those_of_tshark(scenario: str, tmp_path: Path) -> None:
    capture = written(scenario, tmp_path)
    done = subprocess.run(
        ["tshark", "-n", "-r", capture, "-T", "fields", *NAMES], capture_output=True, text=True, check=True
    )
    told = {line.split("\t")[0]: line.split("\t") for line in done.stdout.splitlines()}
    ours = shown(capture)
    assert len(ours) > 50
    for row in ours:
        assert row == told[row[0]]


def test_they_can_be_filtered_by(tmp_path: Path) -> None:
    capture = written("vlan", tmp_path)
    rows = shown(capture)
    tagged = [row for row in rows if row[3]]
    assert tagged
    vlan, source = tagged[0][3].split(",")[-1], tagged[0][1]
    assert shown(capture, "-Y", f"vlan.id == {vlan} && eth.src == {source}") == [
        row for row in rows if vlan in row[3].split(",") and row[1] == source
    ]
    assert shown(capture, "-Y", f"eth.src[0:3] == {source[:8]} && !vlan.id") == [
        row for row in rows if row[1].startswith(source[:8]) and not row[3]
    ]
    report = run_text("report", capture, "-Y", f"eth.src == {source}")
    assert report.returncode == 0


def test_frames_without_such_a_header_have_none(tmp_path: Path) -> None:
    for scenario in ("link-raw", "link-sll", "link-null"):
        assert {tuple(row[1:]) for row in shown(written(scenario, tmp_path))} == {("", "", "", "")}
    press = run_text("packets", ROOT / "captures" / "can" / "press.log", "-T", "json", *NAMES, "-c", "1").stdout
    assert '"eth.src":null,"eth.dst":null,"vlan.id":null' in press
