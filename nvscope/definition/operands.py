"""Operands: values of constant expressions with their types, and in how many bits a controller computes with them."""

from __future__ import annotations

from msgspec import Struct

from nvscope.definition.variables import Scalar, ScalarKind

Value = bool | int | float


class Operand(Struct, frozen=True):
    """A value, and its type where that is known: a bare number may be of any that holds it."""

    value: Value
    kind: Scalar | None = None


Result = Operand | str

INTEGERS = frozenset({ScalarKind.UNSIGNED, ScalarKind.SIGNED})
"""The kinds of elementary types that hold whole numbers."""

MOST_BITS = 64

_WIDTHS = (8, 16, 32, 64)
NOT_64_BITS = "is no integer of 64 bits"
NO_INTEGER = "is no constant integer"
OF_TYPE = "depends on the bits of a type that nobody knows"
OF_CONTROLLER = "depends on the controller"
DINT, UDINT, LINT = (-(1 << 31), (1 << 31) - 1), (0, (1 << 32) - 1), (-(1 << 63), (1 << 63) - 1)


def bounds_of(kind: Scalar) -> tuple[int, int]:
    """Return the least and the greatest value of an integer type, or of its subrange."""
    bits = kind.size_bytes * 8
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if kind.kind is ScalarKind.SIGNED else (0, (1 << bits) - 1)
    return low if kind.low is None else kind.low, high if kind.high is None else kind.high


def of_kind(value: Value, *operands: Operand) -> Operand:
    """Return a value with the type that all operands have, if it is one of that."""
    kind = operands[0].kind
    if kind is None or kind.kind not in INTEGERS or isinstance(value, float):
        return Operand(value)
    low, high = bounds_of(kind)
    alike = all(operand.kind == kind for operand in operands) and low <= value <= high
    return Operand(value, kind if alike else None)


def is_unsigned(operand: Operand, size_bytes: int) -> bool:
    """Return whether what an operand is computed as is an unsigned type of that size."""
    kind = operand.kind
    if kind is None or kind.kind not in INTEGERS:
        return operand.value > (DINT[1] if size_bytes == 4 else LINT[1])
    return kind.kind is ScalarKind.UNSIGNED and kind.size_bytes == size_bytes


def is_long(operand: Operand) -> bool:
    kind = operand.kind
    if kind is None or kind.kind not in INTEGERS:
        return not DINT[0] <= operand.value <= UDINT[1]
    return kind.size_bytes == 8


def bits_of(operand: Operand) -> int:
    """Return how many bits an operand has; of a bare number they are those of the smallest type."""
    if operand.kind is not None and operand.kind.kind in INTEGERS:
        return operand.kind.size_bytes * 8
    return next((bits for bits in _WIDTHS if int(operand.value).bit_length() <= bits), MOST_BITS)
