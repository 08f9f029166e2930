"""What rules watch telegram by telegram: when expressions are true, and for how long."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import ClassVar

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.check.asked_rows import EVERY_LIST, Asked, OfLists
from nvscope.check.check import Setting
from nvscope.check.condition import Condition, together
from nvscope.check.stretches import Stretches
from nvscope.engine.told import Told
from nvscope.tracker.event_kinds import FRAMES_KEPT

_MOST_OPEN = 100_000


class MomentWatcher:
    """An observer of telegrams one by one, of those that the rule is for, while it is to be judged.

    ``judged`` counts those; ``start_ns`` is since when. What is asked of ``conditions`` is asked of all telegrams that
    they need.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting, conditions: Sequence[Condition], lists: OfLists | None = None) -> None:
        """``lists`` are those whose telegrams are looked at, beside those of the conditions."""
        self._setting = setting
        self._when = Condition(setting.when, setting.fields) if setting.when else None
        self._only = OfLists(patterns=setting.lists) if setting.lists else None
        asks = together([*conditions, *([self._when] if self._when else [])], self._only or lists)
        self._asks = asks if asks is None or lists is None else asks.and_of(lists)
        self.judged = 0
        self.start_ns = setting.since_ns

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not len(told):
            return
        self.start_ns = told.start_ns if self.start_ns is None else self.start_ns
        asked = self._setting.rows.of(told, self._asks)
        if not len(asked):
            return
        judged = np.ones(len(asked), np.bool_)
        if self._setting.since_ns is not None:
            judged &= asked.time_ns >= self._setting.since_ns
        if self._only is not None:
            judged &= self._setting.rows.own(asked, self._only, told.keys)
        self.look(asked, judged)

    def look(self, asked: Asked, judged: Bool) -> None:
        """Look at telegrams, of which some are to be judged, if it is the time for it; they follow those before."""
        if self._when is not None:
            judged &= self._when.told(asked)[0]
        self.judged += int(np.count_nonzero(judged))
        # Whatever bytes variables have, they are values of some kind: what is no number is told as that.
        with np.errstate(all="ignore"):
            self.take(asked, judged)

    @property
    def is_conditional(self) -> bool:
        """Whether it is judged only at times."""
        return self._when is not None

    def take(self, asked: Asked, judged: Bool) -> None:
        """Take telegrams, of which some are to be judged; they follow those taken before."""
        raise NotImplementedError


class TruthWatcher(MomentWatcher):
    """Watches for how long an expression is not as ``wanted``; moments at which nobody knows are left out.

    ``known`` counts the moments at which it was judged.
    """

    def __init__(self, setting: Setting, text: str, limit_ns: int, *, wanted: bool) -> None:
        self._condition = Condition(text, setting.fields)
        super().__init__(setting, [self._condition])
        self._wanted = wanted
        self.broken = Stretches(limit_ns)
        self.known = 0

    def take(self, asked: Asked, judged: Bool) -> None:
        true, known = self._condition.told(asked)
        self.known += int(np.count_nonzero(judged & known))
        row = np.flatnonzero(known | ~judged)
        so = (judged & known & (true != self._wanted))[row]
        self.broken.take(asked.time_ns[row], asked.frame[row], so)


class Counts:
    """How often something happened in one window after the other: fewest, most, and how many windows break a rule."""

    def __init__(self, least: int | None, most: int | None) -> None:
        self._least, self._most = least, most
        self._window = self._count = 0
        self._frame: int | None = None
        self.fewest: int | None = None
        self.highest: int | None = None
        self.broken = 0
        self.first_window: int | None = None
        self.frames: list[int] = []

    def take(self, window: int, count: int, frame: int) -> None:
        """Take what happened in a window, none of those before being told of again; ``frame`` is that of the first."""
        self._end(window)
        self._count += count
        self._frame = frame if self._frame is None else self._frame

    def up_to(self, window: int) -> Counts:
        """Return what it would be if all windows before one had ended; this one goes on."""
        found = copy(self)
        found.frames = list(self.frames)
        found._end(window)
        return found

    def _end(self, window: int) -> None:
        if window <= self._window:
            return
        self._add(self._window, 1, self._count, self._frame)
        self._add(self._window + 1, window - self._window - 1, 0, None)
        self._window, self._count, self._frame = window, 0, None

    def _add(self, window: int, windows: int, count: int, frame: int | None) -> None:
        if not windows:
            return
        self.fewest = count if self.fewest is None else min(self.fewest, count)
        self.highest = count if self.highest is None else max(self.highest, count)
        if (self._least is None or count >= self._least) and (self._most is None or count <= self._most):
            return
        self.broken += windows
        self.first_window = window if self.first_window is None else self.first_window
        if frame is not None and len(self.frames) < FRAMES_KEPT:
            self.frames.append(frame)


