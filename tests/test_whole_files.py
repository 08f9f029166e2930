"""No command takes anything away from a user: not its inputs, not what exists and was not meant."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from nvscope.errors import CaptureError, UsageError
from nvscope.whole_files import Existing, WholeFiles
from tests.program import COMMAND, run, run_text

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


def in_shell(words: str, redirection: str, folder: Path) -> subprocess.CompletedProcess[bytes]:
    command = f"{shlex.join([*COMMAND, *words.split()])} {redirection}"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(["sh", "-c", command], cwd=folder, env=environment, capture_output=True, check=False)


REDIRECTED = {
    "export - -w peers.pcap.csv": "< peers.pcap.csv",
    "export -r - -w same.ndjson": "< peers.pcap.csv",
    "vars --infer - --list 1 -w peers.pcap --force": "< peers.pcap",
    "simulate late.toml -w peers.pcap --force": "< peers.pcap",
    "packets peers.pcap -T csv": ">> peers.pcap",
    "packets -r peers.pcap": ">> link.csv",
    "report -": "< peers.pcap >> peers.pcap",
    "export peers.pcap -w -": ">> hard.csv",
    "vars peers.pcap": ">> nvscope.toml",
    "vars peers.pcap --gvl batch.gvl": ">> batch.gvl",
    "report days": ">> days/monday.csv",
    "gvl layout batch.gvl": ">> batch.gvl",
    "gvl diff batch.gvl batch.gvl": ">> gvl.csv",
    "simulate late.toml -w x.pcap --truth -": ">> late.toml",
}


@pytest.mark.skipif(os.name != "posix", reason="these words are of its shell")
@pytest.mark.parametrize("words", REDIRECTED)
def test_what_the_shell_opened_is_an_input_or_an_output_like_any_other(words: str, plant: Path) -> None:
    shutil.copy(plant / "peers.pcap", plant / "peers.pcap.csv")
    (plant / "same.ndjson").hardlink_to(plant / "peers.pcap.csv")
    before = content(plant)
    done = in_shell(words, REDIRECTED[words], plant)
    assert done.returncode == 2, done.stderr
    assert b"the output is one of the inputs\n  name another file; inputs are never written\n" in done.stderr
    assert content(plant) == before


@pytest.mark.skipif(os.name != "posix", reason="these words are of its shell")
@pytest.mark.parametrize("redirection", ["> days/report.txt", ">> days/notes.txt", "< days/notes.txt"])
def test_a_report_may_lie_beside_its_captures(redirection: str, plant: Path) -> None:
    (plant / "days" / "notes.txt").write_text("Monday: press stood.\n")
    done = in_shell("report days", redirection, plant)
    assert (done.returncode, done.stderr) == (0, b"")
    assert (plant / "days" / "notes.txt").read_text().startswith("Monday: press stood.\n")


MESSAGES_ONTO_INPUTS = {
    "report peers.pcap": "2>> peers.pcap",
    "packets -r peers.pcap": "2>> link.csv",
    "report -": "< peers.pcap 2>> peers.pcap",
    "vars peers.pcap": "2>> nvscope.toml",
    "vars peers.pcap --gvl batch.gvl": "2>> batch.gvl",
    "report days": "2>> days/monday.csv",
    "export peers.pcap -w v.csv": "2>> hard.csv",
    "gvl lint batch.gvl": "2>> batch.gvl",
    "gvl diff batch.gvl batch.gvl": "2>> gvl.csv",
    "simulate late.toml -w x.pcap": "2>> late.toml",
}


@pytest.mark.skipif(os.name != "posix", reason="these words are of its shell")
@pytest.mark.parametrize("words", MESSAGES_ONTO_INPUTS)
def test_messages_are_not_written_into_inputs_but_told_on_stdout(words: str, plant: Path) -> None:
    before = content(plant)
    done = in_shell(words, MESSAGES_ONTO_INPUTS[words], plant)
    assert (done.returncode, done.stderr) == (2, b"")
    assert done.stdout.startswith(b"nvscope: stderr, which is ")
    assert done.stdout.endswith(b"the output is one of the inputs\n  name another file; inputs are never written\n")
    assert content(plant) == before


@pytest.mark.skipif(os.name != "posix", reason="these words are of its shell")
@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        ("report missing-*.pcap peers.pcap", 4, b"no file matches"),
        ("report peers.pcap --no-such-option", 2, b"--no-such-option"),
        ("packets -rpeers.pcap -t sometime", 2, b"sometime"),
        ("packets --gvl=peers.pcap -c none", 2, b"none"),
    ],
)
def test_neither_are_mistakes_that_are_found_before_it_is_known_what_is_read(
    words: str, code: int, told: bytes, plant: Path
) -> None:
    before = content(plant)
    done = in_shell(words, "2>> peers.pcap", plant)
    assert (done.returncode, done.stderr) == (code, b"")
    assert told in done.stdout
    assert content(plant) == before


@pytest.mark.skipif(os.name != "posix", reason="these words are of its shell")
@pytest.mark.parametrize("redirection", [">> peers.pcap 2>&1", "2>> peers.pcap >> link.csv"])
@pytest.mark.parametrize("words", ["report peers.pcap", "report peers.pcap --no-such-option"])
def test_where_both_go_to_an_input_nothing_is_told(words: str, redirection: str, plant: Path) -> None:
    before = content(plant)
    done = in_shell(words, redirection, plant)
    assert (done.returncode, done.stdout, done.stderr) == (2, b"", b"")
    assert content(plant) == before


@pytest.mark.skipif(os.name != "posix", reason="these words are of its shell")
def test_messages_may_go_to_any_other_file_whatever_it_is_called(plant: Path) -> None:
    assert in_shell("report peers.pcap", "2>> report", plant).returncode == 0
    assert in_shell("report peers.pcap", "2>> days/notes.txt", plant).returncode == 0
    assert (plant / "report").read_bytes() == (plant / "days" / "notes.txt").read_bytes()


EXISTING = {
    "vars peers.pcap --infer --list 1 -w draft.gvl": ["draft.gvl"],
    "vars peers.pcap --infer -w draft.gvl": ["draft-3.gvl"],
    "export peers.pcap batch.gvl " + str(PEERS / "counters.gvl") + " -w v.csv": ["v.batch.csv"],
    "simulate late.toml -w x.log": ["x.log.truth.json"],
    "simulate late.toml -w x.log --gvl plc": ["plc/axis.gvl"],
    "simulate late.toml -w peers.log": ["peers.log"],
    "simulate late.toml -w x.log --truth notes.json": ["notes.json"],
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


def test_another_scenario_replaces_by_force_only(plant: Path) -> None:
    """Also what is a capture, and beside it a truth, that the same verb wrote."""
    assert run_text("simulate", "late.toml", "-w", "x.log", cwd=plant).returncode == 0
    (plant / "late.toml").write_text((plant / "late.toml").read_text() + "\n# changed\n")
    before = content(plant)
    assert run_text("simulate", "late.toml", "-w", "x.log", cwd=plant).returncode == 0
    other = ROOT / "tests" / "scenarios" / "can-plant-clean.toml"
    done = run_text("simulate", other, "-w", "x.log", cwd=plant)
    assert (done.returncode, "x.log: exists already" in done.stderr) == (2, True)
    assert content(plant) == before
    assert run_text("simulate", other, "-w", "x.log", "--force", cwd=plant).returncode == 0
    assert content(plant)["x.log"] != before["x.log"]


@pytest.mark.parametrize(
    "words", ["export peers.pcap batch.gvl -w o.csv", "simulate late.toml -w o.log --truth o.json --force"]
)
def test_what_is_replaced_keeps_its_permissions(words: str, plant: Path) -> None:
    for name in ("o.csv", "o.log", "o.json"):
        (plant / name).write_text("old")
        (plant / name).chmod(0o640)
    assert run_text(*words.split(), cwd=plant).returncode == 0
    changed = [name for name in ("o.csv", "o.log", "o.json") if (plant / name).read_text() != "old"]
    assert changed == (["o.csv"] if "export" in words else ["o.log", "o.json"])
    assert all((plant / name).stat().st_mode & 0o777 == 0o640 for name in changed)
    assert not [name for name in os.listdir(plant) if "unfinished" in name]


@pytest.mark.parametrize("spelled", ["a", "./a", "sub/../a", "link/a"])
def test_the_same_name_twice_is_refused_however_it_is_spelled(spelled: str, tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "link").symlink_to(tmp_path)
    files = WholeFiles()
    files.open(str(tmp_path / "a"))
    with pytest.raises(UsageError, match="two outputs have this name"):
        files.open(f"{tmp_path}/{spelled}")
    files.discard()
    assert sorted(os.listdir(tmp_path)) == ["link", "sub"]


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


@pytest.mark.skipif(not os.path.exists("/dev/fd"), reason="this system has no names for what is open")
@pytest.mark.parametrize("name", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"])
@pytest.mark.parametrize(
    "words", ["simulate late.toml -w x.log --truth NAME", "vars peers.pcap --infer --list 1 -w NAME"]
)
def test_what_is_open_already_is_written_to_as_it_is(words: str, name: str, plant: Path) -> None:
    asked = words.replace("NAME", name).split()
    usual = run(*words.replace("NAME", "-").split(), cwd=plant)
    assert usual.stdout
    assert run(*asked, "--force", cwd=plant).stdout == usual.stdout
    # What a shell appends to keeps what is in it.
    (plant / "all").write_text("first\n")
    with (plant / "all").open("ab") as appended:
        subprocess.run(
            [*COMMAND, *asked, "--force"], cwd=plant, stdout=appended, stderr=subprocess.DEVNULL, check=True,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
    assert (plant / "all").read_bytes() == b"first\n" + usual.stdout


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize(
    "words",
    ["simulate late.toml -w NAME.log --truth x", "simulate late.toml -w x.log --truth NAME.log",
     "export peers.pcap batch.gvl -w NAME.csv"],
)  # fmt: skip
def test_a_named_pipe_is_opened_once(words: str, plant: Path) -> None:
    run(*words.replace("NAME", "file").split(), cwd=plant)
    (file,) = plant.glob("file.*")
    os.mkfifo(plant / f"pipe{file.suffix}")
    with ThreadPoolExecutor(1) as other:
        came = other.submit((plant / f"pipe{file.suffix}").read_bytes)
        done = run_text(*words.replace("NAME", "pipe").split(), "--force", cwd=plant)
        assert (done.returncode, came.result(timeout=30)) == (0, file.read_bytes())


@pytest.mark.parametrize("name", ["-", "-.gvl", "-.ndjson"])
@pytest.mark.parametrize("words", ["vars peers.pcap --infer -w NAME", "export peers.pcap --gvl PEERS -w NAME"])
def test_files_that_do_not_fit_into_one_stdout_are_refused(words: str, name: str, plant: Path) -> None:
    if words.startswith("export") and name == "-.gvl":
        return
    before = content(plant)
    done = run_text(*words.replace("NAME", name).replace("PEERS", str(PEERS)).split(), cwd=plant)
    assert (done.returncode, done.stdout, "to stdout side by side" in done.stderr) == (2, "", True)
    assert content(plant) == before


def test_json_and_a_draft_are_not_mixed(plant: Path) -> None:
    done = run_text("vars", "peers.pcap", "--infer", "--list", "1", "--json", "-w", "-", cwd=plant)
    assert (done.returncode, done.stdout, "--json and -w -" in done.stderr) == (2, "", True)
