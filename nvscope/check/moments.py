"""What rules watch telegram by telegram: when expressions are true, and for how long."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.check.asked_rows import Asked, OfLists
from nvscope.check.check import Setting
from nvscope.check.condition import Condition, together
from nvscope.check.stretches import Stretches
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.tracker.event_kinds import FRAMES_KEPT

_MOST_OPEN = 100_000


class Before(NamedTuple):
    """What held at a moment: whether it was so, whether anybody knows, and the frame that said so last."""

    true: bool
    known: bool
    frame: int


class MomentWatcher:
    """An observer of telegrams one by one, of those that the rule is for, while it is to be judged.

    ``judged`` counts those; ``start_ns`` is since when. What is asked of ``conditions`` is asked of all telegrams that
    they need.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting, conditions: Sequence[Condition], lists: OfLists | None = None) -> None:
        """``lists`` are those whose telegrams are looked at, beside those of the conditions."""
        self._setting = setting
        self._conditions = list(conditions)
        self._when = Condition(setting.when, setting.fields) if setting.when else None
        self._only = OfLists(patterns=setting.lists) if setting.lists else None
        self._conditions += [self._when] if self._when else []
        asks = together(self._conditions, self._only or lists)
        self._asks = asks if asks is None or lists is None else asks.and_of(lists)
        self.judged = 0
        self.start_ns = setting.since_ns
        self._so = Stretches(0)
        self._may_carry = setting.since_ns is not None and not setting.lists
        self._before: Before | None = None
        """What held up to the warm-up's end, as long as nothing has come behind that."""

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if len(told):
            self._look_at(told)
        for unheard in told.unheard:
            if unheard.everything:
                # What came last is not what holds when somebody listens again.
                for one in self._conditions:
                    one.forget()
                self._so.end(unheard.until_ns)
            self.resume(unheard)

    def resume(self, unheard: Unheard) -> None:
        """Leave what is open of the unheard without an end; what follows begins anew."""

    def _look_at(self, told: Told) -> None:
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
        while_so = True
        if self._when is not None:
            told = self._when.told(asked)[0]
            since_ns = self._setting.since_ns
            self._so.take(asked.time_ns, asked.frame, told if since_ns is None else told & (asked.time_ns >= since_ns))
            judged &= told
            while_so = bool(told[-1])
        self.judged += int(np.count_nonzero(judged))
        since_ns = self._setting.since_ns
        is_behind = since_ns is not None and int(asked.time_ns[-1]) >= since_ns
        if is_behind:
            self._carry_over()
        # Whatever bytes variables have, they are values of some kind: what is no number is told as that.
        with np.errstate(all="ignore"):
            self.take(asked, judged)
        if self._may_carry and not is_behind:
            last = self._lasting if while_so else None
            self._before = None if last is None else Before(*last, int(asked.frame[-1]))

    @property
    def _lasting(self) -> tuple[bool, bool] | None:
        """Whether what is asked was so at the telegram taken last, and whether anybody knows; None: it holds not on."""
        return None

    def _carry_over(self) -> None:
        """Take what held up to the end of the warm-up as what holds there: values last."""
        before, self._before = self._before, None
        if before is not None and before.known and self._setting.since_ns is not None:
            self.judged += 1
            self.carry(self._setting.since_ns, before)

    def carry_up_to(self, until_ns: int) -> None:
        """Do the same where nothing has come behind the warm-up, if that is over by a time."""
        if self._setting.since_ns is not None and until_ns >= self._setting.since_ns:
            self._carry_over()

    def carry(self, time_ns: int, before: Before) -> None:
        """Take that something is so at a time, and was before."""

    def longest_judged_ns(self, since_ns: int, until_ns: int) -> int:
        """Return for how long it was to be judged without a break, at most, of a capture from one time to another."""
        return until_ns - since_ns if self._when is None else self._so.up_to(until_ns).longest_ns or 0

    @property
    def is_conditional(self) -> bool:
        """Whether it is judged only at times."""
        return self._when is not None

    def take(self, asked: Asked, judged: Bool) -> None:
        """Take telegrams, of which some are to be judged; they follow those taken before."""
        raise NotImplementedError


