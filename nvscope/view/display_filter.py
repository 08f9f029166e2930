"""The display filter: an expression over the fields of telegrams, asked of telegrams or of whole packet batches."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.told import Told
from nvscope.expression.expression import compile_expression
from nvscope.expression.typed_columns import Column
from nvscope.view.fields.field import TelegramField, blank
from nvscope.view.fields.frame import CARRIER_FIELDS, FIELDS, expression_names, field_read
from nvscope.view.fields.shown import NONE
from nvscope.view.fields.shown_fields import CAUSE, FINDING
from nvscope.view.fields.verdicts import Verdicts
from nvscope.view.rows.frames import FrameRows
from nvscope.view.variety_answers import VarietyAnswers

_OF_CARRIERS = frozenset(field.name for field in CARRIER_FIELDS)
_SHOWN = (FINDING, CAUSE)


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
        self.findings = any(field.name.startswith(FINDING) for field in named)
        """It asks for findings."""
        self.causes = any(field.name.startswith(CAUSE) for field in named)
        """It asks for causes."""
        of_any = [field.name.startswith(_SHOWN) or field.name in _OF_CARRIERS for field in named]
        self.of_any_frame = all(of_any)
        """What it names frames have whether a protocol is found in them or not."""
        self._seen: set[tuple[int, int]] = set()
        self._chosen: set[tuple[int, int]] = set()

    def __call__(self, rows: FrameRows) -> Bool:
        if self._verdicts is None or not (self.findings or self.causes):
            return self._ask(rows)
        looks = self._verdicts.looks(rows, findings=self.findings, causes=self.causes)
        told = self._ask(rows.take(looks.position).looked_at_with(looks.finding, looks.cause))
        chosen = np.zeros(len(rows), np.bool_)
        chosen[looks.position[told]] = True
        self._seen.update(_pairs(looks.finding, looks.cause))
        self._chosen.update(_pairs(looks.finding[told], looks.cause[told]))
        return chosen

    def shown(self) -> tuple[set[int], set[int]]:
        """Return the numbers of the findings and of the causes with which a telegram was chosen.

        Of those that no telegram showed, each is asked alone, a finding together with its cause if both are asked for:
        there, only ``finding.*`` and ``cause.*`` exist. Of a filter that asks for no findings, the findings are those
        that its causes explain; of one that asks for no causes, there are no causes.
        """
        verdicts = self._verdicts
        if verdicts is None:
            return set(), set()
        chosen = set(self._chosen)
        pairs = verdicts.pairs(findings=self.findings, causes=self.causes)
        unseen = np.array([pair not in self._seen for pair in zip(*(side.tolist() for side in pairs), strict=True)])
        if unseen.any():
            finding, cause = (side[unseen] for side in pairs)
            rows = FrameRows.nothing(len(finding)).looked_at_with(finding, cause)

            def read(name: str) -> tuple[Column, Bool | None]:
                field = field_read(name, self._fields)
                if field.name.startswith(_SHOWN):
                    return field.column(rows), field.exists(rows)
                return blank(field.type, len(rows)), np.zeros(len(rows), np.bool_)

            told = self._expression.mask(read)
            chosen.update(_pairs(finding[told], cause[told]))
        findings, causes = ({pair[side] for pair in chosen} - {NONE} for side in (0, 1))
        return findings if self.findings else verdicts.explained_by(causes), causes

    def _ask(self, rows: FrameRows) -> Bool:
        def read(name: str) -> tuple[Column, Bool | None]:
            field = field_read(name, self._fields)
            return field.column(rows), field.exists(rows)

        return self._expression.mask(read)


def _pairs(finding: I64, cause: I64) -> Iterator[tuple[int, int]]:
    """Yield each pair of numbers once, of which at least one is something."""
    some = (finding != NONE) | (cause != NONE)
    many = int(cause.max(initial=NONE)) - NONE + 1
    for code in np.unique((finding[some] - NONE) * many + (cause[some] - NONE)).tolist():
        yield code // many + NONE, code % many + NONE


class PacketChoice:
    """Tells which packets hold telegrams that a display filter chooses.

    What is the same for all telegrams of a variety is asked once of each variety, so that a filter on headers costs
    next to nothing.
    """

    def __init__(self, chosen: DisplayFilter) -> None:
        self._filter = chosen
        self._answers = VarietyAnswers(lambda rows: (chosen(rows), None))

    def __call__(self, told: Told) -> Bool:
        """Return a mask over the packets of the batch."""
        if self._filter.constant:
            answers = self._answers
            answers.learn(told)
            chosen = answers.true[told.variety]
            if answers.undecided.any():
                self._ask(told, np.flatnonzero(answers.undecided[told.variety]), chosen)
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
