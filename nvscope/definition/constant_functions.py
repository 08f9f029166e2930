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
from dataclasses import dataclass
from types import MappingProxyType

from nvscope.definition.scalars import SCALARS, find_scalar
from nvscope.definition.variables import Scalar, ScalarKind

Value = bool | int | float


@dataclass(frozen=True, slots=True)
class Operand:
    """A value, and its type where that is known: a bare number may be of any that holds it."""

    value: Value
    kind: Scalar | None = None


Result = Operand | str

INTEGERS = frozenset({ScalarKind.UNSIGNED, ScalarKind.SIGNED})
"""The kinds of elementary types that hold whole numbers."""

_MOST_BITS = 64
_WIDTHS = (8, 16, 32, 64)
_UNTYPED = {"", "ANY"}
_CONVERTED = INTEGERS | {ScalarKind.BOOL, ScalarKind.REAL}

NOT_64_BITS = "is no integer of 64 bits"
NO_INTEGER = "is no constant integer"
_OF_TYPE = "depends on the bits of a type that nobody knows"
_OF_CONTROLLER = "depends on the controller"
_DINT, _UDINT, _LINT = (-(1 << 31), (1 << 31) - 1), (0, (1 << 32) - 1), (-(1 << 63), (1 << 63) - 1)


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


def bounds_of(kind: Scalar) -> tuple[int, int]:
    """Return the least and the greatest value of an integer type, or of its subrange."""
    bits = kind.size_bytes * 8
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if kind.kind is ScalarKind.SIGNED else (0, (1 << bits) - 1)
    return low if kind.low is None else kind.low, high if kind.high is None else kind.high


def _of_kind(value: Value, *operands: Operand) -> Operand:
    """Return a value with the type that all operands have, if it is one of that."""
    kind = operands[0].kind
    if kind is None or kind.kind not in INTEGERS or isinstance(value, float):
        return Operand(value)
    low, high = bounds_of(kind)
    alike = all(operand.kind == kind for operand in operands) and low <= value <= high
    return Operand(value, kind if alike else None)


def _is_unsigned(operand: Operand, size_bytes: int) -> bool:
    """Return whether what an operand is computed as is an unsigned type of that size."""
    kind = operand.kind
    if kind is None or kind.kind not in INTEGERS:
        return operand.value > (_DINT[1] if size_bytes == 4 else _LINT[1])
    return kind.kind is ScalarKind.UNSIGNED and kind.size_bytes == size_bytes


def _is_long(operand: Operand) -> bool:
    kind = operand.kind
    if kind is None or kind.kind not in INTEGERS:
        return not _DINT[0] <= operand.value <= _UDINT[1]
    return kind.size_bytes == 8


def _arithmetic(compute: Callable[[Value, Value], Value | str]) -> Callable[[Operand, Operand], Result]:
    """Return a sum, difference or product of operands, which is unknown where it is not the same in all widths."""

    def of(left: Operand, right: Operand) -> Result:
        value = compute(left.value, right.value)
        if isinstance(value, str):
            return value
        if isinstance(value, float):
            return Operand(value)
        long = _is_long(left) or _is_long(right)
        unsigned = any(_is_unsigned(each, size) for each in (left, right) for size in ((8,) if long else (4, 8)))
        low, high = _LINT if long else _DINT
        if unsigned:
            low, high = 0, 2 * high + 1
        if not low <= value <= high:
            return _OF_TYPE if abs(value) >> _MOST_BITS == 0 else NOT_64_BITS
        found = _of_kind(value, left, right)
        # What is shorter than 32 bits is computed with more.
        return found if found.kind is not None and found.kind.size_bytes >= 4 else Operand(value)

    return of


def _divided(compute: Callable[[Value, Value], Value | str]) -> Callable[[Operand, Operand], Result]:
    """Return a quotient or remainder, which is unknown of a negative and an unsigned number of 32 bits or more."""

    def of(left: Operand, right: Operand) -> Result:
        value = compute(left.value, right.value)
        if isinstance(value, str):
            return value
        if isinstance(value, float):
            return Operand(value)
        unsigned = any(_is_unsigned(each, size) for each in (left, right) for size in (4, 8))
        return _OF_TYPE if unsigned and min(left.value, right.value) < 0 else _of_kind(value, left, right)

    return of


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


def _bitwise(compute: Callable[[int, int], int]) -> Callable[[Operand, Operand], Result]:
    def of(left: Operand, right: Operand) -> Result:
        a, b = left.value, right.value
        if isinstance(a, float) or isinstance(b, float) or isinstance(a, bool) is not isinstance(b, bool):
            return NO_INTEGER
        # Which bits a negative number has, its type decides.
        known = left.kind is not None and left.kind == right.kind
        return _of_kind(compute(a, b), left, right) if known or (a >= 0 and b >= 0) else _OF_TYPE

    return of


def _compared(compute: Callable[[Value, Value], bool]) -> Callable[[Operand, Operand], Result]:
    return lambda left, right: Operand(compute(left.value, right.value))


def _negated(operand: Operand) -> Result:
    value, kind = operand.value, operand.kind
    if isinstance(value, bool):
        return Operand(not value)
    if isinstance(value, float):
        return NO_INTEGER
    if kind is None or kind.kind not in INTEGERS:
        return _OF_TYPE
    return Operand(~value if kind.kind is ScalarKind.SIGNED else ~value & _mask(_bits_of(operand)), kind)