class ConditionWatcher(MomentWatcher):
    """Watches one expression; ``known`` counts the moments at which it was judged."""

    def __init__(self, setting: Setting, text: str) -> None:
        self._condition = Condition(text, setting.fields)
        super().__init__(setting, [self._condition])
        self.known = 0
        self._told: tuple[bool, bool] | None = None

    @property
    def _lasting(self) -> tuple[bool, bool] | None:
        return self._told if self._condition.lasts else None

    def asked(self, asked: Asked, judged: Bool) -> tuple[Bool, Bool]:
        """Tell of which telegrams it is true, and of which that is known; some of them are judged."""
        true, known = self._condition.told(asked)
        self._told = bool(true[-1]), bool(known[-1])
        self.known += int(np.count_nonzero(judged & known))
        return true, known


class TruthWatcher(ConditionWatcher):
    """Watches for how long an expression is not as ``wanted``; moments at which nobody knows are left out."""

    def __init__(self, setting: Setting, text: str, limit_ns: int, *, wanted: bool) -> None:
        super().__init__(setting, text)
        self._wanted = wanted
        self.broken = Stretches(limit_ns)

    def carry(self, time_ns: int, before: Before) -> None:
        """Take that something is so at a time, and was before."""
        self.known += 1
        so = before.true != self._wanted
        self.broken.take(np.array([time_ns]), np.array([before.frame]), np.array([so]))

    def up_to(self, until_ns: int) -> TruthWatcher:
        """Return it with what is broken at a time ended by then; this one goes on."""
        found = copy(self)
        found.broken = self.broken.copied()
        found.carry_up_to(until_ns)
        found.broken.end(until_ns)
        return found

    def take(self, asked: Asked, judged: Bool) -> None:
        true, known = self.asked(asked, judged)
        row = np.flatnonzero(known | ~judged)
        so = (judged & known & (true != self._wanted))[row]
        self.broken.take(asked.time_ns[row], asked.frame[row], so)

    def resume(self, unheard: Unheard) -> None:
        """End what is broken when nobody listens any more."""
        if unheard.everything:
            self.broken.end(unheard.until_ns)


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
        self._given_up = 0
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
        self._given_up += int(np.count_nonzero(~over)) - len(row)
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
        self.undecided = self._given_up + len(late) - int(np.count_nonzero(late))

    def resume(self, unheard: Unheard) -> None:
        """Give up waits of which nobody sees the end, unless they are too long by then."""
        if unheard.everything:
            self._end(unheard.until_ns)
            self._given_up = self.undecided
            self._open_ns, self._open_frame = self._open_ns[:0], self._open_frame[:0]

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


class FirstWatcher(ConditionWatcher):
    """Watches when an expression is true for the first time."""

    def __init__(self, setting: Setting, text: str) -> None:
        super().__init__(setting, text)
        self.first_ns: int | None = None
        self.frame: int | None = None

    def carry(self, time_ns: int, before: Before) -> None:
        """Take that something is so at a time, and was before."""
        self.known += 1
        if before.true and self.first_ns is None:
            self.first_ns, self.frame = time_ns, before.frame

    def up_to(self, until_ns: int) -> FirstWatcher:
        """Return it as it is at a time, of which nothing more comes; this one goes on."""
        found = copy(self)
        found.carry_up_to(until_ns)
        return found

    def take(self, asked: Asked, judged: Bool) -> None:
        true, _ = self.asked(asked, judged)
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
        self.runs = self.broken = self.given_up = 0
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
    def undecided(self) -> int:
        """How many runs have begun of which nobody knows how they end."""
        return self.given_up + (self._begin is not None)

    def _end(self, until_ns: int) -> None:
        if self._begin is not None and until_ns - self._begin[0] > self._limit_ns:
            self._break(until_ns, f"step {self._next + 1} did not come in time")

    def resume(self, unheard: Unheard) -> None:
        """Give up a run of which nobody sees the end, unless it is too long by then."""
        if unheard.everything:
            self._end(unheard.until_ns)
            self.given_up += self._begin is not None
            self._begin = None

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
