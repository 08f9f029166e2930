from __future__ import annotations

import json
import subprocess
from pathlib import Path

from nvscope.expression.typed_columns import FieldType
from nvscope.protocols.table import PROTOCOLS, fields_of
from nvscope.view.fields.frame import EITHER_OF
from nvscope.view.fields.vocabulary import vocabulary
from tests.program import run_text

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


def test_without_an_option_the_fields_are_shown_and_that_there_are_no_keys_yet() -> None:
    done = keys()
    assert (done.returncode, done.stdout) == (0, keys("--fields").stdout)
    assert done.stderr == "nvscope: there is no live screen yet, and so there are no key bindings.\n"
