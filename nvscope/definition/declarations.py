"""The parser of declarations: text to syntax nodes, with one grammar for all formats that hold text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from lark import Lark, Token, Transformer, UnexpectedToken, v_args

from nvscope.definition.comments import Attribute, blank_comments
from nvscope.definition.lexer import KEYWORDS, DeclarationLexer, NoToken
from nvscope.definition.program_units import blank_program_units, holds_program_units, keep_data_blocks
from nvscope.definition.source import Source
from nvscope.definition.syntax import (
    ArrayType,
    Conversion,
    Declaration,
    EnumerationType,
    Expression,
    GlobalBlock,
    Name,
    NamedType,
    Number,
    Opaque,
    Operation,
    PointerType,
    StringType,
    StructureType,
    TypeDeclaration,
    TypeSyntax,
)
from nvscope.errors import ConfigurationError
from nvscope.grammar import Grammar

MAX_DEPTH = 100
"""How deep types may be nested; beyond it an expression counts as no constant."""

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
_BASED = re.compile(r"(2|8|10|16)#([0-9A-Fa-f]+)")
_CONVERSION = re.compile(r"(?:\w+_)?TO_\w+", re.IGNORECASE)
_MOST_DIGITS = 80
_LONGEST_NAME = 1_000


@dataclass(frozen=True, slots=True)
class Declared:
    """What a text declares, in its order.

    ``recognised`` is False where nothing tells that the text is of this language: there are neither declarations nor
    comments, pragmas or program units.
    """

    types: tuple[TypeDeclaration, ...]
    blocks: tuple[GlobalBlock, ...]
    recognised: bool


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
    Raises ConfigurationError with position, what was found and what was expected.
    """
    whole = source.text if text is None else text
    without_comments, attributes = blank_comments(whole, source, nested=nested_comments)
    declarations, units = blank_program_units(without_comments)
    if only_data:
        declarations = keep_data_blocks(declarations)
    try:
        parsed: Any = _parser().parse(declarations, start="start")
    except _TooDeepError as error:
        next_step = "Declare the inner types with names of their own."
        raise source.error(f"types are nested deeper than {MAX_DEPTH}", error.offset, next_step) from None
    except NoToken as error:
        raise _no_token(declarations[error.offset], error.offset, source) from None
    except UnexpectedToken as error:
        raise _readable(error, source, declarations) from None
    blocks: list[TypeDeclaration | GlobalBlock] = parsed
    types = [replace(entry, source=source) for entry in blocks if isinstance(entry, TypeDeclaration)]
    types += [TypeDeclaration(Name(name, offset), None, source) for name, offset in units]
    found = [entry for entry in blocks if isinstance(entry, GlobalBlock)]
    recognised = bool(types or found) or _is_only_commented(whole, without_comments)
    return Declared(tuple(types), tuple(_with_attributes(found, attributes) if attributes else found), recognised)


def _is_only_commented(text: str, without_comments: str) -> bool:
    """Return whether a text that declares nothing is of the language all the same."""
    rest = without_comments.strip()
    return holds_program_units(rest) if rest else bool(text.strip())


def parse_expression(text: str, source: Source, offset: int) -> Expression:
    """Return a constant expression that stands alone, as in an attribute of XML at ``offset``."""
    try:
        parsed: Any = _parser().parse(text, start="argument")
    except (UnexpectedToken, NoToken, _TooDeepError):
        next_step = "Write a number, or an expression of constants."
        raise source.error(f"{text[:60]!r} is no value", offset, next_step) from None
    return _moved(parsed, offset)


def _moved(expression: Expression, offset: int) -> Expression:
    if isinstance(expression, Operation):
        left, right = _moved(expression.left, offset), _moved(expression.right, offset)
        return replace(expression, left=left, right=right, offset=offset)
    if isinstance(expression, Conversion):
        return replace(expression, value=_moved(expression.value, offset), offset=offset)
    return replace(expression, offset=offset)


@cache
def _parser() -> Lark:
    return grammar().parser()