def _power(base: Operand, exponent: Operand) -> Result:
    a, b = base.value, exponent.value
    if isinstance(a, float) or isinstance(b, float):
        try:
            return Operand(math.pow(a, b))
        except (ValueError, OverflowError):
            return NO_INTEGER
    # What does not fit into 64 bits is not computed: it could have any number of digits.
    if b < 0 or (abs(a) > 1 and b > _MOST_BITS):
        return NOT_64_BITS
    return Operand(int(a**b))


def _shifted(compute: Callable[[Operand, int, int], Result]) -> Callable[[Operand, Operand], Result]:
    """Return a function of an operand's bits, given with the number of places."""

    def of(operand: Operand, places: Operand) -> Result:
        value, by = operand.value, places.value
        if isinstance(value, float) or isinstance(by, float):
            return NO_INTEGER
        if by < 0 or by > _MOST_BITS:
            return NOT_64_BITS
        if not value or not by:
            return operand
        return compute(operand, int(value), int(by)) if value > 0 else _unsure(operand)

    return of


def _unsure(operand: Operand) -> str:
    """Return why nobody knows what becomes of an operand whose bits leave it."""
    return _OF_TYPE if operand.kind is None else _OF_CONTROLLER


def _bits_of(operand: Operand) -> int:
    """Return how many bits an operand has; of a bare number they are those of the smallest type."""
    if operand.kind is not None and operand.kind.kind in INTEGERS:
        return operand.kind.size_bytes * 8
    return next((bits for bits in _WIDTHS if int(operand.value).bit_length() <= bits), _MOST_BITS)


def _mask(bits: int) -> int:
    return (1 << bits) - 1


def _has_bits(operand: Operand) -> bool:
    """Return whether an operand is surely of a type of so many bits, none of which is a sign."""
    return operand.kind is not None and operand.kind.kind is ScalarKind.UNSIGNED


def _stays(operand: Operand, value: int) -> bool:
    """Return whether no bit of a shifted value leaves the operand, or becomes its sign."""
    signed = operand.kind is not None and operand.kind.kind is ScalarKind.SIGNED
    return value.bit_length() <= _bits_of(operand) - signed


def _shifted_left(operand: Operand, value: int, places: int) -> Result:
    if places < _bits_of(operand):
        if _stays(operand, value << places):
            return Operand(value << places, operand.kind)
        if _has_bits(operand):
            return Operand(value << places & _mask(_bits_of(operand)), operand.kind)
    return _unsure(operand)


def _shifted_right(operand: Operand, value: int, places: int) -> Result:
    return Operand(value >> places, operand.kind) if places < _bits_of(operand) else _unsure(operand)


def _rotated_left(operand: Operand, value: int, places: int) -> Result:
    bits = _bits_of(operand)
    if _has_bits(operand):
        places %= bits
        return Operand((value << places | value >> bits - places) & _mask(bits), operand.kind)
    return Operand(value << places, operand.kind) if _stays(operand, value << places) else _unsure(operand)


def _rotated_right(operand: Operand, value: int, places: int) -> Result:
    bits = _bits_of(operand)
    if _has_bits(operand):
        return _rotated_left(operand, value, bits - places % bits)
    stays = places < bits and not value & _mask(places)
    return Operand(value >> places, operand.kind) if stays else _unsure(operand)


def _absolute(operand: Operand) -> Result:
    return _of_kind(abs(operand.value), operand)


def _one_of(choose: Callable[..., Value]) -> Callable[..., Result]:
    """Return a function that gives one of its operands."""
    return lambda *operands: _of_kind(choose(*(operand.value for operand in operands)), *operands)


def _selected(chosen: Operand, first: Operand, second: Operand) -> Result:
    value = (second if chosen.value else first).value
    return _of_kind(value, first, second) if chosen.value in (0, 1) else NO_INTEGER


def _multiplexed(place: Operand, *operands: Operand) -> Result:
    number = place.value
    if isinstance(number, float) or number < 0 or not operands:
        return NO_INTEGER
    # One beyond the last chooses the last.
    return _of_kind(operands[min(number, len(operands) - 1)].value, *operands)


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
        "AND": _bitwise(operator.and_),
        "&": _bitwise(operator.and_),
        "AND_THEN": _bitwise(operator.and_),
        "OR": _bitwise(operator.or_),
        "OR_ELSE": _bitwise(operator.or_),
        "XOR": _bitwise(operator.xor),
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
        ("NOT", 1): _negated,
        ("ABS", 1): _absolute,
        ("MIN", None): _one_of(lambda *values: min(values)),
        ("MAX", None): _one_of(lambda *values: max(values)),
        ("LIMIT", 3): _one_of(lambda low, value, high: min(max(value, low), high)),
        ("SEL", 3): _selected,
        ("MUX", None): _multiplexed,
        ("EXPT", 2): _power,
        ("SHL", 2): _shifted(_shifted_left),
        ("SHR", 2): _shifted(_shifted_right),
        ("ROL", 2): _shifted(_rotated_left),
        ("ROR", 2): _shifted(_rotated_right),
        ("ADD", None): _sum,
        ("SUB", 2): OPERATORS["-"],
    }
)
"""Functions by name in capitals and number of arguments (None: any)."""