class Occurrences(MomentWatcher):
    """Watches when an expression becomes true: how often in each window of ``length_ns``, end to end.

    Without a ``text``, when telegrams of the rule's lists come; then ``counts`` are by the number of the list, else
    they are those of number 0.
    """

    def __init__(
        self, setting: Setting, text: str | None, length_ns: int, least: int | None, most: int | None
    ) -> None:  # fmt: skip
        self._condition = None if text is None else Condition(text, setting.fields, begins=True)
        conditions = [] if self._condition is None else [self._condition]
        super().__init__(setting, conditions, EVERY_LIST if text is None and not setting.lists else None)
        self.length_ns, self._least, self._most = length_ns, least, most
        self.counts: dict[int, Counts] = {}

    def take(self, asked: Asked, judged: Bool) -> None:
        begin_ns = int(asked.time_ns[0]) if self.start_ns is None else self.start_ns
        of = asked.list
        if self._condition is not None:
            judged, of = judged & self._condition.told(asked)[0], np.zeros(len(asked), np.int64)
        row = np.flatnonzero(judged & (of >= 0))
        if not len(row):
            return
        window = (asked.time_ns[row] - begin_ns) // self.length_ns
        keys, first, count = np.unique(np.stack([of[row], window]), axis=1, return_index=True, return_counts=True)
        columns = *keys.tolist(), count.tolist(), asked.frame[row[first]].tolist()
        for number, place, many, frame in zip(*columns, strict=True):
            self.of(number).take(place, many, frame)

    def of(self, number: int) -> Counts:
        """Return what was counted of a list."""
        return self.counts.setdefault(number, Counts(self._least, self._most))


class WaitWatcher(MomentWatcher):
    """Watches how long it takes, each time that one expression becomes true, until another one is.

    ``longest_ns`` is the longest wait so far, of those that ended; ``late`` of the ``waits`` took longer than
    the limit.
    """

    def __init__(self, setting: Setting, begins: str, ends: str, limit_ns: int) -> None:
        self._begins, self._ends = Condition(begins, setting.fields, begins=True), Condition(ends, setting.fields)
        super().__init__(setting, [self._begins, self._ends])
        self._limit_ns = limit_ns
        self._open_ns, self._open_frame = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self.waits = self.late = self.known = self.undecided = 0
        self.longest_ns: int | None = None
        self.first_ns: int | None = None
        self.frames: list[int] = []

    def take(self, asked: Asked, judged: Bool) -> None:
        begin = np.flatnonzero(self._begins.told(asked)[0] & judged)
        true, known = self._ends.told(asked)
        self.known += int(np.count_nonzero(known))
        end = np.flatnonzero(true)
        self.waits += len(begin)
        if len(end) and len(self._open_ns):
            self._over(self._open_ns, self._open_frame, np.full(len(self._open_ns), asked.time_ns[end[0]]))
            self._open_ns, self._open_frame = self._open_ns[:0], self._open_frame[:0]
        place = np.searchsorted(end, begin)
        over = place < len(end)
        row = begin[over]
        self._over(asked.time_ns[row], asked.frame[row], asked.time_ns[end[place[over]]])
        row = begin[~over][: _MOST_OPEN - len(self._open_ns)]
        self._open_ns = np.append(self._open_ns, asked.time_ns[row])
        self._open_frame = np.append(self._open_frame, asked.frame[row])

    def up_to(self, until_ns: int) -> WaitWatcher:
        """Return it with the waits that are open at a time as long as they are by then, if that is too long.

        How many are not is ``undecided``. This one goes on.
        """
        found = copy(self)
        found.frames = list(self.frames)
        found._end(until_ns)
        return found

    def _end(self, until_ns: int) -> None:
        late = until_ns - self._open_ns > self._limit_ns
        self._over(self._open_ns[late], self._open_frame[late], np.full(np.count_nonzero(late), until_ns))
        self.undecided = len(late) - int(np.count_nonzero(late))

    def _over(self, begin_ns: I64, frame: I64, end_ns: I64) -> None:
        if not len(begin_ns):
            return
        length_ns = end_ns - begin_ns
        self.longest_ns = max(int(length_ns.max()), self.longest_ns or 0)
        late = np.flatnonzero(length_ns > self._limit_ns)
        self.late += len(late)
        if len(late):
            self.first_ns = int(begin_ns[late[0]]) if self.first_ns is None else self.first_ns
            self.frames += frame[late[: FRAMES_KEPT - len(self.frames)]].tolist()


