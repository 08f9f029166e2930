"""Times of all documents: absolute ones texts of nanoseconds, durations whole numbers of them, under keys in _ns."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

from tests.schemas.corpus import COMMANDS, ODD_COMMANDS, asked, odd_plant
from tests.schemas.documents import SCHEMAS
from tests.schemas.paths import places_of, seen_in
from tests.schemas.shapes import Schema, duration, time

NAMED_BY_CODESYS = {"tLastSend", "tLastReceive", "tLastError"}
"""Members of NetVarUDPDiagStruct; they keep its names."""
VALUES = {f"{name}{ending}" for name in ("value", "min", "max", "old", "new") for ending in ("", "_text")} | {"text"}
"""What a variable holds; ``unit`` is beside it."""
ROWS_OF_VERSION_1 = ("load.by_second[][]",)
"""Rows of a chart, without keys: when a second began, its load, the most it could have."""

DIGITS = re.compile(r"-?\d{16,}")
DATE = re.compile(r"\d{4}-\d{2}-\d{2}[T ]\d{2}:")


def keys_of(path: str) -> list[str]:
    return path.replace("[]", "").split(".")


def is_named_as_time(path: str) -> bool:
    keys = keys_of(path)
    return keys[-1] in NAMED_BY_CODESYS or (any(key.endswith("_ns") for key in keys) and keys[-1] != "count")


def is_time(node: Schema) -> bool:
    return node.get("pattern") == time()["pattern"] and node["description"].endswith(time()["description"])


def is_duration(node: Schema) -> bool:
    return str(node.get("description", "")).endswith(duration()["description"])


@pytest.mark.parametrize("name", SCHEMAS)
def test_what_schemas_call_a_time_has_a_name_that_says_so(name: str) -> None:
    wrong = []
    for path, node in places_of(SCHEMAS[name]()):
        types = {node["type"]} if isinstance(node.get("type"), str) else set(node.get("type", ()))
        if is_time(node) and not types <= {"string", "null"}:
            wrong.append(f"{path}: a time is a {types}")
        if is_duration(node) and not types <= {"integer", "null"}:
            wrong.append(f"{path}: a duration is a {types}")
        if types <= {"null"} or "object" in types or path.endswith(ROWS_OF_VERSION_1):
            continue  # never known, or not itself a time
        if is_named_as_time(path) != (is_time(node) or is_duration(node)):
            wrong.append(f"{path}: {node}")
    assert wrong == []


def mistaken(document: dict[str, Any]) -> Iterator[str]:
    """Yield the places of a document where something is like a time and not called so, or called so and is none."""
    for path, value in seen_in(document):
        if isinstance(value, dict) or value is None or keys_of(path)[-1] in VALUES:
            continue
        if path.endswith(ROWS_OF_VERSION_1):
            continue
        text = isinstance(value, str) and (DIGITS.fullmatch(value) or DATE.match(value))
        if is_named_as_time(path):
            if type(value) is not int and not (isinstance(value, str) and re.fullmatch(r"-?\d+", value)):
                yield f"{path} = {value!r}"
        elif text or (type(value) is int and abs(value) >= 10**16):
            yield f"{path} = {value!r}"


@pytest.mark.parametrize("command", COMMANDS)
def test_what_documents_hold_of_times_has_such_names(command: str) -> None:
    assert list(mistaken(asked(command))) == []


@pytest.mark.parametrize("command", ODD_COMMANDS)
def test_what_documents_about_an_odd_plant_hold_of_times_has_such_names(command: str) -> None:
    assert list(mistaken(asked(command, odd_plant()))) == []
