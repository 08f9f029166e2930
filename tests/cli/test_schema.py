"""``nvscope schema``: the documents for programs, and what they look like."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from nvscope.cli.completion import documents
from tests.program_here import run_text
from tests.schemas.documents import BINARY, SCHEMAS, path_of
from tests.schemas.shapes import title_of


def test_all_documents_are_listed_with_what_writes_them() -> None:
    done = run_text("schema", environment={"COLUMNS": "200"})
    assert (done.returncode, done.stderr) == (0, "")
    lines = [line.split(maxsplit=1) for line in done.stdout.splitlines()]
    assert [name for name, _ in lines] == sorted([*SCHEMAS, *BINARY])
    assert all(told.startswith("`nvscope ") for _, told in lines)
    narrow = run_text("schema", environment={"COLUMNS": "50"}).stdout
    assert all(len(line) <= 50 for line in narrow.splitlines())
    assert narrow.split() == done.stdout.split()


@pytest.mark.parametrize("name", [*SCHEMAS, *BINARY])
def test_a_schema_is_printed_by_any_of_its_names(name: str) -> None:
    done = run_text("schema", name)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == path_of(name).read_text(encoding="utf-8")
    assert json.loads(done.stdout)["properties" if name != "lint" else "oneOf"]
    for other in (title_of(name), name.upper(), f" {name} "):
        assert run_text("schema", other).stdout == done.stdout


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("repot", "perhaps report\n"),
        ("nvscope.reports/1", "perhaps report, rules\n"),
        ("nvscope.report/1", "perhaps report\n"),
        ("reports.json", "perhaps report\n"),
        ("zzz", f"there are: {', '.join(sorted([*SCHEMAS, *BINARY]))}\n"),
        ("\x1b[31m", f"there are: {', '.join(sorted([*SCHEMAS, *BINARY]))}\n"),
        ("x" * 10_000, f"there are: {', '.join(sorted([*SCHEMAS, *BINARY]))}\n"),
    ],
)
def test_unknown_names_are_answered_with_near_ones(wrong: str, told: str, tmp_path: Path) -> None:
    done = run_text("schema", wrong, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("nvscope: no document is called ")
    assert done.stderr.endswith(f"  {told}")
    assert "\x1b" not in done.stderr
    assert len(done.stderr) < 300


def test_the_shell_completes_names() -> None:
    assert documents("l") == ["layout", "lint"]
