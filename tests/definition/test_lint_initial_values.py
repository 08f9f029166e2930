"""Initial values that do not fit, by samples; and advice of lint on lists that are not packed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.definition.test_lint import gvl, mistakes

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
