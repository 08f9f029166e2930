"""The tables that are kept beside the grammars: in step with them, and without effect on what is parsed."""

from __future__ import annotations

import json
import shutil
from importlib.metadata import version
from pathlib import Path

import pytest

from nvscope.definition import declarations
from nvscope.definition.source import Source
from nvscope.expression import syntax
from nvscope.grammar import Grammar
from tests.grammar_tables import grammars
from tests.records import replace

EACH = pytest.mark.parametrize("grammar", grammars(), ids=lambda grammar: grammar.path.stem)
DECLARATIONS = """TYPE Axis : STRUCT pos : ARRAY [0..2, 1..2] OF LREAL; END_STRUCT END_TYPE
VAR_GLOBAL CONSTANT n : INT := 2 * (3 + 4); END_VAR
VAR_GLOBAL a, b : REAL; s AT %MB0 : STRING(n); e : (eOff, eOn := 5) BYTE; END_VAR"""


@EACH
def test_tables_are_in_step_with_their_grammar(grammar: Grammar) -> None:
    stored = grammar.tables_path.read_text(encoding="utf-8")
    text = grammar.path.read_text(encoding="utf-8")
    again = "the tables are not of this grammar: run `python -m tests.grammar_tables`"
    assert json.loads(stored)["of"] | {"lark": ""} == grammar.origin(text) | {"lark": ""}, again
    if json.loads(stored)["of"]["lark"] == version("lark"):
        assert stored == grammar.tables(), again


def tree_of(parser: object, grammar: Grammar) -> object:
    if grammar.path.stem == "expression":
        return syntax_parser(parser, "nv.index in {1..4, 7} && !(nv.items[1:2] contains 05:06) || x == T#5s")
    return syntax_parser(parser, DECLARATIONS, start="start")


def syntax_parser(parser: object, text: str, **options: str) -> object:
    return parser.parse(text, **options)  # type: ignore[attr-defined]


@EACH
def test_a_parser_from_tables_parses_as_one_from_the_grammar(grammar: Grammar, tmp_path: Path) -> None:
    alone = replace(grammar, path=tmp_path / grammar.path.name)
    shutil.copy(grammar.path, alone.path)
    assert not alone.tables_path.exists()
    assert tree_of(alone.parser(), alone) == tree_of(grammar.parser(), grammar)


@EACH
@pytest.mark.parametrize("kept", ["", "[]", "{", '{"of": {}}', '{"of": {"lark": "0.0"}}', "\0"])
def test_tables_of_something_else_are_left_aside(grammar: Grammar, kept: str, tmp_path: Path) -> None:
    other = replace(grammar, path=tmp_path / grammar.path.name)
    shutil.copy(grammar.path, other.path)
    other.tables_path.write_text(kept, encoding="utf-8")
    assert tree_of(other.parser(), other) == tree_of(grammar.parser(), grammar)


def test_tables_of_another_text_are_left_aside(tmp_path: Path) -> None:
    grammar = syntax.grammar()
    other = replace(grammar, path=tmp_path / grammar.path.name)
    other.path.write_text(grammar.path.read_text(encoding="utf-8").replace('"&&"', '"AND ALSO"'), encoding="utf-8")
    shutil.copy(grammar.tables_path, other.tables_path)
    assert other.parser().parse("a AND ALSO b").data == "conjunction"


def test_the_program_parses_from_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nvscope.grammar.Lark.__init__", None)  # what makes a parser from a grammar
    declarations._parser.cache_clear()
    syntax._parser.cache_clear()
    assert len(declarations.parse_declarations(Source("a.st", DECLARATIONS)).types) == 1
    syntax.parse("nv.index == 7")
