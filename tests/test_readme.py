"""What the README shows is run: every command, and every example for notebooks and prompts."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest

from nvscope.definition.project_file import read_project
from nvscope.definition.project_security import Security
from nvscope.findings.catalogue import CATALOGUE
from nvscope.list_key import ListKey
from nvscope.tracker.counter_takeovers import MOST_PAIRS
from nvscope.tracker.parameter.writes import MOST_WRITES
from nvscope.tracker.visu.state import MOST_WRITE_MINUTES
from tests.plc.parameter.peers import served
from tests.plc.visu.peers import served as served_visu
from tests.program import run_text

ROOT = Path(__file__).parents[1]
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
COMMANDS = [
    line.removeprefix("nvscope ")
    for language, text in BLOCKS
    for line in text.splitlines()
    if not language and line.startswith("nvscope ")
]
PROJECTS = [text for language, text in BLOCKS if language == "toml"]
EXAMPLES = [text for language, text in BLOCKS if language == "python"]


@pytest.fixture
def here(tmp_path: Path) -> Path:
    (tmp_path / "captures").symlink_to(ROOT / "captures")
    return tmp_path


@pytest.mark.parametrize("command", COMMANDS)
def test_a_shell_passes_words_on_as_they_are_read_here(command: str) -> None:
    """So that commands are run as they stand there, without a shell and a Python of their own for each."""
    plain = re.sub("'[^']*'", "", command)
    assert not re.search(r"""[][*?$`|&;<>(){}~#!\\"]""", plain)


@pytest.mark.parametrize("command", COMMANDS)
def test_commands(command: str, here: Path) -> None:
    done = run_text(*shlex.split(command), cwd=here)
    assert done.returncode == 0, done.stderr
    assert done.stdout or "-w" in command


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples(example: str, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(here)
    exec(compile(example, "README.md", "exec"), {})


def test_the_tests_for_pytest(here: Path) -> None:
    (example,) = (text for text in EXAMPLES if "def test_" in text)
    (here / "test_plant.py").write_text(example)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_plant.py"],
        cwd=here, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, "1 passed" in done.stdout) == (0, True), done.stdout


def test_transcripts_are_what_the_program_prints(here: Path) -> None:
    """Of what a command prints, the first lines stand there; one after the other, as somebody would try them."""
    of_rules = [text for language, text in BLOCKS if language == "console" and "plant.rules.toml" in text]
    assert len(of_rules) == 3
    for command, shown in (
        (lines[0], lines[1:])
        for text in of_rules
        for lines in (one.splitlines() for one in text.split("$ nvscope ")[1:])
    ):
        done = run_text(*command.split(), cwd=here, environment={"COLUMNS": "100", "TZ": "UTC"})
        printed = (done.stdout + done.stderr).splitlines()
        assert shown == printed[: len(shown)]
        assert (done.returncode == 1) == shown[0].startswith("✗")


def test_what_a_controller_is_asked_is_what_is_shown(tmp_path: Path) -> None:
    """One after the other, of a controller with the table that stands there; how long it took is as it is."""
    (table,) = (text for text in PROJECTS if "stuck" in text and "[parameters]" in text)
    (shown,) = (text for language, text in BLOCKS if language == "console" and "$ nvscope sdo" in text)
    printed = ""
    with served(tmp_path, table.partition("[parameters]")[2]) as controller:
        for command in re.findall(r"^\$ nvscope (sdo .+)$", shown, re.MULTILINE):
            done = run_text(
                *command.split(), "--port", str(controller.port), "--timeout", "20s", cwd=tmp_path,
                environment={"COLUMNS": "100"},
            )  # fmt: skip
            printed += f"$ nvscope {command}\n{done.stdout}{done.stderr}"
    printed = printed.replace(f":{controller.port}:", ":1202:")
    assert re.sub(r"\d+\.\d [µm]s", "0.3 ms", printed) == shown


def test_what_a_webvisu_is_asked_is_what_is_shown(tmp_path: Path) -> None:
    """The same, of a served WebVisu."""
    (table,) = (text for text in PROJECTS if "[variables]" in text)
    (shown,) = (text for language, text in BLOCKS if language == "console" and "$ nvscope visu" in text)
    head, _, variables = table.partition("[variables]")
    printed = ""
    with served_visu(tmp_path, variables, head) as controller:
        for command in re.findall(r"^\$ nvscope (visu .+)$", shown, re.MULTILINE):
            own = command.replace(":8080", f":{controller.port}")
            done = run_text(*own.split(), "--timeout", "20s", cwd=tmp_path, environment={"COLUMNS": "100"})
            printed += f"$ nvscope {command}\n{done.stdout}{done.stderr}"
    printed = printed.replace(f":{controller.port}:", ":8080:")
    assert re.sub(r"\d+\.\d [µm]s", "0.3 ms", printed) == shown


def test_the_project_file(tmp_path: Path) -> None:
    text = PROJECTS[0]
    for name in tomllib.loads(text)["definitions"]:
        file = tmp_path / name.replace("**/*", "press").replace("*", "types")
        file.parent.mkdir(parents=True, exist_ok=True)
        source = "axis.gvl" if file.suffix == ".gvl" else "axis_types.st"
        file.write_bytes((ROOT / "captures" / "peers" / source).read_bytes())
    (tmp_path / "nvscope.toml").write_text(text)
    project = read_project(tmp_path / "nvscope.toml")
    assert {entry.list_id: entry.interval_ns for entry in project.definition.lists}[7] == 50_000_000
    assert project.node_names == {"192.168.1.10": "press"}


def test_the_project_file_of_lists_on_can(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text(PROJECTS[1])
    project = read_project(tmp_path / "nvscope.toml")
    (entry,) = project.definition.lists
    assert (entry.key, entry.name, entry.interval_ns) == (ListKey.can("can0", 0x110), "press", 50_000_000)
    assert project.buses.of("can0").bit_rate == 250_000


def test_the_opening_is_what_the_program_prints(here: Path) -> None:
    language, text = BLOCKS[0]
    assert language == "console"
    command, *shown = text.splitlines()
    done = run_text(*command.split()[2:], cwd=here, environment={"COLUMNS": "", "TZ": "UTC"})
    printed = done.stdout.splitlines()
    # Of the findings, the first two stand there.
    assert shown == printed[: len(shown)]


def test_who_should_not_be_there_is_what_the_program_tells(here: Path) -> None:
    """By the project file that stands there, of which all keys are, and all codes."""
    (text,) = (text for text in PROJECTS if "[security]" in text)
    (shown,) = (text for language, text in BLOCKS if language == "console" and "captures/visu/panel.pcap" in text)
    (here / "nvscope.toml").write_text(text)
    command, *lines = shown.splitlines()
    done = run_text(*command.split()[2:], cwd=here, environment={"COLUMNS": "100", "TZ": "UTC"})
    assert done.stdout.splitlines()[: len(lines)] == lines
    assert tomllib.loads(text)["security"].keys() == {one.name for one in fields(Security)}
    section = (ROOT / "README.md").read_text("utf-8").partition("## Who should not be there")[2].partition("\n## ")[0]
    assert set(re.findall(r"^\| (NV\d+) ", section, re.MULTILINE)) == {
        code for code, kind in CATALOGUE.items() if kind.of_security
    }
    for limit in (MOST_WRITES, MOST_WRITE_MINUTES, MOST_PAIRS):
        assert f"{limit:,}".replace(",", " ") in section
