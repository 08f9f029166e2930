"""Constant expressions: what stands in bounds, lengths and enumerations, evaluated as a controller's compiler does."""

from __future__ import annotations

import math
from collections.abc import Callable

from msgspec import Struct

from nvscope.definition.constant_functions import FUNCTIONS, OPERATORS, TRUNCATED, as_type, conversion
from nvscope.definition.operands import INTEGERS, NO_INTEGER, Operand, Result, bounds_of
from nvscope.definition.source import DefinitionError, Source
from nvscope.definition.syntax import Call, Expression, Name, Number, Operation, Real, TypeOperand
from nvscope.definition.variables import Scalar
from nvscope.definition.written import expression_text

__all__ = ["INTEGERS", "SIZE_FUNCTIONS", "Names", "Operand", "check_fits", "evaluate", "integer"]

SIZE_FUNCTIONS = frozenset({"SIZEOF", "XSIZEOF"})
"""The functions, in capitals, whose argument is a type."""

_LARGEST = 1 << 64


class Names(Struct, frozen=True):
    """What names in an expression stand for: the values of constants, and the sizes of types in bytes."""

    value_of: Callable[[Name], Operand]
    size_of: Callable[[Name | TypeOperand], int]


def integer(operand: Operand, expression: Expression, source: Source) -> int:
    """Return what an expression's value counts where a whole number is wanted; DefinitionError of a real."""
    if isinstance(operand.value, float):
        raise _no_integer(expression, source)
    return int(operand.value)


def evaluate(expression: Expression, source: Source, names: Names) -> Operand:
    """Return the value of a constant expression: a truth, a whole number, or a real.

    Division of whole numbers cuts off towards zero; a conversion must not change a whole number, and a literal has to
    be of the type in front of it. Raises DefinitionError where the expression is no constant, or its value depends on
    what nobody knows.
    """
    if isinstance(expression, Number):
        operand = as_kind(Operand(expression.value), expression.kind, expression, source)
    elif isinstance(expression, Real):
        operand = Operand(expression.value)
    elif isinstance(expression, Name):
        return names.value_of(expression)
    elif isinstance(expression, Operation):
        left = evaluate(expression.left, source, names)
        right = evaluate(expression.right, source, names)
        if expression.operator in {"/", "MOD"} and not right.value:
            raise source.error("division by zero", expression.right.offset, "Correct the expression.")
        operand = _valid(OPERATORS[expression.operator](left, right), expression, source)
    elif isinstance(expression, Call):
        operand = _called(expression, source, names)
    else:
        raise _no_integer(expression, source)
    value = operand.value
    if not (math.isfinite(value) if isinstance(value, float) else -_LARGEST < value < _LARGEST):
        raise source.error("the value does not fit into 64 bits", expression.offset, "Correct the number.")
    return operand


def check_fits(value: int, base: Scalar, source: Source, offset: int) -> None:
    """Raise DefinitionError where an integer type, or its subrange, does not hold a value."""
    low, high = bounds_of(base)
    if not low <= value <= high:
        what = f"{value} does not fit into {base.name}"
        raise source.error(what, offset, f"{base.name} holds {low} to {high} here.")


def as_kind(operand: Operand, kind: Scalar | None, expression: Expression, source: Source) -> Operand:
    """Return the value of an expression as one of a type, if any; DefinitionError where that does not hold it."""
    if kind is None:
        return operand
    if kind.kind not in INTEGERS:
        return Operand(as_type(operand.value, kind), kind)
    value = integer(operand, expression, source)
    check_fits(value, kind, source, expression.offset)
    return Operand(value, kind)


def _no_integer(expression: Expression, source: Source) -> DefinitionError:
    next_step = "Write a number, or an expression of integers and constants."
    return source.error("a constant integer is expected", expression.offset, next_step)


def _called(call: Call, source: Source, names: Names) -> Operand:
    function, arguments = call.function.upper(), call.arguments
    if function in SIZE_FUNCTIONS and len(arguments) == 1 and isinstance(arguments[0], Name | TypeOperand):
        return Operand(names.size_of(arguments[0]))
    compute = FUNCTIONS.get((function, len(arguments))) or FUNCTIONS.get((function, None))
    types = conversion(function)
    if len(arguments) == 1 and function in TRUNCATED:
        cut = math.trunc(evaluate(arguments[0], source, names).value)
        return as_kind(Operand(cut), TRUNCATED[function], arguments[0], source)
    if len(arguments) == 1 and types is not None:
        given, wanted = types
        operand = evaluate(arguments[0], source, names)
        for kind in given:
            operand = as_kind(operand, kind, arguments[0], source)
        return as_kind(Operand(as_type(operand.value, wanted)), wanted, arguments[0], source)
    if compute is None or not arguments:
        raise _no_integer(call, source)
    return _valid(compute(*(evaluate(argument, source, names) for argument in arguments)), call, source)


def _valid(result: Result, expression: Expression, source: Source) -> Operand:
    if result == NO_INTEGER:
        raise _no_integer(expression, source)
    if isinstance(result, str):
        what = f"{expression_text(expression)[:60]} {result}"
        raise source.error(what, expression.offset, "Correct the expression, or write the number.")
    return result
