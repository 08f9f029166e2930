"""Initial values that are written as a number which their type cannot hold, whatever it stands for.

A number with a base that has the bits of a type may be meant as these (``INT := 16#FFFF``): it is none of these. Those
of arrays and structures are looked at however they are nested; what hangs on the names of constants is not, nor are
values of what is declared in no file, or in several.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from nvscope.definition.declared_types import DeclaredTypes
from nvscope.definition.operands import INTEGERS, bounds_of
from nvscope.definition.position import Position
from nvscope.definition.scalars import find_scalar
from nvscope.definition.source import DefinitionError, Source
from nvscope.definition.syntax import (
    ArrayType,
    Declaration,
    Expression,
    FileSyntax,
    MemberValue,
    NamedType,
    Number,
    Opaque,
    StructureType,
    TypeSyntax,
)
from nvscope.definition.syntax_nodes import MAX_DEPTH
from nvscope.definition.variables import Scalar, ScalarKind


class InitialValue(Struct, frozen=True):
    """A value that does not fit, the ``variable`` or constant that has it, and its type, with the subrange it has.

    ``list_name`` is empty for the member of a declared type.
    """

    position: Position
    list_name: str
    variable: str
    value: int
    kind: Scalar


def misfits(files: Sequence[FileSyntax]) -> Iterator[InitialValue]:
    """Yield the initial values of variables, constants and members of types that do not fit, in their order.

    Of each declaration it is the first.
    """
    types = _declared(files)
    for file in files:
        for declared in file.types:
            members = declared.type.members if isinstance(declared.type, StructureType) else ()
            for member in members:
                yield from _misfits_of(member, types, declared.source, f"{declared.name.text}.", "")
        for entry in file.lists:
            for block in entry.blocks:
                for declaration in block.declarations:
                    yield from _misfits_of(declaration, types, entry.source, "", entry.name)


def _declared(files: Iterable[FileSyntax]) -> DeclaredTypes:
    types = DeclaredTypes()
    for declaration in (declaration for file in files for declaration in file.types):
        with suppress(DefinitionError):  # a name that none may have is told elsewhere
            types.add(declaration)
    return types


def _misfits_of(
    declaration: Declaration, types: DeclaredTypes, source: Source, within: str, list_name: str
) -> Iterator[InitialValue]:
    name = within + declaration.names[0].text
    waiting = [_Value(declaration.initial, declaration.type, source.file, name)]
    while waiting:
        one = waiting.pop()
        if isinstance(one.value, Number):
            kind = _type_not_held(one.value, _kind_of(_inmost(one, types)[0]))
            if kind is not None:
                yield InitialValue(source.position(one.value.offset), list_name, one.variable, one.value.value, kind)
                return
        elif isinstance(one.value, Opaque):
            waiting += [_part_of(one, value, types) for value in reversed(one.value.values)]


class _Value(NamedTuple):
    """A value, the type that it is for where that is known, and the file in which that type is written."""

    value: Expression | None
    type: TypeSyntax | None
    file: str
    variable: str


def _part_of(whole: _Value, value: Expression, types: DeclaredTypes) -> _Value:
    """Return one of the values that a value consists of: that of a member, or of an element of an array."""
    if not isinstance(value, MemberValue):
        return whole._replace(value=value)
    kind, file = _inmost(whole, types)
    found = _member(kind, file, value.name, types)
    return _Value(value.values[0], *found, f"{whole.variable}.{value.name}")


def _member(kind: TypeSyntax | None, file: str, name: str, types: DeclaredTypes) -> tuple[TypeSyntax | None, str]:
    """Return the type of a member of a structure, or of what that extends, and the file in which it is written."""
    for _ in range(MAX_DEPTH):
        if not isinstance(kind, StructureType):
            break
        for member in kind.members:
            if any(own.text.upper() == name.upper() for own in member.names):
                return member.type, file
        if kind.extends is None:
            break
        kind, file = _inmost(_Value(None, NamedType(kind.extends), file, ""), types)
    return None, file


def _inmost(value: _Value, types: DeclaredTypes) -> tuple[TypeSyntax | None, str]:
    """Return what is behind arrays and names of types, and the file in which that is written."""
    kind, file = value.type, value.file
    for _ in range(MAX_DEPTH):
        if isinstance(kind, ArrayType):
            kind = kind.element
        elif isinstance(kind, NamedType) and kind.low is None and not kind.generic and not find_scalar(kind.name.text):
            found = types.named(kind.name.text, file)
            if len(found) != 1:
                return None, file
            kind, file = found[0].type, found[0].source.file
        else:
            return kind, file
    return None, file


def _type_not_held(number: Number, kind: Scalar | None) -> Scalar | None:
    """Return the type that cannot hold a number: that in front of it, or that of its variable; None if both can."""
    if number.kind is not None and not _may_be(number.kind, number, literal=True):
        return number.kind
    return kind if kind is not None and not _may_be(kind, number) else None


def _kind_of(syntax: TypeSyntax | None) -> Scalar | None:
    """Return an elementary type, with the bounds of its subrange if these are numbers; None of all others."""
    if not isinstance(syntax, NamedType) or syntax.generic:
        return None
    kind = find_scalar(syntax.name.text)
    if kind is not None and isinstance(syntax.low, Number) and isinstance(syntax.high, Number):
        return replace(kind, low=syntax.low.value, high=syntax.high.value)
    return kind


def _may_be(kind: Scalar, number: Number, *, literal: bool = False) -> bool:
    """Return whether a number may be one of a type, or where it is written with a base or a type its bits.

    No ``literal`` with the prefix of a type without a sign is negative.
    """
    value, as_bits = number.value, number.based or (number.kind is not None and not literal)
    if kind.kind is ScalarKind.BOOL:
        return as_bits or 0 <= value <= 1
    if kind.kind not in INTEGERS:
        return True
    low, high = bounds_of(kind)
    if not as_bits:
        return low <= value <= high
    bits = kind.size_bytes * 8
    least = low if literal else -(1 << bits - 1)
    return low <= value <= high or (kind.low is None and least <= value < 1 << bits)
