"""What is named as a source on the command line."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.program import run_text

CAPTURES = Path(__file__).parent.parent.parent / "captures"
CAPTURE = CAPTURES / "telegrams.pcap"


def nvscope(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return run_text(*arguments, cwd=cwd)


@pytest.mark.parametrize("verb", ["report", "packets", "export", "vars"])
def test_definition_files_behind_one_gvl_option(verb: str, tmp_path: Path) -> None:
    for name in ("axis.gvl", "batch.gvl"):
        (tmp_path / name).write_bytes((CAPTURES / "peers" / name).read_bytes())
    done = nvscope(verb, str(CAPTURE), "--gvl", "axis.gvl", "batch.gvl", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "nvscope: batch.gvl: a definition file, no capture\n  write --gvl in front of each definition file\n"
    )


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("types.st", "// types\nTYPE a : INT; END_TYPE"),
        ("line.TcDUT", "?"),
        ("plant.txt", "\n(* @NESTEDCOMMENTS := 'Yes' *)"),
        ("export", "<?xml version='1.0'?><project/>"),
    ],
)
def test_definition_files_are_known_by_name_or_content(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    done = nvscope("report", name, cwd=tmp_path)
    assert done.returncode == 2
    assert f"{name}: a definition file, no capture" in done.stderr


def test_what_can_be_read_as_a_capture_is_one_whatever_its_name(tmp_path: Path) -> None:
    (tmp_path / "line.st").write_bytes(CAPTURE.read_bytes())
    done = nvscope("report", "line.st", cwd=tmp_path)
    assert "line.st (pcap" in done.stdout


def test_other_files_are_no_captures_but_no_definitions_either(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("Types of the press", encoding="utf-8")
    done = nvscope("report", "notes.txt", cwd=tmp_path)
    assert done.returncode == 4
    assert "notes.txt, offset 0: the bytes 54 79 70 65, expected a pcap" in done.stderr
