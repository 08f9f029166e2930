"""Operators and functions of constant expressions, as a controller's compiler computes them.

Values are bool, int and float; reals are LREAL. What has no value, since it is none of 64 bits or depends on a type
that nobody knows, is a text that says so. Sources: IEC 61131-3 (conversions of reals round half to even), and the
operators' pages of the CODESYS online help.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from types import MappingProxyType

from nvscope.definition.scalars import SCALARS, find_scalar
from nvscope.definition.variables import Scalar, ScalarKind

Value = bool | int | float
Result = Value | str

INTEGERS = frozenset({ScalarKind.UNSIGNED, ScalarKind.SIGNED})
"""The kinds of elementary types that hold whole numbers."""

_MOST_BITS = 64
_WIDTHS = (8, 16, 32, 64)
_UNTYPED = {"", "ANY"}
_CONVERTED = INTEGERS | {ScalarKind.BOOL, ScalarKind.REAL}

NOT_64_BITS = "is no integer of 64 bits"
NO_INTEGER = "is no constant integer"
_OF_TYPE = "depends on the bits of a type that nobody knows"


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


def quotient(left: Value, right: Value) -> Value:
    """Return a quotient, of integers cut off towards zero."""
    if isinstance(left, float) or isinstance(right, float):
        return left / right
    whole = abs(left) // abs(right)
    return whole if (left < 0) == (right < 0) else -whole


def _remainder(left: Value, right: Value) -> Result:
    if isinstance(left, float) or isinstance(right, float):
        return NO_INTEGER
    return left - right * quotient(left, right)


def _bitwise(compute: Callable[[int, int], int]) -> Callable[[Value, Value], Result]:
    def of(left: Value, right: Value) -> Result:
        if isinstance(left, float) or isinstance(right, float) or isinstance(left, bool) is not isinstance(right, bool):
            return NO_INTEGER
        # Which bits a negative number has, its type decides.
        return compute(left, right) if left >= 0 and right >= 0 else _OF_TYPE

    return of


def _negated(value: Value) -> Result:
    return not value if isinstance(value, bool) else NO_INTEGER if isinstance(value, float) else _OF_TYPE


def _power(base: Value, exponent: Value) -> Result:
    if isinstance(base, float) or isinstance(exponent, float):
        try:
            return math.pow(base, exponent)
        except (ValueError, OverflowError):
            return NO_INTEGER
    # What does not fit into 64 bits is not computed: it could have any number of digits.
    if exponent < 0 or (abs(base) > 1 and exponent > _MOST_BITS):
        return NOT_64_BITS
    return int(base**exponent)


def _whole(compute: Callable[[int, int], Result]) -> Callable[[Value, Value], Result]:
    """Return a function of whole numbers that are not negative."""

    def of(value: Value, places: Value) -> Result:
        if isinstance(value, float) or isinstance(places, float):
            return NO_INTEGER
        return compute(value, places) if value >= 0 and places >= 0 else NOT_64_BITS

    return of


def _shifted_left(value: int, places: int) -> Result:
    return value << places if places <= _MOST_BITS else NOT_64_BITS


def _rotated(value: int, places: int, *, left: bool) -> Result:
    """Return what is the same whatever type of bits the value has: nothing may leave it at one end."""
    width = next((bits for bits in _WIDTHS if value.bit_length() <= bits), 0)
    if left:
        return value << places if value.bit_length() + places <= width else _OF_TYPE
    return value >> places if places < width and not value & ((1 << places) - 1) else _OF_TYPE


def _selected(chosen: Value, first: Value, second: Value) -> Result:
    return (second if chosen else first) if chosen in (0, 1) else NO_INTEGER


def _multiplexed(place: Value, *values: Value) -> Result:
    # One beyond the last chooses the last.
    return NO_INTEGER if isinstance(place, float) or place < 0 or not values else values[min(place, len(values) - 1)]


OPERATORS: Mapping[str, Callable[[Value, Value], Result]] = MappingProxyType(
    {
        "+": operator.add,
        "-": operator.sub,
        "*": operator.mul,
        "/": quotient,
        "MOD": _remainder,
        "AND": _bitwise(operator.and_),
        "&": _bitwise(operator.and_),
        "AND_THEN": _bitwise(operator.and_),
        "OR": _bitwise(operator.or_),
        "OR_ELSE": _bitwise(operator.or_),
        "XOR": _bitwise(operator.xor),
        "=": operator.eq,
        "<>": operator.ne,
        "<": operator.lt,
        ">": operator.gt,
        "<=": operator.le,
        ">=": operator.ge,
    }
)
"""Operators between two values, in capitals; what is divided by is not 0."""

FUNCTIONS: Mapping[tuple[str, int | None], Callable[..., Result]] = MappingProxyType(
    {
        ("NOT", 1): _negated,
        ("ABS", 1): abs,
        ("MIN", None): lambda *values: min(values),
        ("MAX", None): lambda *values: max(values),
        ("LIMIT", 3): lambda low, value, high: min(max(value, low), high),
        ("SEL", 3): _selected,
        ("MUX", None): _multiplexed,
        ("EXPT", 2): _power,
        ("SHL", 2): _whole(_shifted_left),
        ("SHR", 2): _whole(operator.rshift),
        ("ROL", 2): _whole(lambda value, places: _rotated(value, places, left=True)),
        ("ROR", 2): _whole(lambda value, places: _rotated(value, places, left=False)),
        ("ADD", None): lambda *values: sum(values),
        ("SUB", 2): operator.sub,
    }
)
"""Functions by name in capitals and number of arguments (None: any)."""
