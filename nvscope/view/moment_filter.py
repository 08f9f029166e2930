"""A filter that looks at time: what triggers and rules ask of telegrams, in their order."""

from __future__ import annotations

from collections.abc import Mapping

from dissectors.batch import I64, Bool
from nvscope.expression.expression import compile_expression
from nvscope.expression.lasting import Lasting
from nvscope.expression.typed_columns import Column
from nvscope.expression.values import Moments
from nvscope.view.display_filter import DisplayFilter
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import FIELDS, expression_names, field_read
from nvscope.view.rows.frames import FrameRows

_OF_BUSES = ("bus.", "can.error", "can.flags.err")


class MomentFilter:
    """Tells of which telegrams an expression is true that may have functions of time, and variables of several lists.

    ``alone`` is the display filter that it is where each telegram can be asked alone, None where it remembers: then it
    is asked of all telegrams in their order, each once, and variables hold their last value. ``constant``: what it says
    is the same for all telegrams of a variety. ``momentary``, ``ages``
    and ``remembers`` are as of ``Expression``. ``by_stream`` is whether telegrams of one stream follow each other, or,
    where variables last, all do; ``by_bus``, whether all frames of a CAN channel do, since it asks for what is of the
    bus. UsageError, with the place, where the expression cannot be understood.
    """

    def __init__(self, text: str, fields: Mapping[str, TelegramField] = FIELDS) -> None:
        self.text = text
        self._fields = fields
        self._expression = compile_expression(text, expression_names(fields), over_time=True)
        self.momentary, self.ages = self._expression.momentary, self._expression.ages
        self.remembers = self._expression.remembers
        self.named = [field_read(name, fields) for name in self._expression.fields]
        lasting = {field.sent_in for field in self.named if field.sent_in}
        self.alone: DisplayFilter | None = None
        if not self._expression.remembers and len(lasting) < 2:
            self.alone = DisplayFilter(text, fields)
        self.constant = self.alone is not None and self.alone.constant and not self.alone.judged
        self.by_stream = self.alone is not None or not lasting
        self.by_bus = any(field.name.startswith(_OF_BUSES) for field in self.named)
        self._lasting = Lasting()

    def in_order(self, rows: FrameRows, stream: I64) -> Bool:
        """Tell of which rows, which follow those asked before, it is true; ``stream`` are the numbers of theirs."""
        return self.told(rows, stream)[0]

    def told(self, rows: FrameRows, stream: I64) -> tuple[Bool, Bool | None]:
        """Tell as ``in_order``, and of which rows that can be told at all; None: of all."""
        carried: dict[str, Bool] = {}

        def raw(name: str) -> tuple[TelegramField, Column, Bool | None]:
            field = field_read(name, self._fields)
            return field, field.column(rows), field.exists(rows)

        def carries(name: str) -> Bool:
            if name not in carried:
                known = field_read(name, self._fields).exists(rows)
                carried[name] = rows.row >= 0 if known is None else known
            return carried[name]

        def read(name: str) -> tuple[Column, Bool | None]:
            field, column, known = raw(name)
            return self._lasting.filled(name, column, known) if field.sent_in else (column, known)

        return self._expression.told(read, Moments(rows.ts_ns, stream, carries))
