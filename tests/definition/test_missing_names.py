"""Names that no file declares, or not as what is needed, and blocks that begin where others end: nothing is lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.definition.load import load_definitions
from nvscope.definition.model import Problem, UnknownName
from tests.definition.declared import declared, shown


def test_names_of_libraries_that_no_file_declares_are_told_like_all_others(tmp_path: Path) -> None:
    text = (
        "TYPE S : STRUCT a : INT; b : Qux; END_STRUCT E : (x, y) Lib.Base; D EXTENDS Lib.Root : STRUCT c : INT; "
        "END_STRUCT END_TYPE FUNCTION_BLOCK Ring END_FUNCTION_BLOCK "
        "VAR_GLOBAL a : Foo; b : lib.ST_Foo; c : Other.T; d : Tc2_Standard.TON; e : ARRAY [1..SIZEOF(Bar)] OF BYTE; "
        "f : ARRAY [1..SIZEOF(ARRAY [0..1] OF Lib.Baz)] OF BYTE; g : ARRAY [1..SIZEOF(S)] OF BYTE; h : E; i : D; "
        "j : Lib.Trace<3>; k : Ring<3>; l : TOF; END_VAR"
    )
    found = declared(text, tmp_path)
    names = [flaw.name for flaw in found.flaws_of(found.lists) if isinstance(flaw, UnknownName)]
    assert names == ["Qux", "Lib.Base", "Lib.Root", "Foo", "lib.ST_Foo", "Other.T", "Bar", "Lib.Baz", "Lib.Trace"]
    assert len(found.flaws_of(found.lists)) == len(names)


@pytest.mark.parametrize("between", [" ", "; ", "\n", ";\n  "])
@pytest.mark.parametrize(
    "other",
    [
        "VAR_CONFIG a.b AT %IX0.0 : BOOL; END_VAR",
        "CONFIGURATION c VAR_ACCESS a : b.c : INT READ_ONLY; END_VAR END_CONFIGURATION",
        "CONFIGURATION c RESOURCE r ON PLC TASK t(INTERVAL := T#1s); PROGRAM p WITH t : q; END_RESOURCE "
        "END_CONFIGURATION",
        "PROGRAM p VAR i : INT; END_VAR i := i + 1; END_PROGRAM",
        "FUNCTION_BLOCK TYPES VAR s : STRING := ' TYPE X : INT; END_TYPE'; END_VAR END_FUNCTION_BLOCK",
    ],
    ids=["config", "access", "resource", "program", "block"],
)
def test_a_block_may_begin_where_another_ends(other: str, between: str, tmp_path: Path) -> None:
    blocks = ["VAR_GLOBAL x : T; y : U; END_VAR", "TYPE T : INT; END_TYPE", "TYPE U : DINT; END_TYPE"]
    for place in range(4):
        found = declared(between.join([*blocks[:place], other, *blocks[place:]]), tmp_path)
        assert found.flaws_of(found.lists) == []
        assert [shown(each.type) for each in found.lists[0].variables] == ["INT", "DINT"]


@pytest.mark.parametrize("content", [b"", b"\0\1\2" * 99, b"hello world", b"<html></html>", b"<GVL><Decl"])
@pytest.mark.parametrize("name", ["broken.gvl", "Broken.TcGVL"])
def test_a_broken_list_in_a_directory_is_told(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    (tmp_path / "notes.st").write_bytes(b"hello world")  # others call files so, too
    (tmp_path / "whole.st").write_text("VAR_GLOBAL a : INT; END_VAR", encoding="utf-8")
    found = load_definitions([str(tmp_path)])
    assert [problem.position.file for problem in found.left_out] == [str(tmp_path / name)]
    assert len(found.lists) == 1


def test_a_variable_is_no_constant(tmp_path: Path) -> None:
    for name, text in (
        ("a.st", "VAR_GLOBAL x : ARRAY [1..N] OF BYTE; y : STRING(g.n); z : INT(0..M); END_VAR"),
        ("b.st", "VAR_GLOBAL CONSTANT\n M : INT := 3; END_VAR VAR_GLOBAL\n N : INT := 3; M : INT := 4; END_VAR"),
    ):
        (tmp_path / name).write_text(text, encoding="utf-8")
    found = load_definitions([str(tmp_path)])
    where = tmp_path / "b.st"
    assert [(flaw.position.column, flaw.what) for flaw in found.flaws_of(found.lists) if isinstance(flaw, Problem)] == [
        (26, f"N is declared in {where}, line 3, but is not CONSTANT"),
        (49, f"g.n is declared in {where}, line 3, but is not CONSTANT"),
    ]
    assert [shown(each.type) for each in found.lists[0].variables][2] == "INT(0..3)"
