"""Options with nothing behind them, and patterns that no file has: each is a sentence that says so."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from nvscope.errors import ExitCode
from tests.program_here import run_text

ROOT = Path(__file__).parents[2]


@pytest.fixture
def place(tmp_path: Path) -> Path:
    for name in ("peers.pcap", "batch.gvl"):
        shutil.copy(ROOT / "captures" / "peers" / name, tmp_path)
    shutil.copy(ROOT / "tests" / "scenarios" / "can-late.toml", tmp_path / "late.toml")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["report", "peers.pcap", "--bitrate", ""], "--bitrate: a bit rate is missing"),
        (["report", "peers.pcap", "--bitrate", "250k,"], "--bitrate 250k,: a bit rate is missing"),
        (["report", "peers.pcap", "--bitrate", "can0@"], "--bitrate can0@: a bit rate is missing"),
        (["report", "peers.pcap", "--bitrate", "@250k"], "--bitrate @250k: no channel stands in front of @"),
        (["report", "peers.pcap", "--project", ""], "the name of a project file is empty"),
        (["vars", "peers.pcap", "--infer", "-w", ""], "the name of a file to write is empty"),
        (["vars", "peers.pcap", "--infer", "-w", "."], ".: no name of a file"),
        (["vars", "peers.pcap", "--infer", "-w", ".."], "..: no name of a file"),
        (["simulate", "late.toml", "-w", ""], "the name of a file to write is empty"),
        (["simulate", "late.toml", "-w", "x.log", "--truth", ""], "the name of a file to write is empty"),
        (["simulate", "late.toml", "-w", "x.log", "--gvl", ""], "the name of a file to write is empty"),
    ],
)
def test_nothing_is_no_name(words: list[str], told: str, place: Path) -> None:
    before = sorted(os.listdir(place))
    done = run_text(*words, cwd=place)
    assert (done.returncode, done.stderr.splitlines()[-2]) == (ExitCode.USAGE, f"nvscope: {told}")
    assert sorted(os.listdir(place)) == before


@pytest.mark.parametrize("words", ["report PATTERN", "report -r PATTERN", "vars --infer -r PATTERN"])
def test_captures_may_be_patterns(words: str, place: Path) -> None:
    """Shells of Windows do not expand them, and those of others not what is in quotes."""
    done = run_text(*words.replace("PATTERN", "p*.pcap").split(), cwd=place)
    assert (done.returncode, done.stdout) == (
        0,
        run_text(*words.replace("PATTERN", "peers.pcap").split(), cwd=place).stdout,
    )
    done = run_text(*words.replace("PATTERN", "q*.pcap").split(), cwd=place)
    assert (done.returncode, done.stdout) == (ExitCode.UNREADABLE, "")
    assert done.stderr.startswith("nvscope: q*.pcap: no file matches this pattern\n")


def test_a_name_with_marks_of_a_pattern_is_a_name(place: Path) -> None:
    (place / "day[1].pcap").hardlink_to(place / "peers.pcap")
    assert "day[1].pcap" in run_text("report", "day[1].pcap", cwd=place).stdout
