"""What the parser of declarations makes of its rules: syntax nodes, while the text is parsed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from lark import Token, Transformer, v_args
from msgspec.structs import replace

from nvscope.definition.scalars import find_scalar
from nvscope.definition.source import Source
from nvscope.definition.syntax import (
    ArrayType,
    Call,
    Declaration,
    EnumerationType,
    Expression,
    GlobalBlock,
    MemberValue,
    Name,
    NamedType,
    Number,
    Opaque,
    Operation,
    PointerType,
    Real,
    StringType,
    StructureType,
    TypeDeclaration,
    TypeOperand,
    TypeSyntax,
)
from nvscope.definition.variables import ScalarKind

MAX_DEPTH = 100
"""How deep types may be nested; beyond it an expression counts as no constant."""

_BASED = re.compile(r"(2|8|10|16)#([0-9A-Fa-f]+)")
_MOST_DIGITS = 80
_LONGEST_NAME = 1_000
_MOST_ARGUMENTS = 10
_COUNTED = frozenset({ScalarKind.UNSIGNED, ScalarKind.SIGNED, ScalarKind.BOOL})


class TooDeepError(Exception):
    """Types are nested deeper than is believed, at ``offset``."""

    def __init__(self, offset: int) -> None:
        super().__init__(offset)
        self.offset = offset


_NOWHERE = Source("", "")


def _offset(token: Token) -> int:
    return token.start_pos or 0


def _depth(offset: int, parts: Iterable[TypeSyntax]) -> int:
    depth = 1 + max((part.depth for part in parts), default=0)
    if depth > MAX_DEPTH:
        raise TooDeepError(offset)
    return depth


@v_args(inline=True)
class SyntaxNodes(Transformer[Token, Any]):
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

    member = variable

    def names(self, *tokens: Token) -> tuple[Name, ...]:
        return tuple(Name(str(token), _offset(token)) for token in tokens)

    def initial(self, *values: Expression) -> Expression:
        return values[0] if len(values) == 1 else _of_values(values[0].offset, values)

    def structure(self, keyword: Token, extends: Name | None, *members: Declaration) -> StructureType:
        offset = _offset(keyword)
        return StructureType(offset, members, extends, False, _depth(offset, (member.type for member in members)))

    def union(self, keyword: Token, *members: Declaration) -> StructureType:
        offset = _offset(keyword)
        return StructureType(offset, members, None, True, _depth(offset, (member.type for member in members)))

    def named(self, name: Name, *_: Any) -> NamedType:
        return NamedType(name)

    def generic(self, name: Name, *_: Any) -> NamedType:
        return NamedType(name, generic=True)

    def initial_values(self, *_: Any) -> None:
        return None

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
        if isinstance(value, Number) and value.kind is None:
            return Number(-value.value if sign == "-" else value.value, _offset(sign), based=value.based)
        return self.operation(Number(0, _offset(sign)), sign, value)

    disjunction = conjunction = comparison = operation

    def negation(self, value: Expression) -> Expression:
        depth = 1 + value.depth
        return Call("NOT", (value,), value.offset, depth) if depth <= MAX_DEPTH else Opaque(value.offset)

    def name(self, token: Token) -> Name:
        return Name(str(token), _offset(token))

    def number(self, token: Token) -> Expression:
        return _number(str(token), _offset(token))

    def real(self, token: Token) -> Expression:
        return _real(str(token), _offset(token))

    def typed(self, token: Token) -> Expression:
        return _typed(str(token), _offset(token))

    def other(self, first: Any = None, *others: Any) -> Expression:
        if isinstance(first, Token):
            return Opaque(_offset(first))
        return _of_values(getattr(first, "offset", 0), (first, *others))

    def group(self, *values: Expression | None) -> Expression:
        first = values[0] if values else None
        if first is None:
            return Opaque(next((value.offset for value in values if value is not None), 0))
        alone = len(values) == 1 and not isinstance(first, MemberValue)
        return first if alone else _of_values(first.offset, values)

    def attribute(self, value: Expression, name: Token) -> Expression:
        if not isinstance(value, Name) or len(value.text) > _LONGEST_NAME:
            return Opaque(value.offset)
        return Name(f"{value.text}.{name}", value.offset)

    def call(self, function: Expression, *arguments: Expression | None) -> Expression:
        values = tuple(value for value in arguments if value is not None)
        depth = 1 + max((value.depth for value in values), default=0)
        if isinstance(function, Name) and depth <= MAX_DEPTH and len(values) == len(arguments) <= _MOST_ARGUMENTS:
            return Call(function.text, values, function.offset, depth)
        # Behind a number, they are values of an array that many times.
        return _of_values(function.offset, values if isinstance(function, Number) else ())

    def type_operand(self, kind: StringType | ArrayType | PointerType) -> TypeOperand:
        return TypeOperand(kind, kind.offset)

    def indexed(self, value: Expression, *_: Any) -> Expression:
        return Opaque(value.offset)

    def argument(self, value: Expression) -> Expression:
        return value

    def assigned(self, name: Token, value: Expression) -> Expression:
        found = _of_values(_offset(name), (value,))
        return MemberValue(found.offset, found.values, found.nesting, str(name))


def _of_values(offset: int, values: Iterable[Any]) -> Opaque:
    """Return values of an array or a structure; of those that are nested too deep, nothing is known."""
    told = tuple(value for value in values if isinstance(value, Number) or (isinstance(value, Opaque) and value.values))
    nesting = 1 + max((value.nesting for value in told if isinstance(value, Opaque)), default=0)
    return Opaque(offset, told, nesting) if told and nesting <= MAX_DEPTH else Opaque(offset)


def _number(text: str, offset: int) -> Expression:
    digits = text.replace("_", "")
    base = 10
    if "#" in digits:
        based = _BASED.fullmatch(digits)
        if based is None:
            return Opaque(offset)
        base, digits = int(based[1]), based[2]
    try:
        return Number(int(digits, base), offset, based="#" in text) if len(digits) <= _MOST_DIGITS else Opaque(offset)
    except ValueError:
        return Opaque(offset)


def _real(text: str, offset: int) -> Expression:
    try:
        return Real(float(text.replace("_", "")), offset)
    except ValueError:
        return Opaque(offset)


def _typed(text: str, offset: int) -> Expression:
    """Return the value of ``INT#5``, ``WORD#16#FF``, ``REAL#2.5``, ``BOOL#TRUE`` or ``Color#red``."""
    prefix, _, value = text.partition("#")
    if prefix.upper() in {"REAL", "LREAL"}:
        return _real(value, offset)
    if prefix.upper() == "BOOL" and value.upper() in {"TRUE", "FALSE"}:
        return Name(value, offset)
    unsigned = value.lstrip("+-")
    if not unsigned[:1].isdecimal():
        return Name(f"{prefix}.{value}", offset) if unsigned == value and value.isidentifier() else Opaque(offset)
    number = _number(unsigned, offset)
    if not isinstance(number, Number):
        return number
    kind = find_scalar(prefix)
    typed = kind if kind is not None and kind.kind in _COUNTED else None
    return Number(-number.value if value[0] == "-" else number.value, offset, typed, number.based)
