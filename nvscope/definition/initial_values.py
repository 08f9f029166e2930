"""Initial values that are written as a number which their type cannot hold, whatever it stands for.

A number with a base that has the bits of a type may be meant as these (``INT := 16#FFFF``): it is none of these. Of an
array, numbers that stand alone are looked at; what hangs on names is not, nor are values of what is declared elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from nvscope.definition.operands import INTEGERS, bounds_of
from nvscope.definition.position import Position
from nvscope.definition.scalars import find_scalar
from nvscope.definition.syntax import ArrayType, Declaration, ListSyntax, NamedType, Number, Opaque, TypeSyntax
from nvscope.definition.variables import Scalar, ScalarKind


@dataclass(frozen=True, slots=True)
class InitialValue:
    """A value that does not fit, the ``variable`` or constant that has it, and its type, with the subrange it has."""

    position: Position
    list_name: str
    variable: str
    value: int
    kind: Scalar


def misfits(lists: Iterable[ListSyntax]) -> Iterator[InitialValue]:
    """Yield the initial values of variables and constants that do not fit, in their order."""
    for entry in lists:
        for block in entry.blocks:
            for declaration in block.declarations:
                found = _misfit_of(declaration)
                if found is not None:
                    number, kind = found
                    position, name = entry.source.position(number.offset), declaration.names[0].text
                    yield InitialValue(position, entry.name, name, number.value, kind)


def _misfit_of(declaration: Declaration) -> tuple[Number, Scalar] | None:
    """Return the first number that does not fit, and the type that cannot hold it."""
    kind, value = _kind_of(declaration.type), declaration.initial
    numbers = (value,) if isinstance(value, Number) else value.numbers if isinstance(value, Opaque) else ()
    for number in numbers:
        if number.kind is not None and not _may_be(number.kind, number, literal=True):
            return number, number.kind
        if kind is not None and not _may_be(kind, number):
            return number, kind
    return None


def _kind_of(syntax: TypeSyntax) -> Scalar | None:
    """Return an elementary type, or that of the elements of an array, with the bounds of its subrange if these are
    numbers.
    """
    while isinstance(syntax, ArrayType):
        syntax = syntax.element
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
