"""Functions of time: ``rose(x)``, ``fell(x)``, ``changed(x)``, ``held(x, 2s)``, ``age(x)``, ``last(x)``.

Each remembers what was before, and is asked of all rows in their order, each once; so what it says does not depend on
how they are cut into batches. What x says of telegrams is compared within a stream; where x names values that last
(variables), with what was known before, whoever sent it. A row of which x cannot be told, since a field of it is not
known, is passed over.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.expression.column_rows import identities, joined, picked
from nvscope.expression.masks import Test
from nvscope.expression.typed_columns import Column
from nvscope.expression.values import Evaluate, Moments, Operand, Operands, both_known

_NONE = -1
_NEVER = np.iinfo(np.int64).min


class Subject(Struct, frozen=True):
    """What a function of time is of: the fields that it names, and those of them that last."""

    named: tuple[str, ...]
    lasting: tuple[str, ...]

    def known(self, operands: Operands) -> Bool | None:
        """Tell of which rows it can be told: all that lasts is known, and something of the rest; None for all."""
        others = [operands[name].known for name in self.named if name not in self.lasting]
        known = reduce(both_known, [operands[name].known for name in self.lasting], None)
        if others and all(one is not None for one in others):
            some: Bool = reduce(np.bitwise_or, [one for one in others if one is not None])
            known = both_known(known, some)
        return known

    def stream(self, moments: Moments) -> I64:
        """Return which rows follow each other, as numbers of streams."""
        return np.zeros(len(moments.stream), np.int64) if self.lasting else moments.stream


def _moments(operands: Operands) -> Moments:
    assert operands.moments is not None
    return operands.moments


class _Order(Struct, frozen=True):
    """Rows by stream, in their order within each: ``row``, and where in it the row before is, -1 for none here.

    ``stream`` are those that have rows, ``first`` and ``last`` the places of their first and last rows.
    """

    row: I64
    before: I64
    stream: I64
    first: I64
    last: I64


def _ordered(operands: Operands, subject: Subject) -> _Order:
    """Return the rows of which something can be told, by stream."""
    moments = _moments(operands)
    stream = subject.stream(moments)
    known = subject.known(operands)
    row = np.arange(len(stream)) if known is None else np.flatnonzero(known)
    own = stream if known is None else stream[row]
    if len(own) and (own != own[0]).any():
        row = row[np.argsort(own, kind="stable")]
        own = stream[row]
    first = np.flatnonzero(np.diff(own, prepend=_NONE))
    before = np.arange(len(row)) - 1
    before[first] = _NONE
    last = np.append(first[1:], len(row)) - 1 if len(row) else first
    return _Order(row, before, own[first], first, last)


class _Memory:
    """A number for each stream, ``nothing`` where none was taken yet."""

    def __init__(self, nothing: int) -> None:
        self._nothing = nothing
        self._kept = np.zeros(0, np.int64)

    def of(self, stream: I64) -> I64:
        """Return the numbers of some streams."""
        self._grow(stream)
        kept: I64 = self._kept[stream]
        return kept

    def take(self, stream: I64, numbers: I64) -> None:
        """Take other numbers for some streams."""
        self._grow(stream)
        self._kept[stream] = numbers

    def _grow(self, stream: I64) -> None:
        more = int(stream.max(initial=_NONE)) + 1 - len(self._kept)
        if more > 0:
            self._kept = np.append(self._kept, np.full(max(more, len(self._kept)), self._nothing))


def _shifted(numbers: I64, order: _Order, memory: _Memory) -> I64:
    """Return the number of the row before for each ordered one, and remember the last ones."""
    before = numbers[np.maximum(order.before, 0)] if len(numbers) else numbers
    before[order.first] = memory.of(order.stream)
    memory.take(order.stream, numbers[order.last])
    return before


class Edge:
    """The test whether another test has become true, or false; where it was not known before, it has not."""

    def __init__(self, test: Test, subject: Subject, *, rises: bool, falls: bool) -> None:
        self._test, self._subject, self._rises, self._falls = test, subject, rises, falls
        self._memory = _Memory(_NONE)

    def __call__(self, operands: Operands) -> Bool:
        told = self._test(operands)
        order = _ordered(operands, self._subject)
        now = told[order.row].astype(np.int64)
        before = _shifted(now, order, self._memory)
        edge = np.zeros(len(order.row), np.bool_)
        if self._rises:
            edge |= (now == 1) & (before == 0)
        if self._falls:
            edge |= (now == 0) & (before == 1)
        found = np.zeros(len(told), np.bool_)
        found[order.row] = edge
        return found


class Changed:
    """The test whether a value is another one than before."""

    def __init__(self, evaluate: Evaluate, subject: Subject) -> None:
        self._evaluate, self._subject = evaluate, subject
        self._memory, self._has = _Memory(0), _Memory(0)

    def __call__(self, operands: Operands) -> Bool:
        operand = self._evaluate(operands)[0]
        order = _within(_ordered(operands, self._subject), operand)
        now = identities(operand.column)[order.row]
        was_known = _shifted(np.ones(len(now), np.int64), order, self._has)
        before = _shifted(now, order, self._memory)
        found = np.zeros(len(operand), np.bool_)
        found[order.row] = (was_known == 1) & (now != before)
        return found


def _within(order: _Order, operand: Operand) -> _Order:
    """Return an order of the rows alone in which a value exists."""
    if operand.known is None:
        return order
    there = operand.known[order.row]
    if there.all():
        return order
    counted = np.diff(np.append(order.first, len(order.row)))
    stream = np.repeat(order.stream, counted)[there]
    first = np.flatnonzero(np.diff(stream, prepend=_NONE))
    before = np.arange(len(stream)) - 1
    before[first] = _NONE
    last = np.append(first[1:], len(stream)) - 1 if len(stream) else first
    return _Order(order.row[there], before, stream[first], first, last)


class Held:
    """The test whether another test has been true for some time, without a row at which it was not."""

    def __init__(self, test: Test, subject: Subject, length_ns: int) -> None:
        self._test, self._subject, self._length_ns = test, subject, length_ns
        self._since = _Memory(_NEVER)

    def __call__(self, operands: Operands) -> Bool:
        told = self._test(operands)
        order = _ordered(operands, self._subject)
        time_ns, now = _moments(operands).time_ns[order.row], told[order.row]
        # Since when: the time of the first true row behind the last false one; of a row that is false, never.
        place = np.arange(len(now))
        start = np.where(now, 0, place + 1)
        start[order.first] = np.maximum(start[order.first], order.first)
        start = np.maximum.accumulate(start) if len(start) else start
        first_of = np.repeat(order.first, np.diff(np.append(order.first, len(now))))
        since = np.where(now, time_ns[np.minimum(start, max(len(now) - 1, 0))], _NEVER) if len(now) else time_ns
        goes_on = now & (start == first_of)
        kept = np.repeat(self._since.of(order.stream), np.diff(np.append(order.first, len(now))))
        since = np.where(goes_on & (kept != _NEVER), kept, since)
        self._since.take(order.stream, since[order.last])
        found = np.zeros(len(told), np.bool_)
        found[order.row] = now & (time_ns - np.where(now, since, time_ns) >= self._length_ns)
        return found


class Age:
    """Gives the time since a test was true the last time, 0 where it is; before it ever was, it does not exist."""

    def __init__(self, test: Test, subject: Subject) -> None:
        self._test, self._subject = test, subject
        self._last_ns = _NEVER

    def __call__(self, operands: Operands) -> Sequence[Operand]:
        told, time_ns = self._test(operands), _moments(operands).time_ns
        last = np.maximum.accumulate(np.where(told, np.arange(len(told)), _NONE)) if len(told) else time_ns
        last_ns = np.where(last == _NONE, self._last_ns, time_ns[last])
        if len(last_ns):
            self._last_ns = int(last_ns[-1])
        known = last_ns != _NEVER
        return [Operand(time_ns - np.where(known, last_ns, time_ns), known)]


def carrying(evaluate: Evaluate, subject: Subject) -> Test:
    """Return the test whether a row has a value itself, and not only since it lasts."""

    def test(operands: Operands) -> Bool:
        if not subject.lasting:
            return evaluate(operands)[0].presence
        carried = _moments(operands).carried
        found: Bool = reduce(np.bitwise_and, [carried(name) for name in subject.lasting])
        return found

    return test


class Before:
    """Gives the value that another one had before; where it had none, it does not exist."""

    def __init__(self, evaluate: Evaluate, subject: Subject) -> None:
        self._evaluate, self._subject = evaluate, subject
        self._kept: dict[int, Column] = {}

    def __call__(self, operands: Operands) -> Sequence[Operand]:
        operand = self._evaluate(operands)[0]
        order = _within(_ordered(operands, self._subject), operand)
        column = operand.column
        # Where a stream has a value from before, it is put behind all rows.
        extra: list[Column] = []
        place = np.full(len(order.stream), _NONE)
        for number, stream in enumerate(order.stream.tolist()):
            if stream in self._kept:
                place[number] = len(operand) + len(extra)
                extra.append(self._kept[stream])
        longer = joined([column, *extra])
        before = np.where(order.before == _NONE, _NONE, order.row[np.maximum(order.before, 0)]) if len(order.row) else (
            order.row
        )  # fmt: skip
        before[order.first] = place
        for stream, last in zip(order.stream.tolist(), order.row[order.last].tolist(), strict=True):
            self._kept[stream] = picked(column, np.array([last]))
        at, known = np.zeros(len(operand), np.int64), np.zeros(len(operand), np.bool_)
        at[order.row], known[order.row] = np.maximum(before, 0), before != _NONE
        operands.before.append(known)
        return [Operand(picked(longer, at), known)]
