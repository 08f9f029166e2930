"""Constant expressions whose value hangs on how many bits a type has."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.definition.model import Problem
from nvscope.definition.variables import size_bytes_of
from tests.definition.declared import declared, shown

WIDTHS = """
TYPE Small : USINT(0..100); Hue : (red := 3) BYTE; END_TYPE
VAR_GLOBAL CONSTANT
    b : BYTE := 16#45; w : WORD := 16#45; i : INT := 16#45; u : UDINT := 4; n : USINT := 20; few : USINT(0..9) := 3;
    own : Small := 16#45; hue : Hue := Hue.red; l : LINT := 3_000_000_000; minus : INT := -6;
END_VAR
"""

COMPUTED = {
    # The result is as wide as what is shifted, turned or negated.
    "SHL(BYTE#16#45, 2)": 0x14, "SHL(b, 2)": 0x14, "SHL(w, 2)": 0x114, "SHL(i, 2)": 0x114, "SHL(own, 2)": 0x14,
    "SHL(USINT#16#FF, 1)": 254, "SHL(WORD#1, 10)": 1024, "SHL(1, 7)": 128, "SHL(0, 60)": 0, "SHL(BYTE#0, 60)": 0,
    "SHR(b, 2)": 0x11, "SHR(WORD#16#100, 8)": 1, "SHR(i, 6)": 1,
    "ROL(b, 2)": 0x15, "ROL(w, 2)": 0x114, "ROL(BYTE#16#81, 1)": 3, "ROL(BYTE#16#81, 9)": 3, "ROL(few, 8)": 3,
    "ROR(b, 2)": 0x51, "ROR(BYTE#1, 1)": 128, "ROR(BYTE#1, 8)": 1, "ROR(hue, 1)": 129, "ROL(INT#5, 3)": 40,
    "NOT BYTE#5": 250, "NOT w": 0xFFBA, "NOT few": 252, "-(NOT INT#5)": 6, "NOT DINT#-6": 5, "NOT minus": 5,
    "NOT (b AND BYTE#16#0F)": 250, "NOT MAX(b, BYTE#16#46)": 0xB9,
    "BOOL_TO_INT(NOT BOOL#0)": 1, "BOOL_TO_INT(NOT BOOL#FALSE)": 1,
    "INT#-1 AND INT#3": 3, "SHL(TO_BYTE(16#45), 2)": 0x14, "SHL(UINT_TO_BYTE(16#45), 2)": 0x14,
    # Arithmetic has 32 bits, whatever the types.
    "n * n": 400, "b + BYTE#255": 324, "BYTE#0 - 1 + 5": 4, "u - 1": 3, "-1 + u": 3, "-n + 25": 5, "-INT#5 + 6": 1,
    "+INT#5": 5, "(l + l) / 1_000_000_000": 6, "UDINT#4_000_000_000 / 1_000_000_000": 4, "ABS(INT#-32768) / 32": 1024,
    "ADD(n, n, 360)": 400, "SUB(n, 4)": 16,
}  # fmt: skip


@pytest.mark.parametrize("text", COMPUTED)
def test_a_constant_has_the_bits_of_its_type(text: str, tmp_path: Path) -> None:
    definition = declared(f"{WIDTHS} VAR_GLOBAL x : ARRAY [0..{text}] OF BYTE; END_VAR", tmp_path)
    assert definition.flaws_of(definition.lists) == []
    assert shown(definition.lists[0].variables[0].type) == f"ARRAY[0..{COMPUTED[text]}] OF BYTE"


NOT_KNOWN = {
    # A bare number may be of any type that holds it.
    "SHL(1, 10)": "SHL(1, 10) depends on the bits of a type that nobody knows",
    "SHL(16#FF, 1)": "SHL(255, 1) depends on the bits of a type that nobody knows",
    "SHR(16#FF, 8)": "SHR(255, 8) depends on the bits of a type that nobody knows",
    "NOT SEL(TRUE, 1, b)": "NOT(SEL(TRUE, 1, b)) depends on the bits of a type that nobody knows",
    "NOT (n + n)": "NOT(n + n) depends on the bits of a type that nobody knows",
    "SHL(BYTE#1, 8)": "SHL(BYTE#1, 8) depends on the controller",
    "SHR(w, 16)": "SHR(w, 16) depends on the controller",
    "SHL(INT#16#4000, 1)": "SHL(INT#16384, 1) depends on the controller",
    "SHR(INT#-4, 1)": "SHR(INT#-4, 1) depends on the controller",
    "ROR(INT#1, 1)": "ROR(INT#1, 1) depends on the controller",
    # Some controllers compute with 32 bits, some with 64.
    "(DINT#2_000_000_000 + DINT#2_000_000_000) / 1_000_000_000": (
        "DINT#2000000000 + DINT#2000000000 depends on the bits of a type that nobody knows"
    ),
    "-u + 10": "0 - u depends on the bits of a type that nobody knows",
    "u / -2 + 10": "u / -2 depends on the bits of a type that nobody knows",
    "BYTE#300": "300 does not fit into BYTE",
    "USINT#-1 + 5": "-1 does not fit into USINT",
    "INT#16#FFFF": "65535 does not fit into INT",
    "-INT#32768 + 32770": "32768 does not fit into INT",
    "BYTE#300 - 290": "300 does not fit into BYTE",
    "MAX(1, DINT#3_000_000_000 - DINT#2_999_999_999)": "3000000000 does not fit into DINT",
}


@pytest.mark.parametrize("text", NOT_KNOWN)
def test_what_depends_on_bits_that_nobody_knows_is_not_known(text: str, tmp_path: Path) -> None:
    definition = declared(f"{WIDTHS} VAR_GLOBAL x : ARRAY [0..{text}] OF BYTE; y : INT; END_VAR", tmp_path)
    (flaw,) = definition.flaws_of(definition.lists)
    assert isinstance(flaw, Problem)
    assert (flaw.what, flaw.position.line) == (NOT_KNOWN[text], 7)
    assert [size_bytes_of(variable.type) for variable in definition.lists[0].variables] == [0, 2]


@pytest.mark.parametrize(
    ("constant", "what"),
    [
        ("N : INT := 40000", "40000 does not fit into INT"),
        ("N : UINT := -1", "-1 does not fit into UINT"),
        ("N : INT(0..10) := 20", "20 does not fit into INT"),
        ("N : Small := 101", "101 does not fit into USINT"),
        ("N : Again := 101", "101 does not fit into USINT"),
        ("N : BYTE := BYTE#300 - 100", "300 does not fit into BYTE"),
        ("N : INT := 2.5", "a constant integer is expected"),
        ("M : INT := 40000; N : DINT := M", "40000 does not fit into INT"),
    ],
)
def test_a_constant_that_its_type_does_not_hold_is_no_bound(constant: str, what: str, tmp_path: Path) -> None:
    types = "TYPE Small : USINT(0..100); Again : Small; END_TYPE"
    text = f"{types}\nVAR_GLOBAL CONSTANT {constant}; END_VAR\nVAR_GLOBAL x, y : ARRAY [0..N] OF INT; z : INT; END_VAR"
    definition = declared(text, tmp_path)
    (flaw,) = definition.flaws_of(definition.lists)
    assert isinstance(flaw, Problem)
    assert (flaw.what, flaw.position.line) == (what, 2)
    assert [size_bytes_of(variable.type) for variable in definition.lists[-1].variables] == [0, 0, 2]


def test_what_no_bound_needs_may_have_any_initial_value(tmp_path: Path) -> None:
    text = "VAR_GLOBAL CONSTANT N : INT := 40000; END_VAR VAR_GLOBAL a : BYTE := BYTE#300; b : INT(0..3) := 9; END_VAR"
    definition = declared(text, tmp_path)
    assert definition.flaws_of(definition.lists) == []
    assert [shown(variable.type) for variable in definition.lists[-1].variables] == ["BYTE", "INT(0..3)"]
