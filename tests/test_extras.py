"""What must work without the packages of the extras, in processes in which these do not exist."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from nvscope.extras import EXTRAS

ROOT = Path(__file__).parents[1]
PEERS = str(ROOT / "captures/peers/peers.pcap")
AXIS = ["--gvl", str(ROOT / "captures/peers/axis.gvl"), "--gvl", str(ROOT / "captures/peers/axis_types.st")]

FINDER = """
import importlib.machinery
hidden = {packages}
found = importlib.machinery.PathFinder.find_spec

class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        return None if name.partition(".")[0] in hidden else found(name, path, target)

import sys
sys.meta_path[sys.meta_path.index(importlib.machinery.PathFinder)] = Finder
"""


def without(packages: set[str], tmp_path: Path, code: str) -> subprocess.CompletedProcess[str]:
    """Run Python code where the finder of installed packages does not find these."""
    script = FINDER.format(packages=packages) + code
    return subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True, text=True, cwd=tmp_path, check=False, encoding="utf-8",
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip


def nvscope_without(packages: set[str], tmp_path: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    code = f"\nsys.argv = ['nvscope', *{arguments!r}]\nfrom nvscope.cli.start import main\nmain()\n"
    return without(packages, tmp_path, code)


@pytest.mark.parametrize(
    "arguments",
    [
        ["report", PEERS, *AXIS],
        ["report", PEERS, "--json"],
        ["packets", PEERS, "-T", "json"],
        ["packets", PEERS, *AXIS, "-e", "var.stAxis.pos"],
        ["vars", PEERS, *AXIS],
        ["vars", PEERS, *AXIS, "--history", "stAxis.pos"],
        ["vars", PEERS, "--infer"],
        ["gvl", "layout", AXIS[1], AXIS[3]],
        ["gvl", "lint", AXIS[1], AXIS[3]],
        ["keys", "--fields"],
        ["explain", "NV201"],
    ],
    ids=" ".join,
)
def test_other_verbs_do_without_any_extra(arguments: list[str], tmp_path: Path) -> None:
    ended = nvscope_without(set(EXTRAS), tmp_path, *arguments)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout


@pytest.mark.parametrize("packages", [("polars",), ("pyarrow",), ("polars", "pyarrow")], ids="+".join)
def test_export_says_what_to_install_and_writes_nothing(packages: tuple[str, ...], tmp_path: Path) -> None:
    for ending in ("csv", "ndjson", "parquet"):
        ended = nvscope_without(set(packages), tmp_path, "export", PEERS, *AXIS, "-w", f"axis.{ending}")
        assert ended.returncode == 2
        assert ended.stderr == (
            f"nvscope: export needs {' and '.join(sorted(packages))}, which "
            f"{'is' if len(packages) == 1 else 'are'} not installed\n"
            f'  install {"it" if len(packages) == 1 else "them"}: pip install "nvscope[export]"\n'
        )
    assert not list(tmp_path.iterdir())


def test_a_notebook_says_what_to_install(tmp_path: Path) -> None:
    ended = without({"polars"}, tmp_path, f"\nimport nvscope\nnvscope.open({PEERS!r})\n")
    assert ended.stderr.splitlines()[-2:] == [
        "nvscope.errors.UsageError: data frames need polars, which is not installed",
        '  install it: pip install "nvscope[export]"',
    ]


def test_an_mdf_log_says_what_to_install(tmp_path: Path) -> None:
    log = tmp_path / "a.mf4"
    log.write_bytes(b"MDF     4.10    nvscope " + bytes(4072))
    ended = nvscope_without({"asammdf"}, tmp_path, "report", "a.mf4")
    assert ended.returncode == 4
    assert (
        "a.mf4: reading an MDF 4 log needs asammdf, which is not installed\n  install it: pip install" in ended.stderr
    )


def test_extras_install_what_is_said() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    names = {
        extra: {re.match(r"[\w.-]+", line)[0] for line in lines}  # type: ignore[index]
        for extra, lines in project["optional-dependencies"].items()
    }
    required = {re.match(r"[\w.-]+", line)[0] for line in project["dependencies"]}  # type: ignore[index]
    for package, extra in EXTRAS.items():
        assert package in names[extra]
        assert package not in required
    assert EXTRAS.keys() == set().union(*(names[extra] for extra in set(EXTRAS.values())))
