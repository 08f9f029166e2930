"""What is made once for all processes that run tests."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

_ASKS = """
import os, sys, tempfile
tempfile.tempdir = sys.argv[1]
from tests import once

@once.made_once
def made(what):
    with open(os.path.join(sys.argv[1], "calls"), "a") as calls:
        calls.write(what)
    return {"what": what, "where": str(once.folder())}

print(made("a"), made("a"), made("b"))
"""


def ask(folder: Path, run: str | None) -> str:
    environment = {"PATH": "", **({} if run is None else {"PYTEST_XDIST_TESTRUNUID": run})}
    words = [sys.executable, "-c", _ASKS, str(folder)]
    root = Path(__file__).parents[1]
    return subprocess.run(words, env=environment, cwd=root, capture_output=True, text=True, check=True).stdout


def test_a_second_process_of_a_run_takes_over_what_the_first_has_made(tmp_path: Path) -> None:
    first, second = ask(tmp_path, "one"), ask(tmp_path, "one")
    assert first == second != ""
    assert (tmp_path / "calls").read_text() == "ab"
    ask(tmp_path, "two")
    assert (tmp_path / "calls").read_text() == "abab"


def test_a_process_alone_makes_its_own_and_leaves_nothing(tmp_path: Path) -> None:
    ask(tmp_path, None)
    assert [one.name for one in tmp_path.iterdir()] == ["calls"]
