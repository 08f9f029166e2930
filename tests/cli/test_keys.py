from __future__ import annotations

import json
import subprocess
import sys

from nvscope.expression.columns import FieldType
from nvscope.view.fields import EITHER_OF, FIELDS


def keys(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "nvscope", "keys", *arguments], capture_output=True, text=True, check=False
    )


def test_every_field_is_listed_with_its_type() -> None:
    done = keys("--fields")
    assert (done.returncode, done.stderr) == (0, "")
    listed = [line.split()[:2] for line in done.stdout.splitlines()[1:]]
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
    assert [name for name, entry in entries.items() if not entry["output"]] == list(EITHER_OF)


def test_there_are_no_key_bindings_yet() -> None:
    done = keys()
    assert (done.returncode, done.stdout) == (2, "")
    assert "--fields" in done.stderr
