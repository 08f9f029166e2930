"""Operators and functions of constant expressions, as a controller's compiler computes them.

Values are bool, int and float; reals are LREAL. What has no value, since it is none of 64 bits or depends on a type
that nobody knows, is a text that says so. Sources: IEC 61131-3 (conversions of reals round half to even), and the
CODESYS online help: the operators' pages (bits are shifted within the type of what is shifted, that of a bare number is
the smallest; a shift by more bits than that has depends on the controller), the page on typed literals (one that does
not fit is an error), and that on reference and flow (arithmetic has 32 bits at least, and nothing is cut off to less).
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from types import MappingProxyType

from nvscope.definition.bit_functions import BITWISE, SHIFTS, negated
from nvscope.definition.operands import (
    DINT,
    INTEGERS,
    LINT,
    MOST_BITS,
    NO_INTEGER,
    NOT_64_BITS,
    OF_TYPE,
    Operand,
    Result,
    Value,
    is_long,
    is_unsigned,
    of_kind,
)
from nvscope.definition.scalars import SCALARS, find_scalar
from nvscope.definition.variables import Scalar, ScalarKind

_UNTYPED = {"", "ANY"}
_CONVERTED = INTEGERS | {ScalarKind.BOOL, ScalarKind.REAL}


def conversion(function: str) -> tuple[list[Scalar], Scalar] | None:
    """Return the types of values and result of ``INT_TO_DINT``, ``TO_BYTE``, ``TRUNC``; None of what converts not.

    The types are elementary; there is none of values where the name tells none.
    """
    given, to, wanted = function.rpartition("TO_")
    if not to or (given and not given.endswith("_")):
        return None
    names = [name for name in (given.removesuffix("_"), wanted) if name not in _UNTYPED]
    types = [scalar for name in names if (scalar := find_scalar(name)) is not None and scalar.kind in _CONVERTED]
    return (types[:-1], types[-1]) if types and len(types) == len(names) and wanted not in _UNTYPED else None


def as_type(value: Value, kind: Scalar) -> Value:
    """Return a value as one of an elementary type, which may be too small for it; reals round half to even."""
    if kind.kind is ScalarKind.BOOL:
        return bool(value)
    if kind.kind is ScalarKind.REAL:
        return float(value)
    return round(value)


TRUNCATED: Mapping[str, Scalar] = MappingProxyType({"TRUNC": SCALARS["DINT"], "TRUNC_INT": SCALARS["INT"]})
"""The types of what functions make of a real by cutting it off."""


def _computed(
    compute: Callable[[Value, Value], Value | str], of_integers: Callable[[int, Operand, Operand], Result]
) -> Callable[[Operand, Operand], Result]:
    """Return what two operands make; what that is where it is no real hangs on their types."""

    def of(left: Operand, right: Operand) -> Result:
        value = compute(left.value, right.value)
        if isinstance(value, str):
            return value
        return Operand(value) if isinstance(value, float) else of_integers(value, left, right)

    return of


def _arithmetic(compute: Callable[[Value, Value], Value | str]) -> Callable[[Operand, Operand], Result]:
    """Return a sum, difference or product of operands, which is unknown where it is not the same in all widths."""

    def of_integers(value: int, left: Operand, right: Operand) -> Result:
        long = is_long(left) or is_long(right)
        unsigned = any(is_unsigned(each, size) for each in (left, right) for size in ((8,) if long else (4, 8)))
        low, high = LINT if long else DINT
        if unsigned:
            low, high = 0, 2 * high + 1
        if not low <= value <= high:
            return OF_TYPE if abs(value) >> MOST_BITS == 0 else NOT_64_BITS
        found = of_kind(value, left, right)
        # What is shorter than 32 bits is computed with more.
        return found if found.kind is not None and found.kind.size_bytes >= 4 else Operand(value)

    return _computed(compute, of_integers)


def _divided(compute: Callable[[Value, Value], Value | str]) -> Callable[[Operand, Operand], Result]:
    """Return a quotient or remainder, which is unknown of a negative and an unsigned number of 32 bits or more."""

    def of_integers(value: int, left: Operand, right: Operand) -> Result:
        unsigned = any(is_unsigned(each, size) for each in (left, right) for size in (4, 8))
        return OF_TYPE if unsigned and min(left.value, right.value) < 0 else of_kind(value, left, right)

    return _computed(compute, of_integers)


def quotient(left: Value, right: Value) -> Value:
    """Return a quotient, of integers cut off towards zero."""
    if isinstance(left, float) or isinstance(right, float):
        return left / right
    whole = abs(left) // abs(right)
    return whole if (left < 0) == (right < 0) else -whole


def _remainder(left: Value, right: Value) -> Value | str:
    if isinstance(left, float) or isinstance(right, float):
        return NO_INTEGER
    return left - right * quotient(left, right)


def _compared(compute: Callable[[Value, Value], bool]) -> Callable[[Operand, Operand], Result]:
    return lambda left, right: Operand(compute(left.value, right.value))


def _power(base: Operand, exponent: Operand) -> Result:
    a, b = base.value, exponent.value
    if isinstance(a, float) or isinstance(b, float):
        try:
            return Operand(math.pow(a, b))
        except (ValueError, OverflowError):
            return NO_INTEGER
    # What does not fit into 64 bits is not computed: it could have any number of digits.
    if b < 0 or (abs(a) > 1 and b > MOST_BITS):
        return NOT_64_BITS
    return Operand(int(a**b))


def _absolute(operand: Operand) -> Result:
    return of_kind(abs(operand.value), operand)


def _one_of(choose: Callable[..., Value]) -> Callable[..., Result]:
    """Return a function that gives one of its operands."""
    return lambda *operands: of_kind(choose(*(operand.value for operand in operands)), *operands)


def _selected(chosen: Operand, first: Operand, second: Operand) -> Result:
    value = (second if chosen.value else first).value
    return of_kind(value, first, second) if chosen.value in (0, 1) else NO_INTEGER


def _multiplexed(place: Operand, *operands: Operand) -> Result:
    number = place.value
    if isinstance(number, float) or number < 0 or not operands:
        return NO_INTEGER
    # One beyond the last chooses the last.
    return of_kind(operands[min(number, len(operands) - 1)].value, *operands)


def _sum(*operands: Operand) -> Result:
    total: Result = Operand(0, operands[0].kind)
    for operand in operands:
        total = total if isinstance(total, str) else OPERATORS["+"](total, operand)
    return total


OPERATORS: Mapping[str, Callable[[Operand, Operand], Result]] = MappingProxyType(
    {
        "+": _arithmetic(operator.add),
        "-": _arithmetic(operator.sub),
        "*": _arithmetic(operator.mul),
        "/": _divided(quotient),
        "MOD": _divided(_remainder),
        **BITWISE,
        "=": _compared(operator.eq),
        "<>": _compared(operator.ne),
        "<": _compared(operator.lt),
        ">": _compared(operator.gt),
        "<=": _compared(operator.le),
        ">=": _compared(operator.ge),
    }
)
"""Operators between two values, in capitals; what is divided by is not 0."""

FUNCTIONS: Mapping[tuple[str, int | None], Callable[..., Result]] = MappingProxyType(
    {
        ("NOT", 1): negated,
        ("ABS", 1): _absolute,
        ("MIN", None): _one_of(lambda *values: min(values)),
        ("MAX", None): _one_of(lambda *values: max(values)),
        ("LIMIT", 3): _one_of(lambda low, value, high: min(max(value, low), high)),
        ("SEL", 3): _selected,
        ("MUX", None): _multiplexed,
        ("EXPT", 2): _power,
        **{(name, 2): compute for name, compute in SHIFTS.items()},
        ("ADD", None): _sum,
        ("SUB", 2): OPERATORS["-"],
    }
)
"""Functions by name in capitals and number of arguments (None: any)."""
