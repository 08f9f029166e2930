"""The display filter: an expression over the fields of telegrams."""

from __future__ import annotations

from dissectors.batch import Bool
from nvscope.expression.columns import Column
from nvscope.expression.expression import compile_expression
from nvscope.view.fields import EXPRESSION_NAMES, FIELDS
from nvscope.view.telegrams import TelegramRows


class DisplayFilter:
    """Tells which telegrams an expression chooses; UsageError, with the place, where it cannot be understood."""

    def __init__(self, text: str) -> None:
        self._expression = compile_expression(text, EXPRESSION_NAMES)

    def __call__(self, rows: TelegramRows) -> Bool:
        def read(name: str) -> tuple[Column, Bool | None]:
            field = FIELDS[name]
            return field.read(rows), field.known(rows)

        return self._expression.mask(read)
