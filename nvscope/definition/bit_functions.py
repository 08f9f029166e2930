"""Functions of an operand's bits: a bare number may be of any type that holds it, so that few are known of that."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from types import MappingProxyType

from nvscope.definition.operands import (
    INTEGERS,
    MOST_BITS,
    NO_INTEGER,
    NOT_64_BITS,
    OF_CONTROLLER,
    OF_TYPE,
    Operand,
    Result,
    bits_of,
    of_kind,
)
from nvscope.definition.variables import ScalarKind


def _bitwise(compute: Callable[[int, int], int]) -> Callable[[Operand, Operand], Result]:
    def of(left: Operand, right: Operand) -> Result:
        a, b = left.value, right.value
        if isinstance(a, float) or isinstance(b, float) or isinstance(a, bool) is not isinstance(b, bool):
            return NO_INTEGER
        # Which bits a negative number has, its type decides.
        known = left.kind is not None and left.kind == right.kind
        return of_kind(compute(a, b), left, right) if known or (a >= 0 and b >= 0) else OF_TYPE

    return of


def negated(operand: Operand) -> Result:
    value, kind = operand.value, operand.kind
    if isinstance(value, bool):
        return Operand(not value)
    if isinstance(value, float):
        return NO_INTEGER
    if kind is None or kind.kind not in INTEGERS:
        return OF_TYPE
    return Operand(~value if kind.kind is ScalarKind.SIGNED else ~value & _mask(bits_of(operand)), kind)


def _shifted(compute: Callable[[Operand, int, int], Result]) -> Callable[[Operand, Operand], Result]:
    """Return a function of an operand's bits, given with the number of places."""

    def of(operand: Operand, places: Operand) -> Result:
        value, by = operand.value, places.value
        if isinstance(value, float) or isinstance(by, float):
            return NO_INTEGER
        if by < 0 or by > MOST_BITS:
            return NOT_64_BITS
        if not value or not by:
            return operand
        return compute(operand, int(value), int(by)) if value > 0 else _unsure(operand)

    return of


def _unsure(operand: Operand) -> str:
    """Return why nobody knows what becomes of an operand whose bits leave it."""
    return OF_TYPE if operand.kind is None else OF_CONTROLLER


def _mask(bits: int) -> int:
    return (1 << bits) - 1


def _has_bits(operand: Operand) -> bool:
    """Return whether an operand is surely of a type of so many bits, none of which is a sign."""
    return operand.kind is not None and operand.kind.kind is ScalarKind.UNSIGNED


def _stays(operand: Operand, value: int) -> bool:
    """Return whether no bit of a shifted value leaves the operand, or becomes its sign."""
    signed = operand.kind is not None and operand.kind.kind is ScalarKind.SIGNED
    return value.bit_length() <= bits_of(operand) - signed


def _shifted_left(operand: Operand, value: int, places: int) -> Result:
    if places < bits_of(operand):
        if _stays(operand, value << places):
            return Operand(value << places, operand.kind)
        if _has_bits(operand):
            return Operand(value << places & _mask(bits_of(operand)), operand.kind)
    return _unsure(operand)


def _shifted_right(operand: Operand, value: int, places: int) -> Result:
    return Operand(value >> places, operand.kind) if places < bits_of(operand) else _unsure(operand)


def _rotated_left(operand: Operand, value: int, places: int) -> Result:
    bits = bits_of(operand)
    if _has_bits(operand):
        places %= bits
        return Operand((value << places | value >> bits - places) & _mask(bits), operand.kind)
    return Operand(value << places, operand.kind) if _stays(operand, value << places) else _unsure(operand)


def _rotated_right(operand: Operand, value: int, places: int) -> Result:
    bits = bits_of(operand)
    if _has_bits(operand):
        return _rotated_left(operand, value, bits - places % bits)
    stays = places < bits and not value & _mask(places)
    return Operand(value >> places, operand.kind) if stays else _unsure(operand)


BITWISE: Mapping[str, Callable[[Operand, Operand], Result]] = MappingProxyType(
    {
        "AND": _bitwise(operator.and_),
        "&": _bitwise(operator.and_),
        "AND_THEN": _bitwise(operator.and_),
        "OR": _bitwise(operator.or_),
        "OR_ELSE": _bitwise(operator.or_),
        "XOR": _bitwise(operator.xor),
    }
)
"""Operators between the bits of two operands, in capitals."""

SHIFTS: Mapping[str, Callable[[Operand, Operand], Result]] = MappingProxyType(
    {
        "SHL": _shifted(_shifted_left),
        "SHR": _shifted(_shifted_right),
        "ROL": _shifted(_rotated_left),
        "ROR": _shifted(_rotated_right),
    }
)
"""Functions of an operand and a number of places, in capitals."""
