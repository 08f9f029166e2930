"""The catalogue of causes: each row of a family stands in it once, and reads as people expect."""

from __future__ import annotations

import importlib
import pkgutil
import re

import pytest

import nvscope.causes
from nvscope.causes.catalogue import BY_NAME, KINDS
from nvscope.causes.kind import CauseKind

FAMILIES = [
    importlib.import_module(f"nvscope.causes.{entry.name}")
    for entry in pkgutil.iter_modules(nvscope.causes.__path__)
    if entry.name != "catalogue"
]


def test_each_row_of_a_family_is_in_the_catalogue_once() -> None:
    rows = {id(row): row for family in FAMILIES for row in vars(family).values() if isinstance(row, CauseKind)}
    assert {row.name for row in rows.values()} == set(BY_NAME)
    assert len(rows) == len(KINDS) == len(BY_NAME)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_row_reads_as_people_expect(kind: CauseKind) -> None:
    assert re.fullmatch(r"[a-z]+(-[a-z]+)*", kind.name)
    assert 3 < len(kind.brief) <= 22
    assert "{" not in kind.brief
    assert len(kind.measured) <= 40
    for sentence in (kind.meaning, kind.evidence, kind.next_step):
        assert re.fullmatch(r"[A-Z`].*\.", sentence), sentence
