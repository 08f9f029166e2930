"""Array bounds and string lengths that are not plain numbers: where they stand, and which variables have them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec import Struct

from nvscope.definition.constants import SIZE_FUNCTIONS
from nvscope.definition.position import Position
from nvscope.definition.scalars import find_scalar
from nvscope.definition.source import Source
from nvscope.definition.syntax import (
    ArrayType,
    Call,
    Declaration,
    Expression,
    ListSyntax,
    Name,
    Operation,
    StringType,
    StructureType,
    TypeDeclaration,
    TypeOperand,
    TypeSyntax,
)
from nvscope.definition.type_names import names_in
from nvscope.definition.written import expression_text

_NOWHERE = Source("", "")


class NamedSize(Struct, frozen=True):
    """A bound or length that depends on a constant.

    ``what`` it is, of which ``variable`` (with its type, where it is a member), in which list (empty: a type), and the
    ``text`` that stands there.
    """

    position: Position
    list_name: str
    variable: str
    what: str
    text: str


def named_sizes(lists: Iterable[ListSyntax], types: Iterable[TypeDeclaration]) -> Iterator[NamedSize]:
    """Yield the bounds and lengths of types and lists that depend on constants, in their order."""
    for declaration in types:
        if declaration.type is not None:
            yield from _of_type(declaration.type, declaration.name.text, declaration.source, "")
    for entry in lists:
        for block in entry.blocks:
            for variable in block.declarations if not block.constant else ():
                yield from _of_declaration(variable, "", entry.source, entry.name)


def _of_declaration(declaration: Declaration, prefix: str, source: Source, list_name: str) -> Iterator[NamedSize]:
    names = ", ".join(name.text for name in declaration.names[:3])
    yield from _of_type(declaration.type, f"{prefix}{names}", source, list_name)


def _of_type(syntax: TypeSyntax, name: str, source: Source, list_name: str) -> Iterator[NamedSize]:
    if isinstance(syntax, StringType) and syntax.length is not None:
        yield from _of_size(syntax.length, "the length", name, source, list_name)
    elif isinstance(syntax, ArrayType):
        for low, high in syntax.bounds:
            yield from _of_size(low, "the lower bound", name, source, list_name)
            yield from _of_size(high, "the upper bound", name, source, list_name)
        yield from _of_type(syntax.element, name, source, list_name)
    elif isinstance(syntax, StructureType):
        for member in syntax.members:
            yield from _of_declaration(member, f"{name}.", source, list_name)


def _of_size(expression: Expression, what: str, name: str, source: Source, list_name: str) -> Iterator[NamedSize]:
    if _depends(expression):
        yield NamedSize(source.position(expression.offset), list_name, name, what, expression_text(expression))


def _depends(expression: Expression) -> bool:
    """Return whether the value of an expression is that of a name; a sum of numbers is the same on both sides."""
    if isinstance(expression, Operation):
        return _depends(expression.left) or _depends(expression.right)
    if isinstance(expression, Call) and expression.function.upper() in SIZE_FUNCTIONS:
        return any(map(_is_declared, expression.arguments))
    if isinstance(expression, Call):
        return any(map(_depends, expression.arguments))
    return isinstance(expression, Name) and expression.text.upper() not in {"TRUE", "FALSE"}


def _is_declared(operand: Expression) -> bool:
    """Return whether the size of a type is not that of an elementary one, and depends on what is declared."""
    if isinstance(operand, TypeOperand):
        found = _of_type(operand.type, "", _NOWHERE, "")
        return any(found) or any(find_scalar(name) is None for name in names_in(operand.type))
    return not isinstance(operand, Name) or find_scalar(operand.text) is None
