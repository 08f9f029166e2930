"""Constant integers: what stands in bounds, lengths and enumerations, evaluated as a controller's compiler does."""

from __future__ import annotations

from collections.abc import Callable

from nvscope.definition.scalars import find_scalar
from nvscope.definition.source import Source
from nvscope.definition.syntax import Conversion, Expression, Name, Number, Operation
from nvscope.definition.variables import Scalar, ScalarKind

INTEGERS = frozenset({ScalarKind.UNSIGNED, ScalarKind.SIGNED})
"""The kinds of elementary types that hold whole numbers."""

_LARGEST = 1 << 64
_UNTYPED = {"", "ANY"}


def evaluate(expression: Expression, source: Source, value_of: Callable[[Name], int]) -> int:
    """Return the value of a constant expression; ``value_of`` gives that of a name.

    Division cuts off towards zero; a conversion must not change the value. Raises ConfigurationError, with position,
    where it is no constant integer.
    """
    if isinstance(expression, Number):
        value = expression.value
    elif isinstance(expression, Name):
        return value_of(expression)
    elif isinstance(expression, Operation):
        left = evaluate(expression.left, source, value_of)
        right = evaluate(expression.right, source, value_of)
        if expression.operator in {"/", "MOD"} and not right:
            raise source.error("division by zero", expression.right.offset, "Correct the expression.")
        value = _OPERATIONS[expression.operator](left, right)
    elif isinstance(expression, Conversion) and (types := _converted(expression.function)) is not None:
        value = evaluate(expression.value, source, value_of)
        for scalar in types:
            check_fits(value, scalar, source, expression.value.offset)
    else:
        next_step = "Write a number, or an expression of integers and constants."
        raise source.error("a constant integer is expected", expression.offset, next_step)
    if not -_LARGEST < value < _LARGEST:
        raise source.error("the value does not fit into 64 bits", expression.offset, "Correct the number.")
    return value


def check_fits(value: int, base: Scalar, source: Source, offset: int) -> None:
    """Raise ConfigurationError where an integer type, or its subrange, does not hold a value."""
    bits = base.size_bytes * 8
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if base.kind is ScalarKind.SIGNED else (0, (1 << bits) - 1)
    low = low if base.low is None else base.low
    high = high if base.high is None else base.high
    if not low <= value <= high:
        what = f"{value} does not fit into {base.name}"
        raise source.error(what, offset, f"{base.name} holds {low} to {high} here.")


def _converted(function: str) -> list[Scalar] | None:
    """Return the integer types between which a function converts, None where one of them is none."""
    given, _, wanted = function.upper().rpartition("TO_")
    names = [name for name in (given.removesuffix("_"), wanted) if name not in _UNTYPED]
    types = [scalar for name in names if (scalar := find_scalar(name)) is not None and scalar.kind in INTEGERS]
    return types if len(types) == len(names) else None


def _quotient(left: int, right: int) -> int:
    quotient = abs(left) // abs(right)
    return quotient if (left < 0) == (right < 0) else -quotient


_OPERATIONS: dict[str, Callable[[int, int], int]] = {
    "+": lambda left, right: left + right,
    "-": lambda left, right: left - right,
    "*": lambda left, right: left * right,
    "/": _quotient,
    "MOD": lambda left, right: left - right * _quotient(left, right),
}
