"""Types and expressions as a person writes them."""

from __future__ import annotations

from nvscope.definition.syntax import (
    ArrayType,
    Call,
    EnumerationType,
    Expression,
    Name,
    NamedType,
    Number,
    Operation,
    PointerType,
    StringType,
    StructureType,
    TypeOperand,
    TypeSyntax,
)

_LONGEST = 60


def type_text(syntax: TypeSyntax) -> str:
    """Return a type in one line; long ones are cut."""
    text = _type_text(syntax)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def _type_text(syntax: TypeSyntax) -> str:
    if isinstance(syntax, NamedType):
        return f"{syntax.name.text}<…>" if syntax.generic else syntax.name.text
    if isinstance(syntax, StringType):
        name = "WSTRING" if syntax.wide else "STRING"
        return f"{name}({expression_text(syntax.length)})" if syntax.length is not None else name
    if isinstance(syntax, ArrayType):
        bounds = ", ".join(f"{expression_text(low)}..{expression_text(high)}" for low, high in syntax.bounds)
        return f"ARRAY[{bounds}] OF {_type_text(syntax.element)}"
    if isinstance(syntax, StructureType):
        return "UNION" if syntax.is_union else "STRUCT"
    if isinstance(syntax, EnumerationType):
        return f"({syntax.values[0][0].text}, …)"
    return syntax.keyword if isinstance(syntax, PointerType) else "?"


def expression_text(expression: Expression) -> str:
    """Return an expression; what is no integer is ``?``."""
    if isinstance(expression, Operation):
        sides = [
            f"({expression_text(side)})" if isinstance(side, Operation) else expression_text(side)
            for side in (expression.left, expression.right)
        ]
        return f" {expression.operator} ".join(sides)
    if isinstance(expression, Call):
        return f"{expression.function}({', '.join(map(expression_text, expression.arguments))})"
    if isinstance(expression, TypeOperand):
        return _type_text(expression.type)
    if isinstance(expression, Number) and expression.kind is not None:
        return f"{expression.kind.name}#{expression.value}"
    return expression.text if isinstance(expression, Name) else str(getattr(expression, "value", "?"))
