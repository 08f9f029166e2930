"""The same files give the same bytes: in whatever order a person names them, and whatever order sets have."""

from __future__ import annotations

from pathlib import Path
from shutil import copyfile
from tempfile import mkdtemp

import pytest

from nvscope.errors import ExitCode
from tests import once
from tests.once import made_once
from tests.program import run
from tests.schemas.corpus import ROOT

CAPTURES = ("captures/peers/peers.pcap", "captures/can/press.log", "captures/telegrams.pcap")
DEFINITIONS = (
    "captures/peers/axis.gvl", "captures/peers/axis_types.st", "captures/can/press.gvl",
    "tests/definition/samples/plant.exp", "rival.gvl",
)  # fmt: skip
NONE: tuple[str, ...] = ()
LINTED = 1

COMMANDS = {
    "report --json": (CAPTURES, DEFINITIONS),
    "report --compare --json": (CAPTURES, DEFINITIONS),
    "report -v": (CAPTURES, DEFINITIONS),
    "report --md": (CAPTURES, DEFINITIONS),
    "vars --json": (CAPTURES, DEFINITIONS),
    "vars --at 2s --json": (CAPTURES, DEFINITIONS),
    "vars --history * --all --json": (CAPTURES, DEFINITIONS),
    "vars --infer --json": (CAPTURES, NONE),
    "packets -T ndjson": (CAPTURES, DEFINITIONS),
    "packets -T csv": (CAPTURES, DEFINITIONS),
    "export -w -.ndjson --form long": (CAPTURES, DEFINITIONS),
    "keys --fields --json": (NONE, DEFINITIONS),
    "gvl layout --json": (NONE, DEFINITIONS),
    "gvl lint --json": (NONE, DEFINITIONS),
}


@made_once
def plant() -> Path:
    """Return a folder with all files; two of them define one list, and neither as the other does."""
    folder = Path(mkdtemp(dir=once.folder()))
    for name in (*CAPTURES, *DEFINITIONS[:-1]):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        copyfile(ROOT / name, folder / name)
    axis = (folder / DEFINITIONS[0]).read_text(encoding="utf-8")
    (folder / DEFINITIONS[-1]).write_text(axis.replace("bStart", "bBegin"), encoding="utf-8")
    return folder


@made_once
def written(seed: str, step: int) -> dict[str, bytes]:
    """Return what each command writes where sets have this order and files that one, as one server forks all of it."""
    told = {}
    for command, files in COMMANDS.items():
        verb, *words = command.split()
        captures, definitions = (names[::step] for names in files)
        named = definitions if verb == "gvl" else [word for file in definitions for word in ("--gvl", file)]
        done = run(verb, *words, *captures, *named, cwd=plant(), sets=seed)
        assert done.returncode in {ExitCode.GOOD, LINTED}, done.stderr.decode()
        told[command] = done.stdout
    return told


@pytest.mark.parametrize("command", COMMANDS)
def test_the_order_of_files_and_of_sets_changes_no_byte(command: str) -> None:
    assert written("1", 1)[command] == written("2", -1)[command] != b""