class FirstWatcher(MomentWatcher):
    """Watches when an expression is true for the first time."""

    def __init__(self, setting: Setting, text: str) -> None:
        self._condition = Condition(text, setting.fields)
        super().__init__(setting, [self._condition])
        self.known = 0
        self.first_ns: int | None = None
        self.frame: int | None = None

    def take(self, asked: Asked, judged: Bool) -> None:
        true, known = self._condition.told(asked)
        self.known += int(np.count_nonzero(known & judged))
        row = np.flatnonzero(true & judged)
        if len(row) and self.first_ns is None:
            self.first_ns, self.frame = int(asked.time_ns[row[0]]), int(asked.frame[row[0]])


class SequenceWatcher(MomentWatcher):
    """Watches runs of steps, which have to become true one after the other, the last one within a time of the first.

    A run begins with the first step, and is broken by a later step before its turn, or by time. What becomes true again
    of the steps behind it changes nothing.
    """

    def __init__(self, setting: Setting, steps: Sequence[str], limit_ns: int) -> None:
        self._steps = [Condition(one, setting.fields, begins=True) for one in steps]
        super().__init__(setting, self._steps)
        self._limit_ns = limit_ns
        self._begin: tuple[int, int] | None = None
        self._next = 0
        self.runs = self.broken = 0
        self.longest_ns: int | None = None
        self.first_ns: int | None = None
        self.frames: list[int] = []
        self.reason = ""

    def take(self, asked: Asked, judged: Bool) -> None:
        found = [np.flatnonzero(one.told(asked)[0]) for one in self._steps]
        step = np.repeat(np.arange(len(found)), [len(one) for one in found])
        row = np.concatenate(found)
        order = np.lexsort((step, row))
        columns = asked.time_ns[row[order]], asked.frame[row[order]], judged[row[order]], step[order]
        for time_ns, frame, may_begin, number in zip(*(one.tolist() for one in columns), strict=True):
            self._step(time_ns, frame, number, may_begin=may_begin)

    def _step(self, time_ns: int, frame: int, number: int, *, may_begin: bool) -> None:
        if self._begin is not None and time_ns - self._begin[0] > self._limit_ns:
            self._break(time_ns, f"step {self._next + 1} did not come in time")
        if self._begin is None:
            if number == 0 and may_begin:
                self._begin, self._next = (time_ns, frame), 1
                self.runs += 1
        elif number == self._next:
            self._next += 1
            if self._next == len(self._steps):
                self._finish(time_ns)
        elif number > self._next:
            self._break(time_ns, f"step {number + 1} came before step {self._next + 1}")

    def up_to(self, until_ns: int) -> SequenceWatcher:
        """Return it with the run that is open at a time broken, if it has taken too long by then; this one goes on."""
        found = copy(self)
        found.frames = list(self.frames)
        found._end(until_ns)
        return found

    @property
    def is_open(self) -> bool:
        """Whether a run has begun that has not ended."""
        return self._begin is not None

    def _end(self, until_ns: int) -> None:
        if self._begin is not None and until_ns - self._begin[0] > self._limit_ns:
            self._break(until_ns, f"step {self._next + 1} did not come in time")

    def _finish(self, time_ns: int) -> None:
        assert self._begin is not None
        self.longest_ns = max(time_ns - self._begin[0], self.longest_ns or 0)
        self._begin = None

    def _break(self, time_ns: int, reason: str) -> None:
        assert self._begin is not None
        begin_ns, frame = self._begin
        self.longest_ns = max(time_ns - begin_ns, self.longest_ns or 0)
        self.broken += 1
        if self.first_ns is None:
            self.first_ns, self.reason = begin_ns, reason
        if len(self.frames) < FRAMES_KEPT:
            self.frames.append(frame)
        self._begin = None
