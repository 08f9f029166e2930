"""Constant integers: what stands in bounds, lengths and enumerations, evaluated as a controller's compiler does."""

from __future__ import annotations

from collections.abc import Callable

from nvscope.definition.source import Source
from nvscope.definition.syntax import Expression, Name, Number, Operation

_LARGEST = 1 << 64


def evaluate(expression: Expression, source: Source, value_of: Callable[[Name], int]) -> int:
    """Return the value of a constant expression; ``value_of`` gives that of a name.

    Division cuts off towards zero. Raises ConfigurationError, with position, where it is no constant integer.
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
    else:
        next_step = "Write a number, or an expression of integers and constants."
        raise source.error("a constant integer is expected", expression.offset, next_step)
    if not -_LARGEST < value < _LARGEST:
        raise source.error("the value does not fit into 64 bits", expression.offset, "Correct the number.")
    return value


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
