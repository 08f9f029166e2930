"""Initial values that are written as a number which their type cannot hold, whatever it stands for.

A number with the bits of a type may be meant as that (``INT := 16#FFFF``): it is none of these. What hangs on names is
not looked at, nor are values of what is declared elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from nvscope.definition.operands import INTEGERS, bounds_of
from nvscope.definition.position import Position
from nvscope.definition.scalars import find_scalar
from nvscope.definition.syntax import ListSyntax, NamedType, Number, TypeSyntax
from nvscope.definition.variables import Scalar


@dataclass(frozen=True, slots=True)
class InitialValue:
    """A value that does not fit, the ``variable`` or constant that has it, and its type."""

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
                number = declaration.initial
                if not isinstance(number, Number):
                    continue
                kind, own = _kind_of(declaration.type), number.kind
                if own is not None and not _may_hold(own, number.value, literal=True):
                    kind = own
                elif kind is None or _may_hold(kind, number.value):
                    continue
                position, name = entry.source.position(number.offset), declaration.names[0].text
                yield InitialValue(position, entry.name, name, number.value, kind)


def _kind_of(syntax: TypeSyntax) -> Scalar | None:
    """Return an elementary type as it is written, with the bounds of its subrange where these are numbers."""
    if not isinstance(syntax, NamedType) or syntax.generic:
        return None
    kind = find_scalar(syntax.name.text)
    if kind is not None and isinstance(syntax.low, Number) and isinstance(syntax.high, Number):
        return replace(kind, low=syntax.low.value, high=syntax.high.value)
    return kind


def _may_hold(kind: Scalar, value: int, *, literal: bool = False) -> bool:
    """Return whether a type may hold a value, as its bits too; no ``literal`` without a sign is negative."""
    if kind.kind not in INTEGERS:
        return True
    low, high = bounds_of(kind)
    bits = kind.size_bytes * 8
    least = low if literal else -(1 << bits - 1)
    return low <= value <= high or (kind.low is None and least <= value < 1 << bits)
