"""The transactions of the Parameter Manager: a reply each, a write that is asked for, and what nobody answered."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from dissectors import address
from dissectors.batch import I64
from dissectors.netvar import Service
from nvscope import units
from nvscope.analysis.transactions.transaction import (
    NOTHING,
    Brought,
    Group,
    Outcome,
    Pair,
    Protocol,
    Room,
    Said,
    Transaction,
    last_of_each,
)
from nvscope.engine.told import Told
from nvscope.tracker.parameter.matching import Messages, parameter_of
from nvscope.tracker.parameter.state import is_spoken_of
from nvscope.tracker.parameter.values import Value, values_in

if TYPE_CHECKING:  # most plants have no such telegrams, and most projects no parameters
    from nvscope.definition.parameters import ParameterDefinition, Parameters
    from nvscope.tracker.parameter.transactions import Became, Transactions

_OUTCOMES = {
    Service.ODReadRequestReply: Outcome.ANSWERED, Service.ODWriteRequestReply: Outcome.CONFIRMED,
    Service.ODStateBusy: Outcome.BUSY,
}  # fmt: skip
_READ_REPLY, _WRITE_REPLY, _WRITE = Service.ODReadRequestReply, Service.ODWriteRequestReply, Service.ODWriteRequest


class ParameterTransactions:
    """Finds transactions from one batch to the next; ``parameters`` say what people call them, and their types.

    Old values are those that ``nvscope.tracker.parameter.writes`` knows: those of the first writes.
    """

    def __init__(self, parameters: Parameters | None, room: Room) -> None:
        from nvscope.view.documents.parameter_values import ParameterValues  # noqa: PLC0415

        self._parameters, self._room = parameters, room
        self._values = ParameterValues(as_declared=True)
        self._known: Transactions | None = None
        self._pairs: list[Pair] = []

    def of(self, told: Told, last: int | None = None) -> Brought:
        """Return what a batch brings, which follows those before.

        With ``last``, of what became of requests there is so much of each pair and ``Group`` at most: the last of it.
        """
        if self._known is None:
            if not is_spoken_of(told):
                return NOTHING
            from nvscope.tracker.parameter.transactions import Transactions  # noqa: PLC0415

            self._known = Transactions()
        became = self._known.observe(told)
        self._describe(self._known)
        found = sorted(self._found(self._known, told, became, last), key=_order)
        asked = became.asked
        return Brought(self._pairs, asked.pair, asked.packet, asked.service == _WRITE, found)

    def _describe(self, known: Transactions) -> None:
        """Tell pairs by their texts."""
        words = (word[len(self._pairs) :].tolist() for word in known.pairs.words)
        for client_hi, client_lo, server_hi, server_lo, port in zip(*words, strict=True):
            ends = address.text(client_hi, client_lo), address.text(server_hi, server_lo)
            self._pairs.append(Pair(Protocol.SDO, *ends, int(port)))

    def _found(self, known: Transactions, told: Told, became: Became, last: int | None) -> Iterator[Transaction]:
        """Yield what became of requests."""
        by_frame = np.lexsort((became.unanswered.frame, became.shown))
        waits, shown = became.unanswered.take(by_frame), became.shown[by_frame]
        rows = last_of_each(waits.pair, _group(waits.service, waits.service), last)
        waits, shown = waits.take(rows), shown[rows]
        late_ns = waits.last_ns + known.timeout_ns
        for pair, parameter, service, frame, time_ns, row in zip(
            waits.pair.tolist(), parameter_of(waits.word).tolist(), waits.service.tolist(), waits.frame.tolist(),
            late_ns.tolist(), shown.tolist(), strict=True,
        ):  # fmt: skip
            writes = service == _WRITE
            said = self._written(known, pair, parameter, frame) if writes else self._named(pair, parameter)
            yield Transaction(
                self._pairs[pair], time_ns, frame, row + told.first_frame, frame, writes, Outcome.UNANSWERED, (said,)
            )  # fmt: skip
        yield from self._replies(known, told, became, last)
        yield from self._asked(known, told, became, last)

    def _asked(self, known: Transactions, told: Told, became: Became, last: int | None) -> Iterator[Transaction]:
        asked = became.asked.take(became.asked.service == _WRITE)
        asked = asked.take(last_of_each(asked.pair, _group(asked.service, asked.service), last))
        for pair, parameter, row, time_ns, value in self._rows(told, asked):
            frame = row + told.first_frame
            kept = known.writes.asked_in(frame)
            said = self._said(pair, parameter, value, kept.old if kept is not None else None)
            yield Transaction(self._pairs[pair], time_ns, frame, frame, frame, True, Outcome.OPEN, (said,))

    def _replies(self, known: Transactions, told: Told, became: Became, last: int | None) -> Iterator[Transaction]:
        rows = last_of_each(became.answers.pair, _group(became.answered.service, became.answers.service), last)
        answers, answered = became.answers.take(rows), became.answered.take(rows)
        for (pair, parameter, row, time_ns, value), service, asked_as, asked_frame, since_ns, unsure in zip(
            self._rows(told, answers), answers.service.tolist(), answered.service.tolist(), answered.frame.tolist(),
            answered.since_ns.tolist(), answered.unsure.tolist(), strict=True,
        ):  # fmt: skip
            writes = asked_as == _WRITE
            if writes:
                said = self._written(known, pair, parameter, asked_frame)
            elif service == _READ_REPLY:
                said = self._said(pair, parameter, value)
            else:
                said = self._named(pair, parameter)
            # Of several values, which one a reply is about is not known.
            frame, outcome = row + told.first_frame, Outcome.OPEN if unsure else _OUTCOMES.get(service, Outcome.REFUSED)
            yield Transaction(
                self._pairs[pair], time_ns, frame, frame, asked_frame, writes, outcome, (said,),
                latency_ns=time_ns - since_ns, detail=_detail(service, outcome),
            )  # fmt: skip
        unexpected = became.unexpected
        unexpected = unexpected.take(
            last_of_each(unexpected.pair, _group(unexpected.service, unexpected.service), last)
        )
        for (pair, parameter, row, time_ns, value), service in zip(
            self._rows(told, unexpected), unexpected.service.tolist(), strict=True
        ):
            is_read, frame = service == _READ_REPLY, row + told.first_frame
            said = self._said(pair, parameter, value) if is_read else self._named(pair, parameter)
            outcome = _OUTCOMES.get(service, Outcome.REFUSED)
            yield Transaction(
                self._pairs[pair], time_ns, frame, frame, None, service == _WRITE_REPLY, Outcome.UNEXPECTED, (said,),
                detail=_detail(service, outcome),
            )  # fmt: skip

    @staticmethod
    def _rows(told: Told, messages: Messages) -> Iterator[tuple[int, int, int, int, Value]]:
        """Yield of each message its pair, parameter, row and time, and the value in it."""
        columns = messages.pair, parameter_of(messages.word), messages.packet, messages.time_ns
        return zip(*(column.tolist() for column in columns), values_in(told, messages.packet), strict=True)

    def _written(self, known: Transactions, pair: int, parameter: int, frame: int) -> Said:
        """Return what was to be written by a request, as far as that is kept."""
        kept = known.writes.asked_in(frame)
        return self._named(pair, parameter) if kept is None else self._said(pair, parameter, kept.new, kept.old)

    def _definition(self, pair: int, parameter: int) -> ParameterDefinition | None:
        if not self._parameters:
            return None
        return self._parameters.of(self._pairs[pair].server, parameter >> 16, parameter & 0xFFFF)

    def _named(self, pair: int, parameter: int) -> Said:
        """Return a parameter without a value."""
        defined = self._definition(pair, parameter)
        name = defined.name if defined is not None and defined.name else ""
        return Said(self._room.cut(name or units.parameter(parameter >> 16, parameter & 0xFFFF)))

    def _said(self, pair: int, parameter: int, new: Value, old: Value | None = None) -> Said:
        """Return a parameter with its value, by its type where the project knows that."""
        defined, name = self._definition(pair, parameter), self._named(pair, parameter).name
        value, text = self._values.told(defined, new.data, new.items, new.size_bytes)
        if old is None:
            return Said(name, value, self._room.cut(text))
        before, old_text = self._values.told(defined, old.data, old.items, old.size_bytes)
        return Said(name, value, self._room.cut(text), before, self._room.cut(old_text))


def _order(one: Transaction) -> tuple[int, bool, int]:
    """Return the place of a transaction: what nobody answered is known before what came in the same frame."""
    return one.known_frame, one.outcome is not Outcome.UNANSWERED, one.frame


def _group(asked: I64, said: I64) -> I64:
    """Return the group of transactions, from the services of requests, and of what is said of these."""
    is_write = (asked == _WRITE) | (asked == _WRITE_REPLY)
    return np.where(is_write, Group.WRITE, np.where(said == _READ_REPLY, Group.READ, Group.WRONG))


def _detail(service: int, outcome: Outcome) -> str:
    return Service(service).name if outcome is Outcome.REFUSED else ""
