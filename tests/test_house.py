"""The house rules that a program can check: style, types, and which floor may import which."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

CHECKS = {
    "style": ["ruff", "check", "."],
    "format": ["ruff", "format", "--check", "."],
    "types": ["mypy", "--num-workers", "2"],
    "floors": ["lint-imports"],
}


@pytest.mark.long
@pytest.mark.parametrize("check", CHECKS)
def test_house_rule(check: str) -> None:
    program, *arguments = CHECKS[check]
    found = shutil.which(program, path=str(Path(sys.executable).parent))
    assert found, f"{program} is missing; install the project with its [test] extra"
    # Of what is as it was, mypy says what it said of it in another copy of the repository.
    kept = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "nvscope-tests" / "mypy"
    environment = {"MYPY_CACHE_DIR": str(kept), **os.environ}
    done = subprocess.run(
        [found, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def test_top_level_has_the_promised_entries_only() -> None:
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if tracked.returncode != 0:
        pytest.skip("not a git checkout")
    entries = {Path(name).parts[0] for name in tracked.stdout.splitlines()}
    visible = {entry for entry in entries if not entry.startswith(".")}
    assert visible == {
        "pyproject.toml", "nvscope", "dissectors", "tests", "captures", "README.md", "LICENSE", "CHANGELOG.md",
    }  # fmt: skip


MOST_LINES = 400


def test_no_file_is_long() -> None:
    files = [path for room in ("nvscope", "dissectors", "tests") for path in (ROOT / room).rglob("*.py")]
    lengths = {str(path.relative_to(ROOT)): len(path.read_text("utf-8").splitlines()) for path in files}
    assert lengths
    assert not {name for name, lines in lengths.items() if lines > MOST_LINES}


def test_the_oracle_knows_nothing_of_the_program() -> None:
    """What is written a second time tells something only if it is not the first once more."""
    libraries = {*sys.stdlib_module_names, "pytest"}
    paths = sorted((ROOT / "tests" / "oracle").rglob("*.py"))
    assert len(paths) > 10
    for path in paths:
        nodes = list(ast.walk(ast.parse(path.read_text("utf-8"))))
        names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
        names += [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
        own = [name for name in names if f"{name}.".startswith("tests.oracle.")]
        assert not {name.split(".")[0] for name in names if name not in own} - libraries, path
