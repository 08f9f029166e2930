"""The display filter: an expression over the fields of telegrams, asked of telegrams or of whole packet batches."""

from __future__ import annotations

from collections.abc import Mapping
from operator import or_

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.netvar import Fault
from dissectors.varieties import NO_TELEGRAM, Varieties
from nvscope.engine.told import Told
from nvscope.expression.expression import compile_expression
from nvscope.expression.typed_columns import Column
from nvscope.view.fields.field import TelegramField, blank
from nvscope.view.fields.frame import CARRIER_FIELDS, FIELDS, expression_names, field_read
from nvscope.view.fields.verdicts import Verdicts
from nvscope.view.rows.frames import NETVAR, FrameRows

_OF_CARRIERS = frozenset(field.name for field in CARRIER_FIELDS)


class DisplayFilter:
    """Tells which telegrams an expression chooses; UsageError, with the place, where it cannot be understood.

    ``fields`` are what it may name. ``judged`` fields among those it does name need ``verdicts``, without which it can
    be compiled, but not asked.
    """

    def __init__(
        self, text: str, fields: Mapping[str, TelegramField] = FIELDS, verdicts: Verdicts | None = None
    ) -> None:
        self.text = text
        self._fields = fields
        self._verdicts = verdicts
        self._expression = compile_expression(text, expression_names(fields))
        named = [field_read(name, fields) for name in self._expression.fields]
        self.constant = all(field.constant for field in named)
        """It chooses all telegrams of a variety or none."""
        self.judged = [field.name for field in named if field.judged]
        """What it names that is known only when the whole capture was read."""
        self.of_others = [field.name for field in named if field.of_others]
        """What it names that only frames have in which no protocol is found that is looked for."""
        of_finding = [field.name.startswith("finding.") for field in named]
        self.of_any_frame = all(map(or_, of_finding, (field.name in _OF_CARRIERS for field in named)))
        """What it names frames have whether a protocol is found in them or not."""
        self.findings = any(of_finding)
        """It asks for findings."""
        self._seen: set[int] = set()
        self._chosen: set[int] = set()

    def __call__(self, rows: FrameRows) -> Bool:
        if not self.findings or self._verdicts is None:
            return self._ask(rows)
        position, finding = self._verdicts.findings_of(rows)
        told = self._ask(rows.take(position).looked_at_with(finding))
        chosen = np.zeros(len(rows), np.bool_)
        chosen[position[told]] = True
        self._seen.update(finding.tolist())
        self._chosen.update(finding[told].tolist())
        return chosen

    def chooses_finding(self, number: int) -> bool:
        """Tell whether a telegram was chosen that shows a finding; of one that no telegram shows, ask it alone.

        Of such a finding, only ``finding.*`` exists.
        """
        if number in self._seen:
            return number in self._chosen

        def read(name: str) -> tuple[Column, Bool | None]:
            field = field_read(name, self._fields)
            if name.startswith("finding."):
                return field.column(FrameRows.nothing(1).looked_at_with(np.array([number]))), None
            return blank(field.type, 1), np.zeros(1, np.bool_)

        return bool(self._expression.mask(read)[0])

    def _ask(self, rows: FrameRows) -> Bool:
        def read(name: str) -> tuple[Column, Bool | None]:
            field = field_read(name, self._fields)
            return field.column(rows), field.exists(rows)

        return self._expression.mask(read)


class PacketChoice:
    """Tells which packets hold telegrams that a display filter chooses.

    What is the same for all telegrams of a variety is asked once of each variety, so that a filter on headers costs
    next to nothing.
    """

    def __init__(self, chosen: DisplayFilter) -> None:
        self._filter = chosen
        self._varieties: Varieties | None = None
        self._answer = np.zeros(0, np.bool_)
        self._undecided = np.zeros(0, np.bool_)

    def __call__(self, told: Told) -> Bool:
        """Return a mask over the packets of the batch."""
        if self._filter.constant:
            self._describe(told)
            chosen = self._answer[told.variety]
            if self._undecided.any():
                self._ask(told, np.flatnonzero(self._undecided[told.variety]), chosen)
            for part in told.parts.values():
                self._ask(told, part.row, chosen)
            if told.others is not None:
                self._ask(told, told.others.frames.row, chosen)
        else:
            chosen = np.zeros(len(told), np.bool_)
            self._ask(told, told.wanted, chosen)
        return chosen

    def _ask(self, told: Told, packet: I64, chosen: Bool) -> None:
        """Ask of the telegrams in some packets one by one, and enter the answers."""
        if len(packet):
            chosen[packet] = self._filter(FrameRows.of(told, packet))

    def _describe(self, told: Told) -> None:
        """Ask of the varieties that are new."""
        if told.varieties is not self._varieties:
            self._varieties = told.varieties
            self._answer, self._undecided = np.zeros(0, np.bool_), np.zeros(0, np.bool_)
        known = len(self._answer)
        if len(told.varieties) == known:
            return
        new = np.arange(known, len(told.varieties))
        rows = FrameRows.of_varieties(told, new)
        answer = self._filter(rows) & (new != NO_TELEGRAM)
        # Of these, a variety does not tell all that was captured.
        undecided = np.zeros(len(new), np.bool_)
        if found := rows.parts.get(NETVAR):
            fault = found.part.fault
            undecided[found.positions(len(new))] = (fault == Fault.HEADER_CUT) | (fault == Fault.SHORT)
        self._answer = np.concatenate([self._answer, answer & ~undecided])
        self._undecided = np.concatenate([self._undecided, undecided])
