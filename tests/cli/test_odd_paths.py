"""Names that are empty, too long or too deep, and directories that cannot be read: a sentence for each."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from nvscope.definition.load import load_definitions, read_definitions
from nvscope.definition.wanted_files import files_below, wanted_files
from nvscope.errors import ConfigurationError
from tests.cli.test_vars import PEERS, nvscope

CAPTURE, LIST = str(PEERS / "peers.pcap"), str(PEERS / "batch.gvl")
LONG = "x" * 300
STARS = "*/" * 200


@pytest.fixture
def deep(tmp_path: Path) -> Iterator[Path]:
    """Yield a directory in which others lie so deep in one another that calls cannot follow; a list is at the top."""
    folder = tmp_path / "deep"
    folder.mkdir()
    (folder / "a.st").write_text("VAR_GLOBAL a : INT; END_VAR", encoding="utf-8")
    here = os.open(folder, os.O_RDONLY)
    for _ in range(1_400):
        os.mkdir("d", dir_fd=here)
        below = os.open("d", os.O_RDONLY, dir_fd=here)
        os.close(here)
        here = below
    os.close(here)
    yield folder
    subprocess.run(["rm", "-rf", str(folder)], check=True)  # what Python removes trees with cannot go so deep


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("report", CAPTURE, "--project", ""), "the name of a project file is empty"),
        (("vars", CAPTURE, "--gvl", LIST, "--project", " "), "the name of a project file is empty"),
        (("explain", ""), "the name of what to explain is empty"),
        (("packets", CAPTURE, "-e", ""), "the name of a field is empty"),
        (("vars", ""), "the name of a source is empty"),
        (("report", CAPTURE, "--gvl", ""), "the name of a definition file is empty"),
        (("report", CAPTURE, "--gvl", STARS), "cannot be followed: it has too many parts, or "),
        (("report", CAPTURE, "--gvl", "**/" * 300), "cannot be followed: it has too many parts, or "),
        (("vars", CAPTURE, "--gvl", "**/" * 300 + "*.gvl"), "cannot be followed: it has too many parts, or "),
        (("gvl", "lint", STARS), "cannot be followed: it has too many parts, or "),
        (("report", CAPTURE, "--gvl", LONG), f"{LONG[:200]}: cannot be read: File name too long"),
        (("report", CAPTURE, "--gvl", f"{LONG}/*.gvl"), f"{LONG[:200]}: cannot be read: File name too long"),
    ],
)
def test_a_name_that_cannot_be_is_a_usage_error(words: tuple[str, ...], said: str) -> None:
    done = nvscope(*words)
    assert done.returncode == 2
    assert f"{said}" in done.stderr
    assert "Errno" not in done.stderr
    assert done.stderr.startswith("nvscope: ")


def test_a_source_of_too_many_parts_is_a_file_that_is_not_there() -> None:
    done = nvscope("report", "*/" * 1_500)
    assert done.returncode == 4
    assert done.stderr.startswith("nvscope: */*/")


@pytest.mark.skipif(not hasattr(os, "O_DIRECTORY"), reason="paths are not so long there")
def test_directories_may_lie_as_deep_as_they_like(deep: Path) -> None:
    assert list(files_below(deep)) == [str(deep / "a.st")]
    assert [entry.name for entry in load_definitions([str(deep)]).lists] == ["a"]
    for words in (("--gvl", str(deep)), (str(deep),)):
        assert nvscope("vars", CAPTURE, *words).returncode == 0
    done = nvscope("vars", CAPTURE, "--gvl", f"{deep}/**/*.st")
    assert done.returncode == 2
    assert "directories lie too deep in one another" in done.stderr


def refuse(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let nobody read a directory: whoever is root may read all, so the answer of the system is made."""
    scandir, opened = os.scandir, Path.open

    def refused(wanted: str | Path) -> None:
        if Path(wanted) == path:
            raise PermissionError(13, "Permission denied", str(wanted))

    def refusing_scan(wanted: str | Path) -> object:
        refused(wanted)
        return scandir(wanted)

    def refusing_open(wanted: Path, *words: Any, **more: Any) -> object:
        refused(wanted)
        return opened(wanted, *words, **more)

    monkeypatch.setattr("os.scandir", refusing_scan)
    monkeypatch.setattr(Path, "open", refusing_open)


def test_a_directory_below_that_cannot_be_read_is_told_and_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "a.gvl").write_bytes(Path(LIST).read_bytes())
    refuse(tmp_path / "sub", monkeypatch)
    read = read_definitions(wanted_files([str(tmp_path)]))
    assert list(read.files) == [str(tmp_path / "a.gvl")]
    (problem,) = read.left_out
    assert (problem.what, problem.position.file) == ("cannot be read: Permission denied", str(tmp_path / "sub"))


def test_a_directory_that_cannot_be_read_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.gvl").write_bytes(Path(LIST).read_bytes())
    refused = str(tmp_path)
    refuse(tmp_path, monkeypatch)
    for given in (str(tmp_path), f"{tmp_path}/*.gvl"):
        with pytest.raises(ConfigurationError, match="cannot be read: Permission denied") as caught:
            wanted_files([given])
        assert (caught.value.where, caught.value.what) == (refused, "cannot be read: Permission denied")
