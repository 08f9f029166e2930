"""What rules watch of variables: their values, one telegram after the other."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from copy import copy
from typing import Any

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, Bool
from nvscope.check.asked_rows import Asked, OfLists
from nvscope.check.check import Setting
from nvscope.check.moments import Before, MomentWatcher
from nvscope.check.stretches import Stretches
from nvscope.check.variable_places import VariablePlace
from nvscope.engine.runs import rows_by
from nvscope.engine.watch import Unheard
from nvscope.expression.column_rows import identities, picked
from nvscope.expression.typed_columns import Column, FieldType, TextColumn
from nvscope.tracker.event_kinds import FRAMES_KEPT

_COUNTERS = 1 << 16
_ROUNDED = 1e-9
_LATE = 16
"""A telegram whose Counter is at most so many behind the highest one was overtaken, or came again."""

_PART = 1 << 40
"""More than any Counter goes in a batch."""

NUMBERS = (FieldType.UNSIGNED, FieldType.SIGNED, FieldType.REAL, FieldType.BOOL, FieldType.DURATION)
"""The types that values can be computed with; a duration is in ns."""


class Values(Struct, frozen=True):
    """The values of a variable in telegrams of one batch, in their order; shapes (n,).

    Those of one ``segment`` have nothing between them that was not to be judged.
    """

    column: Column
    time_ns: I64
    frame: I64
    stream: I64
    segment: I64

    @property
    def numbers(self) -> Any:
        """The values as numbers, true and false as 1 and 0."""
        column: Any = self.column
        return column.astype(np.int64) if column.dtype.kind == "b" else column


class Watch(Struct):
    """What is known of one variable so far: how many values were judged, which broke the rule, and where first."""

    place: Any
    judged: int = 0
    broken: int = 0
    worst: float | None = None
    first_ns: int | None = None
    frames: list[int] = field(default_factory=list)

    def take(self, values: Values) -> None:
        """Take values, which follow those taken before."""
        raise NotImplementedError

    def forget(self, streams: Collection[int] | None) -> None:
        """Forget what came last in some streams, None for all: nobody listened to what came behind it."""

    def breaks(self, values: Values, row: I64) -> None:
        """Take the rows of values that break the rule."""
        self.broken += len(row)
        if len(row):
            self.first_ns = int(values.time_ns[row[0]]) if self.first_ns is None else self.first_ns
            self.frames += values.frame[row[: FRAMES_KEPT - len(self.frames)]].tolist()


class VariableWatcher(MomentWatcher):
    """Watches variables; ``in_order``: telegrams that came too late, or again, are left out."""

    def __init__(self, setting: Setting, watches: Sequence[Watch], *, in_order: bool = False) -> None:
        keys = frozenset(key for one in watches for key, _ in one.place.field.sent_in)
        super().__init__(setting, [], OfLists(keys))
        self.watches = watches
        self._late = setting.shared(("late", keys), LateTelegrams) if in_order else None
        self._segment = 0

    def take(self, asked: Asked, judged: Bool) -> None:
        segment = self._segment + np.cumsum(~judged)
        self._segment = int(segment[-1]) if len(segment) else self._segment
        if self._late is not None:
            judged = judged & ~self._late.of(asked)
        for one in self.watches:
            exists = one.place.field.exists(asked.rows)
            row = np.flatnonzero(judged if exists is None else judged & exists)
            if not len(row):
                continue
            one.judged += len(row)
            column = one.place.field.column(asked.rows)
            if len(row) == len(asked):
                one.take(Values(column, asked.time_ns, asked.frame, asked.stream, segment))
            else:
                columns = (each[row] for each in (asked.time_ns, asked.frame, asked.stream, segment))
                one.take(Values(picked(column, row), *columns))

    def resume(self, unheard: Unheard) -> None:
        """Compare nothing with what came before nobody listened."""
        streams = None if unheard.everything else unheard.streams.tolist()
        if self._late is not None:
            self._late.forget(streams)
        for one in self.watches:
            one.forget(streams)


class LateTelegrams:
    """Which telegrams of some lists came too late, or again; told once for all rules that ask of the same ones."""

    def __init__(self) -> None:
        self._highest: dict[int, int] = {}
        self._asked: Asked | None = None
        self._late = np.zeros(0, np.bool_)

    def of(self, asked: Asked) -> Bool:
        """Tell which of them are, which follow those asked of before or are the last ones."""
        if self._asked is not asked:
            self._asked, self._late = asked, overtaken(asked.stream, asked.counter, self._highest)
        return self._late

    def forget(self, streams: Collection[int] | None) -> None:
        """Forget how far the Counters of some streams were, None for all."""
        _forget(self._highest, streams)


def _forget(known: dict[int, Any] | None, streams: Collection[int] | None) -> None:
    if known is None:
        return
    for number in list(known) if streams is None else streams:
        known.pop(number, None)


def overtaken(stream: I64, counter: I64, highest: dict[int, int]) -> Bool:
    """Tell which telegrams come behind a later one of their stream, and remember the ``highest`` Counter of each."""
    late = np.zeros(len(stream), np.bool_)
    for (number,), row in rows_by([stream]):
        steps = np.diff(counter[row], prepend=highest.get(number, int(counter[row[0]])))
        # How far the Counter went, the shorter way round.
        went = (steps + _COUNTERS // 2) % _COUNTERS - _COUNTERS // 2
        jumps = went < -_LATE
        went[jumps] = 0
        position = np.cumsum(went)
        # Behind a jump it counts anew: what was reached before it says nothing.
        part = np.cumsum(jumps)
        reached = np.maximum.accumulate(np.maximum(position + part * _PART, 0)) - part * _PART
        late[row] = position < reached
        highest[number] = int(counter[row[-1]]) + int(reached[-1] - position[-1])
        highest[number] %= _COUNTERS
    return late


class RangeWatch(Watch):
    """Whether values lie between two limits, in the unit of the field; None: there is none on that side.

    ``lowest`` and ``highest`` are the extremes, None before any; ``nan`` counts what is no number.
    """

    least: float | None = None
    most: float | None = None
    lowest: float | None = None
    highest: float | None = None
    nan: int = 0

    def take(self, values: Values) -> None:
        numbers = values.numbers
        if numbers.dtype.kind == "f":
            numbers = numbers.astype(np.float64)
        is_nan = np.isnan(numbers) if numbers.dtype.kind == "f" else np.zeros(len(numbers), np.bool_)
        out = is_nan.copy()
        self.nan += int(np.count_nonzero(is_nan))
        if not is_nan.all():
            low, high = np.nanmin(numbers).item(), np.nanmax(numbers).item()
            self.lowest = low if self.lowest is None else min(low, self.lowest)
            self.highest = high if self.highest is None else max(high, self.highest)
        if self.least is not None:
            out |= numbers < self.least
        if self.most is not None:
            out |= numbers > self.most
        self.breaks(values, np.flatnonzero(out))


class EnumWatch(Watch):
    """Whether values are some of those that are allowed."""

    allowed: frozenset[int | float | str] = frozenset()
    other: str = ""

    def take(self, values: Values) -> None:
        column = values.column
        if isinstance(column, TextColumn):
            fine = np.array([text in self.allowed for text in column.texts], np.bool_)[column.code]
        else:
            fine = np.isin(values.numbers, [one for one in self.allowed if not isinstance(one, str)])
        row = np.flatnonzero(~fine)
        if len(row) and not self.broken:
            first = picked(column, row[:1])
            if isinstance(first, TextColumn):
                self.other = first.texts[int(first.code[0])]
            else:
                self.worst = np.asarray(first)[0].item()
                self.other = f"{self.worst}"
        self.breaks(values, row)


class _Stepwise(Watch):
    """Looks at what a value is to the one before it in its stream."""

    before: dict[int, tuple[Any, int, int]] = field(default_factory=dict)

    def take(self, values: Values) -> None:
        numbers = values.numbers
        for (number,), own_rows in rows_by([values.stream]):
            own, time_ns, segment = numbers[own_rows], values.time_ns[own_rows], values.segment[own_rows]
            row = own_rows[1:]
            if number in self.before:
                last, last_ns, last_segment = self.before[number]
                own, time_ns = np.append(np.asarray([last], own.dtype), own), np.append(last_ns, time_ns)
                row, segment = own_rows, np.append(last_segment, segment)
            self.before[number] = own[-1], int(time_ns[-1]), int(segment[-1])
            together = segment[1:] == segment[:-1]
            if together.any():
                self.steps(values, row[together], _steps(own)[together], np.diff(time_ns)[together])

    def forget(self, streams: Collection[int] | None) -> None:
        _forget(self.before, streams)

    def steps(self, values: Values, row: I64, step: Any, took_ns: I64) -> None:
        """Take steps to values, given by their rows, from those before."""
        raise NotImplementedError


def _steps(numbers: Any) -> Any:
    """Return how far each number is from the one before, as doubles or int64."""
    if numbers.dtype.kind == "f":
        return np.diff(numbers.astype(np.float64))
    if numbers.dtype == np.uint64:
        return np.diff(numbers).view(np.int64)
    return np.diff(numbers.astype(np.int64))


class MonotonicWatch(_Stepwise):
    """Whether values go one way only; ``wrap``: behind so many they begin anew, 0 for never."""

    up: bool = True
    strict: bool = False
    wrap: float = 0

    def steps(self, values: Values, row: I64, step: Any, took_ns: I64) -> None:
        forward = step if self.up else -step
        if self.wrap:
            forward = (forward + self.wrap / 2) % self.wrap - self.wrap / 2
        back = np.maximum(-forward, 0)
        self.worst = max(self.worst or 0, back.max().item())
        self.breaks(values, row[forward <= 0] if self.strict else row[forward < 0])


class RateWatch(_Stepwise):
    """Whether values change no faster than so much a second."""

    most: float = 0

    def steps(self, values: Values, row: I64, step: Any, took_ns: I64) -> None:
        timed = took_ns > 0
        if not timed.any():
            return
        per_second = np.abs(step[timed].astype(np.float64)) / took_ns[timed] * 1e9
        self.worst = max(self.worst or 0, np.nanmax(per_second, initial=0).item())
        # Decimal fractions are no binary ones: 0.1 in 100 ms is no more than 1 a second.
        self.breaks(values, row[timed][~(per_second <= self.most * (1 + _ROUNDED))])


class FrozenWatch(Watch):
    """For how long a value stays as it is while its list is sent; a longer silence says nothing."""

    most_ns: int = 0
    longest_ns: int = 0
    since: dict[int, tuple[int, int, int, bool, int]] = field(default_factory=dict)

    def forget(self, streams: Collection[int] | None) -> None:
        _forget(self.since, streams)

    def take(self, values: Values) -> None:
        now = identities(values.column)
        for (number,), row in rows_by([values.stream]):
            own, time_ns = now[row], values.time_ns[row]
            known = self.since.get(number)
            segment = values.segment[row]
            if known is None:
                known = int(time_ns[0]), int(own[0]), int(time_ns[0]), False, int(segment[0])
            begin_ns, last, last_ns, told, last_segment = known
            anew = np.diff(own, prepend=last) != 0
            anew |= np.diff(segment, prepend=last_segment) != 0
            anew |= np.diff(time_ns, prepend=last_ns) > self.most_ns
            place = np.maximum.accumulate(np.where(anew, np.arange(len(row)), -1))
            since_ns = np.where(place < 0, begin_ns, time_ns[np.maximum(place, 0)])
            length_ns = time_ns - since_ns
            self.longest_ns = max(self.longest_ns, int(length_ns.max()))
            # Of each stretch, the first telegram beyond the limit.
            over = length_ns > self.most_ns
            first = over & ~np.append(told, over[:-1] & ~anew[1:])
            self.breaks(values, row[first])
            self.since[number] = int(since_ns[-1]), int(own[-1]), int(time_ns[-1]), bool(over[-1]), int(segment[-1])


class HopWatcher(MomentWatcher):
    """Watches for how long one variable differs from another one by more than a tolerance, since either changed."""

    def __init__(
        self, setting: Setting, source: VariablePlace, target: VariablePlace, tolerance: float, most_ns: int
    ) -> None:  # fmt: skip
        super().__init__(
            setting, [], OfLists(frozenset(key for one in (source, target) for key, _ in one.field.sent_in))
        )
        self._fields = source.field, target.field
        self._tolerance = tolerance
        self._last: list[float | None] = [None, None]
        self.apart = Stretches(most_ns)
        self.known = self.changes = 0
        self.largest = 0.0
        """The largest difference, however short it was."""

        self._told: tuple[bool, bool] | None = None
        self._apart_by = 0.0

    @property
    def _lasting(self) -> tuple[bool, bool] | None:
        return self._told

    def carry(self, time_ns: int, before: Before) -> None:
        """Take that they differ at a time, or do not, and did before."""
        self.known += 1
        self.largest = max(self.largest, self._apart_by)
        self.apart.take(np.array([time_ns]), np.array([before.frame]), np.array([before.true]))

    def up_to(self, until_ns: int) -> HopWatcher:
        """Return it with what goes on at a time ended by then; this one goes on."""
        found = copy(self)
        found.apart = self.apart.copied()
        found.carry_up_to(until_ns)
        found.apart.end(until_ns)
        return found

    def take(self, asked: Asked, judged: Bool) -> None:
        columns, changes = [], []
        for number, one in enumerate(self._fields):
            exists = one.exists(asked.rows)
            known = np.ones(len(asked), np.bool_) if exists is None else exists
            column: Any = one.column(asked.rows)
            filled, changed = self._filled(number, column.astype(np.float64), known)
            columns.append(filled)
            changes.append(changed)
        apart = np.abs(columns[0] - columns[1])
        known = ~np.isnan(apart)
        row = np.flatnonzero(known)
        if not len(row):
            return
        self._told, self._apart_by = (bool(apart[row[-1]] > self._tolerance), True), float(apart[row[-1]])
        self.known += len(row)
        self.changes += int(np.count_nonzero(changes[0] & judged))
        so = (apart > self._tolerance) & judged
        self.largest = max(self.largest, float(apart[known & judged].max(initial=0.0)))
        self.apart.take(asked.time_ns[row], asked.frame[row], so[row], changes[0][row])

    def resume(self, unheard: Unheard) -> None:
        """Compare nothing with what came before nobody listened."""
        if unheard.everything:
            self.apart.end(unheard.until_ns)
            self._last, self._told = [None, None], None

    def _filled(self, number: int, column: Any, known: Bool) -> tuple[Any, Bool]:
        """Return a value for each row, NaN before the first, and at which rows it changes."""
        last = self._last[number]
        at = np.maximum.accumulate(np.where(known, np.arange(len(column)), -1))
        filled = np.where(at < 0, np.nan if last is None else last, column[np.maximum(at, 0)])
        before = np.append(np.nan if last is None else last, filled[:-1])
        if not np.isnan(filled[-1]):
            self._last[number] = float(filled[-1])
        return filled, (filled != before) & ~np.isnan(before)
