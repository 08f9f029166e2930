from __future__ import annotations

import json
import subprocess
from pathlib import Path

from nvscope.expression.typed_columns import FieldType
from nvscope.protocols.table import PROTOCOLS, fields_of
from nvscope.tui.actions import ACTIONS
from nvscope.view.fields.frame import EITHER_OF
from nvscope.view.fields.vocabulary import vocabulary
from tests.program_here import run_text

FIELDS = vocabulary(fields=fields_of(PROTOCOLS))


def keys(*arguments: str) -> subprocess.CompletedProcess[str]:
    return run_text("keys", *arguments, environment={"COLUMNS": "80"})


def test_every_field_is_listed_with_its_type() -> None:
    done = keys("--fields")
    assert (done.returncode, done.stderr) == (0, "")
    assert all(len(line) <= 80 for line in done.stdout.splitlines())
    listed = [line.split()[:2] for line in done.stdout.splitlines()[1:] if not line.startswith(" ")]
    assert listed[: len(FIELDS)] == [[field.name, field.type.value] for field in FIELDS.values()]
    assert {name for name, _ in listed[len(FIELDS) :]} == set(EITHER_OF)


def test_the_same_for_programs() -> None:
    document = json.loads(keys("--fields", "--json").stdout)
    assert document["schema"] == "nvscope.fields/1"
    entries = {entry["name"]: entry for entry in document["fields"]}
    assert set(entries) == {*FIELDS, *EITHER_OF}
    assert entries["nv.counter"]["help"] == FIELDS["nv.counter"].help
    assert {entry["type"] for entry in entries.values()} <= {kind.value for kind in FieldType}
    assert [name for name, entry in entries.items() if not entry["filter"]] == ["frame.time_delta_displayed"]
    later = [name for name, field in FIELDS.items() if field.judged]
    assert [name for name, entry in entries.items() if entry["judged"]] == later
    assert [name for name, entry in entries.items() if not entry["output"]] == [*later, *EITHER_OF]


def test_with_definitions_the_variables_are_listed_too() -> None:
    peers = Path(__file__).parents[2] / "captures" / "peers"
    given = [f"--gvl={peers / name}" for name in ("axis.gvl", "axis_types.st")]
    document = json.loads(keys("--fields", "--json", *given).stdout)
    entries = {entry["name"]: entry for entry in document["fields"]}
    assert entries["var.stAxis.pos"]["type"] == entries["var.axis.stAxis.pos"]["type"] == "real"
    assert entries["var.aLimits[3]"]["help"] == "DINT of list axis"
    # As for all verbs, they need no option.
    named = [str(peers / name) for name in ("axis.gvl", "axis_types.st")]
    assert json.loads(keys("--fields", "--json", *named).stdout) == document
    assert json.loads(keys("--fields", "--json", "--gvl", *named).stdout) == document
    missing = keys("--fields", str(peers / "axs.gvl"))
    assert (missing.returncode, missing.stdout) == (2, "")
    assert f"  perhaps {peers / 'axis.gvl'}" in missing.stderr


def test_without_an_option_the_keys_of_the_screen_are_shown() -> None:
    done = keys()
    assert (done.returncode, done.stderr) == (0, "")
    assert all(len(line) <= 80 for line in done.stdout.splitlines())
    told = [line for line in done.stdout.splitlines() if line.startswith("  ")]
    for action in ACTIONS:
        assert any(action.name in line and " ".join(action.keys) in line for line in told), action.name


def test_keys_are_those_of_the_project(tmp_path: Path) -> None:
    project = tmp_path / "nvscope.toml"
    project.write_text('[keys]\n"view.causes" = "c"\n')
    (line,) = [line for line in keys("--project", str(project)).stdout.splitlines() if "view.causes" in line]
    assert line.split()[:2] == ["c", "view.causes"]
    project.write_text('[keys]\n"view.cuases" = "c"\n')
    done = keys("--project", str(project))
    assert (done.returncode, done.stdout) == (2, "")
    assert f"{project}: keys.view.cuases: no action has this name" in done.stderr
    assert "view.causes" in done.stderr
