"""Rule files: all mistakes at once, each with its place; and a schema that says the same."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from nvscope.check.catalogue import CATALOGUE
from nvscope.check.rules import Mistakes, read_rules
from nvscope.schemas.schema_files import schema_text

EXAMPLE = Path(__file__).parents[2] / "captures" / "plant.rules.toml"
SCHEMA: dict[str, Any] = json.loads(schema_text("rules"))

TEN = """[defaults]
warmup = "soon"
wramup = "1s"

[[rule]]
id = "a"
check = "los"

[[rule]]
id = "b"
check = "loss"
max = 3
min = "1%"

[[rule]]
check = "gap"
max = -1

[[rule]]
id = "b"
check = "restarts"
severity = "fatal"
list = 3.5

[[rules]]
id = "c"
"""
MISTAKES = [
    ("25, column 3: rules", "unknown key 'rules'", "rule"),
    ("3, column 1: defaults.wramup", "unknown key 'wramup'", "warmup"),
    ("2, column 1: defaults.warmup", "'soon' is no duration", ""),
    ("7, column 1: rule[0].check", "'los' is none of the choices", "loss"),
    ("13, column 1: rule[1].min", "unknown key 'min'", "max"),
    ("12, column 1: rule[1].max", "a share in percent is expected", "20%"),
    ("15, column 3: rule[2]", "the key 'id' is missing", ""),
    ("17, column 1: rule[2].max", "a number of 0 or more is expected", ""),
    ("23, column 1: rule[3].list", "a text is expected", ""),
    ("22, column 1: rule[3].severity", "'fatal' is none of the choices", ""),
    ("20, column 1: rule[3].id", "'b' is the id of another rule", ""),
]


def written(path: Path, text: str) -> str:
    path.write_text(text)
    return str(path)


def mistakes_in(path: str) -> list[tuple[str, str, str]]:
    with pytest.raises(Mistakes) as told:
        read_rules([path])
    return [(one.where, one.what, one.next_step) for one in told.value.mistakes]


def test_all_mistakes_of_a_file_are_told_at_once_with_their_places(tmp_path: Path) -> None:
    path = written(tmp_path / "x.rules.toml", TEN)
    found = mistakes_in(path)
    assert len(found) == len(MISTAKES)
    for (where, what, next_step), (place, begin, near) in zip(found, MISTAKES, strict=True):
        assert where == f"{path}, line {place}"
        assert what.startswith(begin)
        assert near in next_step


def test_the_example_is_read(tmp_path: Path) -> None:
    found = read_rules([str(EXAMPLE)])
    assert [one.warmup_ns for one in found.rules] == [10**9] * len(found.rules)
    first = found.rules[0]
    assert (first.id, first.check.name, first.lists, first.parameters, first.severity) == (
        "axis-complete", "loss", ("7",), {"max": 0.001}, "error",
    )  # fmt: skip
    assert [one.severity for one in found.rules if one.id == "no-restart"] == ["warning"]


@pytest.mark.parametrize(
    ("text", "what"), [("", "there is no rule in it"), ("x = [", "no TOML"), ("rule = 3", "array")]
)
def test_a_file_without_a_rule_is_a_mistake(text: str, what: str, tmp_path: Path) -> None:
    ((_, told, _),) = mistakes_in(written(tmp_path / "x.rules.toml", text))
    assert what in told


def test_files_include_others_once(tmp_path: Path) -> None:
    written(tmp_path / "common.rules.toml", 'include = "x.rules.toml"\n[[rule]]\nid = "common"\ncheck = "gap"\n')
    path = written(tmp_path / "x.rules.toml", 'include = ["common.rules.toml"]\n[[rule]]\nid = "own"\ncheck = "gap"\n')
    assert [one.id for one in read_rules([path]).rules] == ["common", "own"]
    ((where, what, _),) = mistakes_in(written(tmp_path / "y.rules.toml", 'include = ["none.toml"]\n'))
    assert "none.toml" in where
    assert "No such file" in what


def test_the_schema_allows_what_is_read_and_nothing_else() -> None:
    validator = Draft202012Validator(SCHEMA)
    validator.check_schema(SCHEMA)
    assert list(validator.iter_errors(tomllib.loads(EXAMPLE.read_text()))) == []
    assert list(validator.iter_errors(tomllib.loads(TEN)))


@pytest.mark.parametrize("name", CATALOGUE)
def test_examples_of_checks_are_rules(name: str, tmp_path: Path) -> None:
    text = f'[[rule]]\nid = "x"\n{CATALOGUE[name].example}\n'
    written(tmp_path / "learnt.toml", '[[rule]]\nid = "y"\ncheck = "gap"\n')
    (rule,) = read_rules([written(tmp_path / "x.rules.toml", text)]).rules
    assert rule.check.name == name
    assert list(Draft202012Validator(SCHEMA).iter_errors(tomllib.loads(text))) == []