def grammar() -> Grammar:
    """Return the grammar of declarations, with what makes tokens and nodes of a text."""
    return Grammar(
        Path(__file__).with_name("declarations.lark"),
        {"start": ["start", "argument"], "maybe_placeholders": True},
        {"lexer": DeclarationLexer, "transformer": _Nodes()},
    )


class _TooDeepError(Exception):
    def __init__(self, offset: int) -> None:
        super().__init__(offset)
        self.offset = offset


_NOWHERE = Source("", "")


def _offset(token: Token) -> int:
    return token.start_pos or 0


def _depth(offset: int, parts: Iterable[TypeSyntax]) -> int:
    depth = 1 + max((part.depth for part in parts), default=0)
    if depth > MAX_DEPTH:
        raise _TooDeepError(offset)
    return depth


@v_args(inline=True)
class _Nodes(Transformer[Token, Any]):
    """Makes the nodes while the text is parsed, so that no tree is ever built. One method for each rule."""

    def start(self, *blocks: list[Any]) -> list[Any]:
        return [entry for block in blocks for entry in block]

    def type_block(self, *declarations: TypeDeclaration) -> list[TypeDeclaration]:
        return list(declarations)

    def type_declaration(self, *parts: Any) -> TypeDeclaration:
        name, (extends, body, _) = parts[-4], parts[-3:]
        if extends is not None and isinstance(body, StructureType):
            body = replace(body, extends=extends)
        return TypeDeclaration(Name(str(name), _offset(name)), body, _NOWHERE)

    def global_block(self, keyword: Token, *parts: str | Declaration) -> list[GlobalBlock]:
        declarations = tuple(part for part in parts if isinstance(part, Declaration))
        return [GlobalBlock(_offset(keyword), "CONSTANT" in parts, declarations)]

    def qualifier(self, token: Token) -> str:
        return token.type

    def variable(self, names: tuple[Name, ...], kind: TypeSyntax, initial: Expression | None) -> Declaration:
        return Declaration(names, kind, initial)

    def member(self, names: tuple[Name, ...], kind: TypeSyntax, _: Expression | None) -> Declaration:
        return Declaration(names, kind)

    def names(self, *tokens: Token) -> tuple[Name, ...]:
        return tuple(Name(str(token), _offset(token)) for token in tokens)

    def initial(self, *values: Expression) -> Expression:
        return values[0] if len(values) == 1 else Opaque(values[0].offset)

    def structure(self, keyword: Token, extends: Name | None, *members: Declaration) -> StructureType:
        offset = _offset(keyword)
        return StructureType(offset, members, extends, False, _depth(offset, (member.type for member in members)))

    def union(self, keyword: Token, *members: Declaration) -> StructureType:
        offset = _offset(keyword)
        return StructureType(offset, members, None, True, _depth(offset, (member.type for member in members)))

    def named(self, name: Name, *_: Any) -> NamedType:
        return NamedType(name)

    def subrange(self, name: Name, low: Expression, high: Expression) -> NamedType:
        return NamedType(name, low, high)

    def string(self, keyword: Token, length: Expression | None = None) -> StringType:
        return StringType(_offset(keyword), keyword.type == "WSTRING", length)

    def array(self, keyword: Token, *parts: Any) -> ArrayType:
        offset = _offset(keyword)
        return ArrayType(offset, tuple(parts[:-1]), parts[-1], _depth(offset, parts[-1:]))

    def range(self, low: Expression, high: Expression) -> tuple[Expression, Expression]:
        return low, high

    def pointer(self, keyword: Token, _: TypeSyntax) -> PointerType:
        return PointerType(_offset(keyword), keyword.type)

    def enumeration(self, *parts: Any) -> EnumerationType:
        values: tuple[tuple[Name, Expression | None], ...] = parts[:-1]
        return EnumerationType(values[0][0].offset, values, parts[-1])

    def enumerator(self, name: Token, value: Expression | None = None) -> tuple[Name, Expression | None]:
        return Name(str(name), _offset(name)), value

    def dotted(self, *parts: Token) -> Name:
        return Name(".".join(parts), _offset(parts[0]))

    def operation(self, left: Expression, operator: Token, right: Expression) -> Expression:
        depth = 1 + max(left.depth, right.depth)
        if depth > MAX_DEPTH:
            return Opaque(left.offset)
        return Operation(operator.upper(), left, right, left.offset, depth)

    product = operation

    def sign(self, sign: Token, value: Expression) -> Expression:
        if isinstance(value, Number):
            return Number(-value.value if sign == "-" else value.value, _offset(sign))
        return self.operation(Number(0, _offset(sign)), sign, value)

    def disjunction(self, left: Expression, *_: Any) -> Expression:
        return Opaque(left.offset)

    conjunction = comparison = disjunction

    def negation(self, value: Expression) -> Expression:
        return Opaque(value.offset)

    def name(self, token: Token) -> Name:
        return Name(str(token), _offset(token))

    def number(self, token: Token) -> Expression:
        return _number(str(token), _offset(token))

    def typed(self, token: Token) -> Expression:
        return _typed(str(token), _offset(token))

    def other(self, first: Any = None, *_: Any) -> Expression:
        return Opaque(_offset(first) if isinstance(first, Token) else getattr(first, "offset", 0))

    def group(self, *values: Expression | None) -> Expression:
        first = values[0]
        if first is None:
            return Opaque(next((value.offset for value in values if value is not None), 0))
        return first if len(values) == 1 else Opaque(first.offset)

    def attribute(self, value: Expression, name: Token) -> Expression:
        if not isinstance(value, Name) or len(value.text) > _LONGEST_NAME:
            return Opaque(value.offset)
        return Name(f"{value.text}.{name}", value.offset)

    def call(self, function: Expression, *arguments: Expression | None) -> Expression:
        value = arguments[0] if len(arguments) == 1 else None
        if value is not None and isinstance(function, Name) and _CONVERSION.fullmatch(function.text):
            depth = 1 + value.depth
            if depth <= MAX_DEPTH:
                return Conversion(function.text, value, function.offset, depth)
        return Opaque(function.offset)

    def indexed(self, value: Expression, *_: Any) -> Expression:
        return Opaque(value.offset)

    def argument(self, value: Expression) -> Expression:
        return value

    def assigned(self, name: Token, _: Expression) -> Expression:
        return Opaque(_offset(name))


