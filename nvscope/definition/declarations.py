"""The parser of declarations: text to syntax nodes, with one grammar for all formats that hold text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any

from lark import Lark, Token, UnexpectedToken
from msgspec import Struct
from msgspec.structs import replace

from nvscope.definition.comments import Attribute, blank, blank_comments
from nvscope.definition.lexer import KEYWORDS, DeclarationLexer, NoToken
from nvscope.definition.model import Problem
from nvscope.definition.program_units import (
    blank_program_units,
    data_blocks,
    holds_configurations,
    holds_program_units,
    keep_data_blocks,
)
from nvscope.definition.source import DefinitionError, Source
from nvscope.definition.syntax import (
    Call,
    Declaration,
    Expression,
    GlobalBlock,
    InvalidType,
    Name,
    Operation,
    TypeDeclaration,
)
from nvscope.definition.syntax_nodes import MAX_DEPTH, SyntaxNodes, TooDeepError
from nvscope.errors import ConfigurationError
from nvscope.grammar import Grammar

_TERMINALS = frozenset(KEYWORDS.values())
_SYMBOLS = {
    "_SEMICOLON": "';'", "_ASSIGN": "':='", "_RANGE": "'..'", "COLON": "':'", "COMMA": "','", "LPAR": "'('",
    "RPAR": "')'", "LSQB": "'['", "RSQB": "']'", "NAME": "a name", "INTEGER": "a number", "_ADDRESS": "an address",
    "$END": "the end of the text",
}  # fmt: skip
# What continues a value, and the further ways to begin one, would hide what is missing.
_BRACKETS = frozenset({"LPAR", "LSQB"})
_CONTINUATIONS = (
    "PLUS MINUS STAR SLASH MOD EQUAL LESSTHAN MORETHAN AMPERSAND CIRCUMFLEX DOT _OR _XOR _AND _NOT _UNEQUAL _AT_MOST "
    "_AT_LEAST TYPED TEXT TIME DATE REAL _REFERS _ARROW"
)
_UNSAID = frozenset(_CONTINUATIONS.split())
_SENT = re.compile(r"VAR_GLOBAL\b(?!\s+(?:(?:RETAIN|PERSISTENT)\s+)*CONSTANT\b)", re.IGNORECASE)
_MOST_ATTEMPTS = 20
_MOST_PARSED = 20_000_000
"""Characters that are parsed again for the sake of what can be read."""


class Declared(Struct, frozen=True):
    """What a text declares, in its order; ``left_out`` is what could not be read of it.

    ``recognised`` is False where nothing tells that the text is of this language: there are neither declarations nor
    comments, pragmas or program units.
    """

    types: tuple[TypeDeclaration, ...]
    blocks: tuple[GlobalBlock, ...]
    recognised: bool
    left_out: tuple[Problem, ...] = ()


def parse_declarations(
    source: Source,
    text: str | None = None,
    *,
    nested_comments: Callable[[int], bool] | None = None,
    only_data: bool = False,
) -> Declared:
    """Return what a file declares; ``text`` is its text with everything blanked that is no declaration.

    ``nested_comments`` tells whether comments that begin at an offset may hold others; without it all may.
    With ``only_data`` what stands between blocks of types and variables does not matter.
    Raises DefinitionError, with what was found and what was expected, where no block can be read.
    """
    whole = source.text if text is None else text
    without_comments, attributes = blank_comments(whole, source, nested=nested_comments)
    declarations, units = blank_program_units(without_comments)
    if only_data or holds_configurations(declarations):
        declarations = keep_data_blocks(declarations)
    parsed, left_out = _parsed(declarations, source)
    types = [replace(entry, source=source) for entry in parsed if isinstance(entry, TypeDeclaration)]
    types += [TypeDeclaration(Name(name, offset), None, source) for name, offset in units]
    found = sorted((entry for entry in parsed if isinstance(entry, GlobalBlock)), key=attrgetter("offset"))
    recognised = bool(types or found) or _is_only_commented(whole, without_comments)
    blocks = tuple(_with_attributes(found, attributes) if attributes else found)
    return Declared(tuple(types), blocks, recognised, tuple(left_out))


def _parsed(text: str, source: Source) -> tuple[list[TypeDeclaration | GlobalBlock], list[Problem]]:
    """Return what a text declares, and the problems of blocks that cannot be read; of variables, a block of no type."""
    left_out: list[Problem] = []
    unread: list[TypeDeclaration | GlobalBlock] = []
    blocks = data_blocks(text)
    for attempt in range(1, _MOST_ATTEMPTS + 1):
        try:
            return [*_parse(text, source), *unread], left_out
        except DefinitionError as error:
            offset = source.line_starts[error.position.line - 1] + error.position.column - 1
            broken = next((block for block in blocks if block[0] <= offset <= block[1]), None)
            last = attempt == _MOST_ATTEMPTS or attempt * len(text) > _MOST_PARSED
            if broken is None or len(blocks) < 2 or last:
                raise
            blocks.remove(broken)
            begin, end = broken
            if _SENT.match(text, begin):
                # Where its list is known, nobody knows what the list sends from here on.
                nothing = Declaration((Name("?", offset),), InvalidType(error.problem))
                unread.append(GlobalBlock(begin, constant=False, declarations=(nothing,)))
            else:
                left_out.append(error.problem)
            text = text[:begin] + blank(text[begin:end]) + text[end:]
    raise AssertionError("the last attempt returns or raises")


def _parse(text: str, source: Source) -> list[TypeDeclaration | GlobalBlock]:
    try:
        parsed: Any = _parser().parse(text, start="start")
    except TooDeepError as error:
        next_step = "Declare the inner types with names of their own."
        raise source.error(f"types are nested deeper than {MAX_DEPTH}", error.offset, next_step) from None
    except NoToken as error:
        raise _no_token(text[error.offset], error.offset, source) from None
    except UnexpectedToken as error:
        raise _readable(error, source, text) from None
    blocks: list[TypeDeclaration | GlobalBlock] = parsed
    return blocks


def _is_only_commented(text: str, without_comments: str) -> bool:
    """Return whether a text that declares nothing is of the language all the same."""
    rest = without_comments.strip()
    return holds_program_units(rest) if rest else bool(text.strip())


def parse_expression(text: str, source: Source, offset: int) -> Expression:
    """Return a constant expression that stands alone, as in an attribute of XML at ``offset``."""
    try:
        parsed: Any = _parser().parse(text, start="argument")
    except (UnexpectedToken, NoToken, TooDeepError):
        next_step = "Write a number, or an expression of constants."
        raise source.error(f"'{text[:60]}' is no value", offset, next_step) from None
    return _moved(parsed, offset)


def _moved(expression: Expression, offset: int) -> Expression:
    if isinstance(expression, Operation):
        left, right = _moved(expression.left, offset), _moved(expression.right, offset)
        return replace(expression, left=left, right=right, offset=offset)
    if isinstance(expression, Call):
        return replace(
            expression, arguments=tuple(_moved(each, offset) for each in expression.arguments), offset=offset
        )
    return replace(expression, offset=offset)


@cache
def _parser() -> Lark:
    return grammar().parser()


def grammar() -> Grammar:
    """Return the grammar of declarations, with what makes tokens and nodes of a text."""
    return Grammar(
        Path(__file__).with_name("declarations.lark"),
        {"start": ["start", "argument"], "maybe_placeholders": True},
        {"lexer": DeclarationLexer, "transformer": SyntaxNodes()},
    )


def _with_attributes(blocks: Sequence[GlobalBlock], attributes: Sequence[Attribute]) -> Iterator[GlobalBlock]:
    """Yield the blocks, each variable with the attributes that stand between it and what is declared before it."""
    waiting = list(reversed(attributes))
    for block in blocks:
        _taken(waiting, block.offset)
        declarations = []
        for declaration in block.declarations:
            own = _taken(waiting, declaration.names[0].offset)
            declarations.append(replace(declaration, attributes=own) if own else declaration)
        yield replace(block, declarations=tuple(declarations))


def _taken(waiting: list[Attribute], before: int) -> dict[str, str]:
    taken = {}
    while waiting and waiting[-1].offset < before:
        attribute = waiting.pop()
        taken[attribute.name] = attribute.value
    return taken


def _no_token(character: str, offset: int, source: Source) -> ConfigurationError:
    if character == "{":
        # Of all pragmas only those with conditions are left.
        what = "what is declared here depends on a condition that only the compiler knows"
        return source.error(what, offset, "Keep only the branch that the controller compiles, without the pragmas.")
    return source.error(f"found '{character}', which no declaration holds", offset, "Remove it.")


def _readable(error: UnexpectedToken, source: Source, text: str) -> ConfigurationError:
    token: Token = error.token
    ends = token.type == "$END"
    offset = len(text.rstrip()) if ends else token.start_pos or 0
    found = "the end of the text" if ends else repr(str(token)[:40])
    accepted = error.accepts or error.expected
    if token.type == "EQUAL" and "_ASSIGN" in accepted:
        return source.error("found '=', expected ':='", offset, "An initial value stands behind ':='.")
    words = _expected(accepted)
    return source.error(f"found {found}, expected {words}", offset, _next_step(token, words))


def _expected(terminals: Iterable[str]) -> str:
    found = set(terminals)
    if {"ARRAY", "STRUCT"} & found:
        return "a type"
    if "INTEGER" in found:
        found = {"INTEGER", "NAME"}
    elif {"_END_VAR", "_END_TYPE", "_END_STRUCT", "_END_UNION", "_TYPE", "VAR_GLOBAL"} & found:
        # A further semicolon may always stand behind another.
        found -= {"_SEMICOLON", "_ASSIGN", "$END"}
    elif found - (_BRACKETS | _UNSAID):
        found -= _BRACKETS
    if "_SEMICOLON" in found:
        found = {"_SEMICOLON"}
    words = [_SYMBOLS.get(name) or name.lstrip("_") for name in found - _UNSAID]
    words.sort(key=lambda word: (word.isupper(), word))
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words) or "something else"


def _next_step(token: Token, expected: str) -> str:
    if token.type == "$END":
        return "Perhaps the text was cut off: export the file again."
    if token.type in _TERMINALS:
        word = str(token)[:40]
        if "a name" in expected:
            return f"{word} is a word of the language and cannot be a name."
    if "';'" in expected:
        return "Perhaps the ';' of the declaration before is missing."
    return "Correct the declaration, or export the file again."
