"""Constant integers: what stands in bounds, lengths and enumerations, evaluated as a controller's compiler does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from nvscope.definition.scalars import find_scalar
from nvscope.definition.source import DefinitionError, Source
from nvscope.definition.syntax import Call, Expression, Name, Number, Operation
from nvscope.definition.variables import Scalar, ScalarKind
from nvscope.definition.written import expression_text

INTEGERS = frozenset({ScalarKind.UNSIGNED, ScalarKind.SIGNED})
"""The kinds of elementary types that hold whole numbers."""

_LARGEST = 1 << 64
_MOST_BITS = 64
_UNTYPED = {"", "ANY"}


@dataclass(frozen=True, slots=True)
class Names:
    """What names in an expression stand for: the values of constants, and the sizes of types in bytes."""

    value_of: Callable[[Name], int]
    size_of: Callable[[Name], int]


def evaluate(expression: Expression, source: Source, names: Names) -> int:
    """Return the value of a constant expression.

    Division cuts off towards zero; a conversion must not change the value. Raises DefinitionError where it is no
    constant integer.
    """
    if isinstance(expression, Number):
        value = expression.value
    elif isinstance(expression, Name):
        return names.value_of(expression)
    elif isinstance(expression, Operation):
        left = evaluate(expression.left, source, names)
        right = evaluate(expression.right, source, names)
        if expression.operator in {"/", "MOD"} and not right:
            raise source.error("division by zero", expression.right.offset, "Correct the expression.")
        value = _OPERATIONS[expression.operator](left, right)
    elif isinstance(expression, Call):
        value = _called(expression, source, names)
    else:
        raise _no_integer(expression, source)
    if not -_LARGEST < value < _LARGEST:
        raise source.error("the value does not fit into 64 bits", expression.offset, "Correct the number.")
    return value


def check_fits(value: int, base: Scalar, source: Source, offset: int) -> None:
    """Raise DefinitionError where an integer type, or its subrange, does not hold a value."""
    bits = base.size_bytes * 8
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if base.kind is ScalarKind.SIGNED else (0, (1 << bits) - 1)
    low = low if base.low is None else base.low
    high = high if base.high is None else base.high
    if not low <= value <= high:
        what = f"{value} does not fit into {base.name}"
        raise source.error(what, offset, f"{base.name} holds {low} to {high} here.")


def _no_integer(expression: Expression, source: Source) -> DefinitionError:
    next_step = "Write a number, or an expression of integers and constants."
    return source.error("a constant integer is expected", expression.offset, next_step)


def _called(call: Call, source: Source, names: Names) -> int:
    function, arguments = call.function.upper(), call.arguments
    if function == "SIZEOF" and len(arguments) == 1 and isinstance(arguments[0], Name):
        return names.size_of(arguments[0])
    if len(arguments) == 1 and (types := _converted(function)) is not None:
        value = evaluate(arguments[0], source, names)
        for scalar in types:
            check_fits(value, scalar, source, arguments[0].offset)
        return value
    compute = _FUNCTIONS.get((function, len(arguments))) or _FUNCTIONS.get((function, None))
    if compute is None or not arguments:
        raise _no_integer(call, source)
    value_or_none = compute(*(evaluate(argument, source, names) for argument in arguments))
    if value_or_none is None:
        what = f"{expression_text(call)[:60]} is no integer of 64 bits"
        raise source.error(what, call.offset, "Correct the expression.")
    return value_or_none


def _converted(function: str) -> list[Scalar] | None:
    """Return the integer types between which a function converts, None where it does not, or one of them is none."""
    given, to, wanted = function.rpartition("TO_")
    if not to or (given and not given.endswith("_")):
        return None
    names = [name for name in (given.removesuffix("_"), wanted) if name not in _UNTYPED]
    types = [scalar for name in names if (scalar := find_scalar(name)) is not None and scalar.kind in INTEGERS]
    return types if len(types) == len(names) else None


def _quotient(left: int, right: int) -> int:
    quotient = abs(left) // abs(right)
    return quotient if (left < 0) == (right < 0) else -quotient


def _power(base: int, exponent: int) -> int | None:
    # What does not fit into 64 bits is not computed: it could have any number of digits.
    if exponent < 0 or (abs(base) > 1 and exponent > _MOST_BITS):
        return None
    return int(base**exponent)


def _shifted_left(value: int, places: int) -> int | None:
    return value << places if value >= 0 and 0 <= places <= _MOST_BITS else None


def _shifted_right(value: int, places: int) -> int | None:
    return value >> places if value >= 0 and places >= 0 else None


_OPERATIONS: dict[str, Callable[[int, int], int]] = {
    "+": lambda left, right: left + right,
    "-": lambda left, right: left - right,
    "*": lambda left, right: left * right,
    "/": _quotient,
    "MOD": lambda left, right: left - right * _quotient(left, right),
}
_FUNCTIONS: Mapping[tuple[str, int | None], Callable[..., int | None]] = MappingProxyType(
    {
        ("ABS", 1): abs,
        ("MIN", None): lambda *values: min(values),
        ("MAX", None): lambda *values: max(values),
        ("LIMIT", 3): lambda low, value, high: min(max(value, low), high),
        ("SEL", 3): lambda chosen, first, second: second if chosen else first,
        ("EXPT", 2): _power,
        ("SHL", 2): _shifted_left,
        ("SHR", 2): _shifted_right,
        ("ADD", None): lambda *values: sum(values),
        ("SUB", 2): lambda left, right: left - right,
    }
)
"""Functions by name in capitals and number of arguments (None: any); None is what no 64 bits hold."""
