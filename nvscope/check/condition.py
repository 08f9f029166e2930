"""Condition: an expression of a rule, and what it says of telegrams one by one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from dissectors.batch import Bool
from nvscope.check.asked_rows import Asked, LazyRows, OfLists
from nvscope.check.parameters import Unfit
from nvscope.errors import UsageError
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.shown_fields import CAUSE, FINDING
from nvscope.view.moment_filter import MomentFilter
from nvscope.view.variety_answers import VarietyAnswers


def compiled(text: str, fields: Mapping[str, TelegramField], within: str = "{}") -> MomentFilter:
    """Return what asks an expression of telegrams, or one that has it ``within``; Unfit where it is none."""
    try:
        return MomentFilter(within.replace("{}", text), fields)
    except UsageError as error:
        raise Unfit(error.what, expression=text, next_step=error.next_step, excerpt=error.excerpt) from None


class Condition:
    """What an expression says of telegrams, asked of all that it needs to see in their order, each once.

    ``lists`` are those whose telegrams have to be asked, None where it takes all. With ``begins`` it is true of the
    telegrams at which the expression becomes true: those at which a state of variables began that was another one
    before, or a change happened, or of which it is true where it looks at nothing but the telegram itself.
    Unfit where the expression cannot be understood, or asks for what no telegram says.
    """

    def __init__(self, text: str, fields: Mapping[str, TelegramField], *, begins: bool = False) -> None:
        chosen = compiled(text, fields)
        if judged := [field.name for field in chosen.named if field.judged]:
            raise Unfit(
                f"{', '.join(judged)}: known of a whole capture, and at no moment",
                expression=text,
                next_step='always and never look at figures of a list in windows, such as window = "1s"; never also at '
                "causes and findings",
            )
        sent_in = [field.sent_in for field in chosen.named]
        if begins and not chosen.momentary and (any(sent_in) or chosen.remembers):
            chosen = compiled(text, fields, "rose({})")
        self._chosen, self._fields = chosen, fields
        self._answers = VarietyAnswers(lambda rows: chosen.told(rows, rows.row)) if chosen.constant else None
        self.alone = not any(sent_in) and not chosen.remembers
        """Whether each telegram is asked by itself, whatever came before it."""
        self.lasts = bool(sent_in) and all(sent_in) and not chosen.momentary
        """Whether it is so until something that it names is sent again: it names variables alone."""
        self.lists: OfLists | None = None
        if sent_in and all(sent_in) and not chosen.ages:
            self.lists = OfLists(frozenset(key for places in sent_in for key, _ in places))

    def forget(self) -> None:
        """Forget what came so far: what follows is asked as if nothing was before it."""
        if not self.alone:
            self._chosen = MomentFilter(self._chosen.text, self._fields)

    def told(self, asked: Asked) -> tuple[Bool, Bool]:
        """Tell of which telegrams it is true, and of which that is known."""
        if self._answers is not None and isinstance(asked.frames, LazyRows) and asked.frames.are_telegrams:
            self._answers.learn(asked.frames.told)
            variety = asked.frames.told.variety[asked.frames.packet]
            if not self._answers.undecided[variety].any():
                return self._answers.true[variety], self._answers.known[variety]
        true, known = self._chosen.told(asked.rows, asked.stream)
        known = np.ones(len(asked), np.bool_) if known is None else known
        return true & known, known


def told_of_plants(text: str, fields: Mapping[str, TelegramField]) -> bool:
    """Tell whether an expression asks for causes and findings, and for nothing else. UsageError as of Condition."""
    chosen = compiled(text, fields)
    return bool(chosen.named) and all(field.name.startswith((CAUSE, FINDING)) for field in chosen.named)


def together(conditions: Iterable[Condition], only: OfLists | None = None) -> OfLists | None:
    """Return the lists whose telegrams have to be asked for several conditions, None for all.

    ``only`` are those that are judged: what can be asked of each telegram alone need not be asked of others.
    """
    asked = OfLists() if only is None else only
    for one in conditions:
        if only is not None and one.alone:
            continue
        if one.lists is None:
            return None
        asked = asked.and_of(one.lists)
    return asked