def _number(text: str, offset: int) -> Expression:
    digits = text.replace("_", "")
    base = 10
    if "#" in digits:
        based = _BASED.fullmatch(digits)
        if based is None:
            return Opaque(offset)
        base, digits = int(based[1]), based[2]
    try:
        return Number(int(digits, base), offset) if len(digits) <= _MOST_DIGITS else Opaque(offset)
    except ValueError:
        return Opaque(offset)


def _typed(text: str, offset: int) -> Expression:
    """Return the value of ``INT#5``, ``WORD#16#FF``, ``BOOL#TRUE`` or ``Color#red``."""
    prefix, _, value = text.partition("#")
    if prefix.upper() == "BOOL" and value.upper() in {"TRUE", "FALSE"}:
        return Number(int(value.upper() == "TRUE"), offset)
    unsigned = value.lstrip("+-")
    if not unsigned[:1].isdecimal():
        return Name(f"{prefix}.{value}", offset) if unsigned == value and value.isidentifier() else Opaque(offset)
    number = _number(unsigned, offset)
    return Number(-number.value, offset) if isinstance(number, Number) and value[0] == "-" else number


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
    return source.error(f"found {character!r}, which no declaration holds", offset, "Remove it.")


def _readable(error: UnexpectedToken, source: Source, text: str) -> ConfigurationError:
    token: Token = error.token
    ends = token.type == "$END"
    offset = len(text.rstrip()) if ends else _offset(token)
    found = "the end of the text" if ends else repr(str(token)[:40])
    words = _expected(error.accepts or error.expected)
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
