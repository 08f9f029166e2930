"""Initial values that do not fit, by samples; and advice of lint on lists that are not packed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.definition.test_lint import gvl, mistakes

ST = (
    "TYPE ST : STRUCT b : BYTE; w : WORD; many : ARRAY [0..2] OF BYTE; inner : INNER; END_STRUCT "
    "INNER : STRUCT few : FEW; END_STRUCT ST_DERIVED EXTENDS ST : STRUCT more : BYTE; END_STRUCT "
    "FEW : SINT (-5..5); MANY : ARRAY [0..1] OF BYTE; END_TYPE"
)
SAMPLES = (
    *(
        (
            "initial-value",
            [gvl(f"a : {kind} := {wrong};")],
            f"a.gvl:4:{4 + len(kind) + 5} the initial value {wrong} of a does not fit into {kind}",
            [gvl(f"a : {kind} := {right};")],
        )
        for kind, wrong, right in (
            ("INT", "40000", "16#9C40"),
            ("SINT", "200", "2#1100_1000"),
            ("USINT", "-1", "-16#1"),
            ("BOOL", "2", "1"),
            ("WORD", "65536", "INT#-1"),
        )
    ),
    (
        "initial-value",
        [gvl("a : INT := INT#40000;")],
        "a.gvl:4:12 the initial value 40000 of a does not fit into INT",
        [gvl("a : INT := INT#16#9C40;")],
    ),
    (
        "initial-value",
        [gvl("a : ARRAY [0..1] OF BYTE := [2, 300];")],
        "a.gvl:4:33 the initial value 300 of a does not fit into BYTE",
        [gvl("a : ARRAY [0..1] OF BYTE := [2, 16#FF]; b : ARRAY [0..999] OF BYTE := [300(0), 700(1)];")],
    ),
    (
        "initial-value",
        [gvl("a : ARRAY [0..1] OF BYTE := 2, 300;")],
        "a.gvl:4:32 the initial value 300 of a does not fit into BYTE",
        [gvl("a : ARRAY [0..1] OF BYTE := 2, 255;")],
    ),
    *(
        (
            "initial-value",
            [gvl(f"a : {kind} := {before}300{behind};"), ST],
            f"a.gvl:4:{4 + len(kind) + 5 + len(before)} the initial value 300 of {variable} does not fit into {small}",
            [gvl(f"a : {kind} := {before}3{behind};"), ST],
        )
        for kind, before, behind, variable, small in (
            ("ARRAY [0..3] OF BYTE", "[1, 2(", "), 4]", "a", "BYTE"),
            ("ARRAY [0..3] OF BYTE", "2(1), 2(", ")", "a", "BYTE"),
            ("ARRAY [0..1] OF ARRAY [0..1] OF BYTE", "[[1, 2], [3, ", "]]", "a", "BYTE"),
            ("ARRAY [0..1] OF ARRAY [0..1] OF BYTE", "[2([1, ", "])]", "a", "BYTE"),
            ("ST", "(b := ", ")", "a.b", "BYTE"),
            ("ST", "(w := 300, B := ", ")", "a.B", "BYTE"),
            ("ST", "(many := [1, 2(", ")])", "a.many", "BYTE"),
            ("ST", "(inner := (few := ", "))", "a.inner.few", "SINT (-5..5)"),
            ("ST_DERIVED", "(w := 300, b := ", ")", "a.b", "BYTE"),
            ("ARRAY [0..2] OF ST", "[(b := 3), 2((b := ", "))]", "a.b", "BYTE"),
            ("MANY", "[1, ", "]", "a", "BYTE"),
            ("FEW", "", "", "a", "SINT (-5..5)"),
        )
    ),
    (
        "initial-value",
        ["TYPE ST : STRUCT m : ARRAY [0..1] OF BYTE := [1, 300]; END_STRUCT END_TYPE"],
        "a.st:1:50 the initial value 300 of ST.m does not fit into BYTE",
        ["TYPE ST : STRUCT m : ARRAY [0..1] OF BYTE := [1, 30]; END_STRUCT END_TYPE"],
    ),
)


@pytest.mark.parametrize(("rule", "wrong", "said", "right"), SAMPLES)
def test_a_value_that_does_not_fit_is_found(
    rule: str, wrong: Sequence[str], said: str, right: Sequence[str], tmp_path: Path
) -> None:
    (found,) = [each for each in mistakes(tmp_path, wrong) if each.rule.id == rule]
    where = found.place.position
    assert f"{Path(where.file).name}:{where.line}:{where.column} {found.place.message}" == said
    assert rule not in [each.rule.id for each in mistakes(tmp_path, right)]


def test_advice_is_true_of_lists_that_are_not_packed_too(tmp_path: Path) -> None:
    """There, what follows a POINTER has telegrams of its own, and no place would keep an array in one telegram."""
    pointer, cut = mistakes(tmp_path, [gvl("p : POINTER TO INT; a : ARRAY [1..3] OF INT;", Pack="False")])
    assert pointer.rule.id == "unknown-size"
    assert "nor anything behind it where the list is packed" in pointer.rule.why
    assert cut.rule.id == "cut-variable"
    assert cut.rule.next_step.startswith("Pack the list if it is not packed, ")


@pytest.mark.parametrize(
    "text",
    [
        "a : ARRAY [0..299] OF BYTE := [300(3)];",
        "a : ST := (w := 300, b := 16#2C);",
        "a : ST := (unknown := 300);",
        "a : ST_MISSING := (b := 300);",
        "a : FB := (b := 300);",
        "a : ST := (b := nMany, w := MAX(1, 300));",
        "a : ST := (many := nMany[300]);",
        f"a : BYTE := {'(' * 500}3{')' * 500};",
        f"a : ARRAY [0..1] OF BYTE := {'[' * 500}300{']' * 500};",
    ],
)
def test_nothing_is_said_of_what_fits_or_nobody_knows(tmp_path: Path, text: str) -> None:
    assert "initial-value" not in [each.rule.id for each in mistakes(tmp_path, [gvl(text), ST])]


def test_of_a_type_that_several_files_declare_nothing_is_said(tmp_path: Path) -> None:
    types = [f"TYPE ST : STRUCT b : {kind}; END_STRUCT END_TYPE" for kind in ("BYTE", "WORD")]
    assert "initial-value" not in [each.rule.id for each in mistakes(tmp_path, [gvl("a : ST := (b := 300);"), *types])]
