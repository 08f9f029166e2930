"""The project file, as a person meets it: found upwards, told by --project, and wrong."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.program_here import run_text

PEERS = Path(__file__).parents[2] / "captures" / "peers"
CAPTURE = str(PEERS / "peers.pcap")

PLANT = """
definitions = ["plc/*.gvl", "plc/*.st"]
[nodes]
"10.77.0.3" = { name = "press" }
"10.77.0.99" = { name = "panel", reads = [42] }
[lists.7]
name = "drives"
[lists.50]
name = "heart\\u001b"
"""


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    """A directory of a plant, two below that of its project file."""
    (tmp_path / "plc").mkdir()
    for name in ("axis.gvl", "axis_types.st"):
        shutil.copy(PEERS / name, tmp_path / "plc")
    (tmp_path / "nvscope.toml").write_text(PLANT)
    below = tmp_path / "captures" / "today"
    below.mkdir(parents=True)
    return below


def nvscope(cwd: Path, *arguments: str | Path, width: int = 100) -> subprocess.CompletedProcess[str]:
    return run_text(*arguments, cwd=cwd, environment={"COLUMNS": str(width)})


def report(cwd: Path, *arguments: str | Path) -> dict[str, Any]:
    """Return the report of the capture as data."""
    done = nvscope(cwd, "report", CAPTURE, "--json", *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    document: dict[str, Any] = json.loads(done.stdout)
    return document


def test_a_report_with_the_names_of_a_project_found_upwards(plant: Path) -> None:
    document = report(plant)
    lists = {entry["id"]: entry for entry in document["lists"]}
    assert {number: entry["name"] for number, entry in lists.items() if entry["name"]} == {7: "drives", 42: "axis"}
    assert lists[42]["readers"] == ["10.77.0.99"]
    assert [(node["address"], node["name"], node["diag"]["nReceiveCount"]) for node in lists[42]["nodes"]] == [
        ("10.77.0.3", "press", 0),
        ("10.77.0.99", "panel", 199),
    ]
    assert [stream["interval_ns"]["nominal"] for stream in lists[42]["streams"]] == [50_000_000]
    codes = [(finding["code"], finding["list"]) for finding in document["findings"] if finding["code"] >= "NV406"]
    assert codes[0] == ("NV407", "udp/1202/50")
    known = next(finding for finding in document["findings"] if finding["list"] == "udp/1202/7")
    assert known["message"] == "List 7 on port 1202 is known by its settings only, not by its variables."


@pytest.mark.parametrize("width", [80, 140])
def test_names_stand_in_the_table_and_are_made_visible(plant: Path, width: int) -> None:
    done = nvscope(plant, "report", CAPTURE, "-v", width=width)
    assert (done.returncode, done.stderr) == (0, "")
    assert all(len(line) <= width for line in done.stdout.splitlines())
    figures = done.stdout.partition("\nFigures\n")[2]
    row = next(line for line in figures.splitlines() if "udp/1202/42" in line)
    assert row.split()[:5] == ["✓", "ok", "udp/1202/42", "axis", "press"]
    assert "List heart\\x1b (udp/1202/50) is defined" in " ".join(done.stdout.split())
    assert "\x1b" not in done.stdout
    markdown = nvscope(plant, "report", CAPTURE, "--md", "--all").stdout
    assert "| `udp/1202/42` | `axis` | `press` | `panel` |" in markdown


def test_addresses_instead_of_names(plant: Path) -> None:
    text = nvscope(plant, "report", CAPTURE, "-n").stdout
    assert "axis" in text
    assert "press" not in text
    assert all(node["name"] is None for entry in report(plant, "-n")["lists"] for node in entry["nodes"])


def test_telegrams_and_variables_with_names(plant: Path) -> None:
    lines = nvscope(plant, "packets", CAPTURE, "-c", "6").stdout.splitlines()
    assert lines[0].split()[:5] == ["3", "0.000053", "10.77.0.2", "→", "press:1202"]
    assert lines[3].split()[:5] == ["6", "0.043878", "press", "→", "broadcast"]
    assert "press" not in nvscope(plant, "packets", CAPTURE, "-c", "6", "--no-names").stdout
    assert "10.77.0.3" in nvscope(plant, "packets", CAPTURE, "-c", "6", "-T", "csv").stdout
    tree = nvscope(plant, "packets", CAPTURE, "-c", "6", "-V").stdout
    assert "Variables  axis" in tree
    title = nvscope(plant, "vars", CAPTURE).stdout.splitlines()[0]
    assert title == "udp/1202/42 axis from press, 199 telegrams"
    assert nvscope(plant, "vars", CAPTURE, "-n").stdout.startswith("udp/1202/42 axis from 10.77.0.3, ")


def test_byte_maps_of_the_projects_files(plant: Path) -> None:
    assert nvscope(plant, "gvl", "layout").stdout.startswith("axis: list 42 on UDP port 1202, packed, every 50.0 ms")
    (entry,) = json.loads(nvscope(plant, "gvl", "layout", "--json").stdout)["lists"]
    assert entry["id"] == 42


def test_files_of_the_command_line_take_the_place_of_the_projects(plant: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.gvl"
    other.write_text((PEERS / "axis.gvl").read_text().replace(">42<", ">7<"))
    lists = {entry["id"]: entry for entry in report(plant, "--gvl", other, "--gvl", PEERS / "axis_types.st")["lists"]}
    assert (lists[7]["name"], lists[42]["name"]) == ("drives", None)
    assert lists[42]["nodes"][1]["name"] == "panel"


def test_another_project_and_its_limits(plant: Path, tmp_path: Path) -> None:
    strict = tmp_path / "strict.toml"
    strict.write_text('[lists.42]\ninterval = "10ms"\n[limits]\nlate_percent = 300\nacknowledgement = "1ms"')
    document = report(plant, "--project", strict)
    (late,) = [finding for finding in document["findings"] if finding["code"] == "NV501"]
    assert (late["list"], late["count"]) == ("udp/1202/42", 198)
    assert late["message"].startswith("198 intervals longer than 30.0 ms without a loss; nominal is 10.0 ms by the")
    assert document["lists"][-1]["nodes"][0]["name"] is None
    text = nvscope(plant, "report", CAPTURE, "--project", strict, "--all").stdout
    assert "50.0 ms" not in next(line for line in text.splitlines() if "udp/1202/42" in line)


def test_the_time_for_an_answer_is_that_of_the_command_line_first(plant: Path, tmp_path: Path) -> None:
    waiting = tmp_path / "waiting.toml"
    waiting.write_text('[limits]\nacknowledgement = "1ms"')
    capture = PEERS.parent / "telegrams.pcap"

    def unanswered(*arguments: str | Path) -> int:
        done = nvscope(plant, "report", capture, "--json", *arguments)
        found = json.loads(done.stdout)["findings"]
        return sum(finding["count"] for finding in found if finding["code"] in ("NV301", "NV303", "NV304"))

    short, usual = unanswered("--ack-timeout", "1ms"), unanswered()
    assert short > usual
    assert unanswered("--project", waiting) == short
    assert unanswered("--project", waiting, "--ack-timeout", "1s") == usual


def test_what_is_wrong_is_said_with_its_place(plant: Path, tmp_path: Path) -> None:
    project = tmp_path / "nvscope.toml"
    project.write_text("[limits]\njiter_percent = 3")
    for verb in (["report", CAPTURE], ["packets", CAPTURE], ["vars", CAPTURE], ["gvl", "layout"]):
        done = nvscope(plant, *verb)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == (
            "nvscope: ../../nvscope.toml, line 2, column 1: limits.jiter_percent: unknown key 'jiter_percent'\n"
            "  The nearest known one is 'jitter_percent'; known are: acknowledgement, burst_percent, "
            "bus_load_percent, jitter_percent, late_percent, max_streams, mirrored_percent, parameter, "
            "stopped_percent.\n"
        )
    project.write_text('definitions = "no/*.gvl"')
    assert (
        "nvscope.toml, line 1, column 1: definitions[0]: no file matches 'no/*.gvl'"
        in nvscope(plant, "report", CAPTURE).stderr
    )
    missing = nvscope(plant, "report", CAPTURE, "--project", tmp_path / "missing.toml")
    assert missing.returncode == 2
    assert "missing.toml: cannot be read: No such file" in missing.stderr
    assert nvscope(plant, "report", CAPTURE, "--project", tmp_path).returncode == 2


def test_a_project_without_definitions_has_no_variables(plant: Path, tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text('[lists.42]\nname = "axis"')
    for verb in (["vars", CAPTURE], ["gvl", "layout"]):
        done = nvscope(plant, *verb)
        assert (done.returncode, done.stdout) == (2, "")
        assert "no definition is given" in done.stderr
    assert not [finding for finding in report(plant)["findings"] if finding["code"] == "NV406"]


def test_a_report_without_definitions_does_not_load_their_parsers(plant: Path, tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text('[nodes]\n"10.77.0.3" = { name = "press" }')
    program = (
        "import sys; from nvscope.cli.main import main\n"
        f"sys.argv = ['nvscope', 'report', {CAPTURE!r}]\n"
        "try: main()\n"
        "except SystemExit: print(sorted({'lark', 'defusedxml', 'polars', 'pyarrow'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=60, cwd=plant
    )
    assert done.stdout.splitlines()[-1] == "[]", done.stderr
