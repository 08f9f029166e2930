"""The plugin of pytest, as a team's tests use it: its fixture, and files of rules as tests."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from nvscope.errors import UsageError
from nvscope.testing.assertions import under_test
from tests.check.plants import captured, definitions
from tests.check.test_verdicts import PLANT, STEADY, sent

LOSSY = [one for one in STEADY if one != 50]


def run_pytest(folder: Path, *options: str, files: dict[str, str]) -> tuple[int, str]:
    """Run pytest on files in a folder of their own; return its exit code and what it told."""
    for name, text in files.items():
        (folder / name).write_text(text)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-p", "no:xdist", *options], cwd=folder,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def test_a_test_asserts_what_a_list_keeps(tmp_path: Path) -> None:
    sent(tmp_path, LOSSY)
    text = """
def test_kept(nvcapture):
    plant = nvcapture("x.pcap")
    plant.assert_list(
        7, loss="1%", gap=1, restarts=True, malformed={"max": 0}, cycle={"interval": "100ms", "exceptions": "2%"},
    )

def test_broken(nvcapture):
    nvcapture("x.pcap").assert_list(7, loss="0.5%", gap=0)

def test_nothing_is_there(nvcapture):
    nvcapture("x.pcap").assert_list(99, loss="1%")
"""
    code, told = run_pytest(tmp_path, files={"test_plant.py": text})
    assert code == 1
    assert "2 failed, 1 passed" in told
    assert "AssertionError: loss (loss) is broken" in told
    assert "list 7, worst 1.0 %, limit 0.5 %, margin −100 %, first at 4.9 s, frame 50" in told
    assert "nvscope packets x.pcap -Y 'frame.number >= 46 && frame.number <= 54'" in told
    assert "gap (gap) is broken" in told
    assert "loss (loss) could not be decided" in told
    assert "no list is called 99" in told


RULES = """
[[rule]]
id = "complete"
check = "loss"
description = "the drives stop"

[[rule]]
id = "not-complete"
check = "loss"
severity = "warning"

[[rule]]
id = "no-restart"
check = "restarts"

[[rule]]
id = "who-knows"
check = "loss"
list = 99
"""


def test_files_of_rules_are_tests_where_captures_are_told(tmp_path: Path) -> None:
    sent(tmp_path, LOSSY)
    code, told = run_pytest(tmp_path, "-v", files={"plant.rules.toml": RULES})
    assert (code, "no tests ran" in told) == (5, True)
    code, told = run_pytest(tmp_path, "-v", "--nvcapture", "x.pcap", files={})
    assert code == 1
    outcomes = {line.split()[0]: line.split()[1] for line in told.splitlines() if line.endswith("%]")}
    assert outcomes == {
        "plant.rules.toml::complete": "FAILED",
        "plant.rules.toml::not-complete": "PASSED",
        "plant.rules.toml::no-restart": "PASSED",
        "plant.rules.toml::who-knows": "FAILED",
    }
    assert "complete (loss) is broken\n  list 7, worst 1.0 %" in told
    assert "the drives stop" in told
    assert "PytestWarning: not-complete (loss) is broken" in told
    assert "who-knows (loss) could not be decided" in told
    code, told = run_pytest(tmp_path, "-m", "not nvrules", "--nvcapture", "x.pcap", files={})
    assert "4 deselected" in told


def test_captures_stand_in_the_configuration(tmp_path: Path) -> None:
    (tmp_path / "captures").mkdir()
    sent(tmp_path / "captures", STEADY)
    ini = "[pytest]\nnvscope_captures = captures/*.pcap\n"
    code, told = run_pytest(
        tmp_path, files={"pytest.ini": ini, "plant.rules.toml": '[[rule]]\nid = "a"\ncheck = "loss"\n'}
    )
    assert (code, "1 passed" in told) == (0, True), told
    test = "def test(nvcapture):\n    nvcapture.assert_list(7, present=True)\n"
    code, told = run_pytest(tmp_path, "test_x.py", files={"test_x.py": test})
    assert code == 0, told


def test_mistakes_in_rules_are_errors_with_their_places(tmp_path: Path) -> None:
    sent(tmp_path, STEADY)
    rules = '[[rule]]\nid = "a"\ncheck = "los"\n\n[[rule]]\ncheck = "gap"\n'
    code, told = run_pytest(tmp_path, "--nvcapture", "x.pcap", files={"plant.rules.toml": rules})
    assert code == 2
    assert "line 3, column 1: rule[0].check: 'los' is none of the choices" in told
    assert "line 5, column 3: rule[1]: the key 'id' is missing" in told
    assert "Traceback" not in told


def test_a_capture_that_is_none_is_told_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "x.pcap").write_text("nothing")
    rules = '[[rule]]\nid = "a"\ncheck = "gap"\n'
    code, told = run_pytest(tmp_path, "--nvcapture", "x.pcap", files={"plant.rules.toml": rules})
    assert code == 1
    assert "nvscope: x.pcap" in told
    assert "Traceback" not in told


def test_what_is_asserted_can_be_about_variables(tmp_path: Path) -> None:
    capture = captured(tmp_path, [(number * 100, 8, [False, float(number)]) for number in range(30)])
    plant = under_test(capture, definitions(tmp_path))
    plant.assert_that("range", variable="fPos", min=0, max=29)
    with pytest.raises(AssertionError, match=r"range \(range\) is broken\n  list 8 valve, fPos, worst 29"):
        plant.assert_that("range", variable="fPos", max=28)
    with pytest.raises(AssertionError, match="frozen-2"):
        plant.assert_all([{"check": "frozen", "variable": "fPos", "max": "1s"}] * 1
                         + [{"check": "frozen", "variable": "bClosed", "max": "1s"}])  # fmt: skip


@pytest.mark.parametrize(
    ("checks", "what"),
    [
        ({"los": True}, "no check is called 'los'"),
        ({"loss": {"min": 3}}, "unknown key 'min'"),
        ({"loss": "x"}, "a share in percent is expected"),
        ({"occurrence": "1s"}, "an occurrence needs min, max, or both"),
        ({"silence": True}, "the key 'max' is missing"),
    ],
)
def test_what_is_called_otherwise_is_an_error(checks: dict[str, object], what: str) -> None:
    with pytest.raises((UsageError, AssertionError), match=what):
        under_test(PLANT).assert_list(7, **checks)
