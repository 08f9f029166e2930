"""No command takes anything away from a user: not its inputs, not what exists and was not meant."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from nvscope.errors import CaptureError, UsageError
from nvscope.whole_files import Existing, WholeFiles
from tests.program import run_text

ROOT = Path(__file__).parents[1]
PEERS = ROOT / "captures" / "peers"
SCENARIO = ROOT / "tests" / "scenarios" / "can-late.toml"


def content(path: Path) -> dict[str, bytes]:
    """Return the files below a directory, with what is in them."""
    return {str(file.relative_to(path)): file.read_bytes() for file in sorted(path.rglob("*")) if file.is_file()}


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    """A directory with a capture, definitions, a scenario, and names that lead to them in other ways."""
    for name in ("peers.pcap", "batch.gvl"):
        shutil.copy(PEERS / name, tmp_path / name)
    shutil.copy(SCENARIO, tmp_path / "late.toml")
    (tmp_path / "nvscope.toml").write_text('definitions = "batch.gvl"\n')
    (tmp_path / "link.csv").symlink_to("peers.pcap")
    (tmp_path / "hard.csv").hardlink_to(tmp_path / "peers.pcap")
    (tmp_path / "gvl.csv").symlink_to("batch.gvl")
    (tmp_path / "toml.csv").symlink_to("nvscope.toml")
    (tmp_path / "days").mkdir()
    shutil.copy(PEERS / "peers.pcap", tmp_path / "days" / "monday.csv")
    (tmp_path / "late.pcap").symlink_to("late.toml")
    return tmp_path


ONTO_INPUTS = [
    "export peers.pcap -w link.csv",
    "export peers.pcap -w hard.csv",
    "export peers.pcap --gvl batch.gvl -w gvl.csv",
    "export peers.pcap -w gvl.csv",
    "export peers.pcap -w toml.csv",
    "export peers.pcap link.csv -w hard.csv --force",
    "export peers.pcap -w ./days/../link.csv",
    "export days -w days/monday.csv",
    "export peers.pcap --what telegrams -w hard.csv",
    "vars peers.pcap --infer -w peers.pcap --list 1",
    "vars peers.pcap --infer -w peers.pcap --list 1 --force",
    "vars peers.pcap --infer -w nvscope.toml --list 1 --force",
    "vars peers.pcap --infer -w batch.gvl --list 1 --force",
    "simulate late.toml -w late.pcap --force",
    "simulate late.toml -w x.pcap --truth late.toml --force",
    "simulate late.toml -w x.pcap --truth late.pcap",
]


@pytest.mark.parametrize("words", ONTO_INPUTS)
def test_an_output_that_is_an_input_is_refused(words: str, plant: Path) -> None:
    before = content(plant)
    done = run_text(*words.split(), cwd=plant)
    assert done.returncode == 2
    assert "the output is one of the inputs\n  name another file; inputs are never written\n" in done.stderr
    assert content(plant) == before


EXISTING = {
    "vars peers.pcap --infer --list 1 -w draft.gvl": ["draft.gvl"],
    "vars peers.pcap --infer -w draft.gvl": ["draft-3.gvl"],
    "export peers.pcap batch.gvl " + str(PEERS / "counters.gvl") + " -w v.csv": ["v.batch.csv"],
    "simulate late.toml -w x.log": ["x.log.truth.json"],
    "simulate late.toml -w x.log --gvl plc": ["plc/axis.gvl"],
}


@pytest.mark.parametrize("words", EXISTING)
def test_what_exists_and_was_not_asked_for_by_name_is_replaced_by_force_only(words: str, plant: Path) -> None:
    for name in EXISTING[words]:
        (plant / name).parent.mkdir(exist_ok=True)
        (plant / name).write_text("precious")
    before = content(plant)
    done = run_text(*words.split(), cwd=plant)
    assert done.returncode == 2, done.stderr
    assert f"{EXISTING[words][0]}: exists already\n  --force replaces it; or name another file\n" in done.stderr
    assert content(plant) == before
    assert run_text(*words.split(), "--force", cwd=plant).returncode == 0
    after = content(plant)
    assert all(after[name] != b"precious" for name in EXISTING[words])
    # What is there already, or can be made again from the scenario, needs no force; an export does.
    if words.startswith(("simulate", "vars")):
        assert run_text(*words.split(), cwd=plant).returncode == 0
        assert content(plant) == after


@pytest.mark.parametrize(
    "words", ["export peers.pcap batch.gvl -w o.csv", "simulate late.toml -w o.log --truth o.json"]
)
def test_what_was_asked_for_by_name_is_replaced(words: str, plant: Path) -> None:
    for name in ("o.csv", "o.log", "o.json"):
        (plant / name).write_text("old")
        (plant / name).chmod(0o640)
    assert run_text(*words.split(), cwd=plant).returncode == 0
    changed = [name for name in ("o.csv", "o.log", "o.json") if (plant / name).read_text() != "old"]
    assert changed == (["o.csv"] if "export" in words else ["o.log", "o.json"])
    assert all((plant / name).stat().st_mode & 0o777 == 0o640 for name in changed)
    assert not [name for name in os.listdir(plant) if "unfinished" in name]


def test_the_same_name_twice_is_refused(tmp_path: Path) -> None:
    files = WholeFiles()
    files.open(str(tmp_path / "a"))
    with pytest.raises(UsageError, match="two outputs have this name"):
        files.open(str(tmp_path / "a"))
    files.discard()
    assert content(tmp_path) == {}


def test_a_file_that_fails_at_its_end_leaves_all_others_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")
    files = WholeFiles()
    files.open(str(tmp_path / "a")).file.write(b"new")
    full = files.open("/dev/full")
    full.file.write(b"x")
    with pytest.raises(CaptureError) as caught:
        files.publish()
    assert (caught.value.where, caught.value.what) == ("/dev/full", "cannot be written: No space left on device")
    files.discard()
    assert content(tmp_path) == {"a": b"old"}


def test_the_same_content_is_no_loss(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("same")
    files = WholeFiles()
    files.write(str(tmp_path / "a"), b"same")
    files.publish()
    with pytest.raises(UsageError, match="exists already"):
        WholeFiles().write(str(tmp_path / "a"), b"other")
    WholeFiles().open(str(tmp_path / "b"), Existing.KEPT).discard()
    assert content(tmp_path) == {"a": b"same"}


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can lay links of others")
def test_a_link_that_another_user_laid_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("precious")
    link = tmp_path / "out.csv"
    link.symlink_to("mine")
    os.lchown(link, 65_534, 65_534)
    with pytest.raises(CaptureError, match="a link of another user"):
        WholeFiles().open(str(link))
    assert (tmp_path / "mine").read_text() == "precious"
