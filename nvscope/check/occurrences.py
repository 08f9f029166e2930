"""How often something happens in windows that lie end to end, however telegrams are cut into batches."""

from __future__ import annotations

from copy import copy
from itertools import pairwise

import numpy as np

from dissectors.batch import Bool
from nvscope.check.asked_rows import EVERY_LIST, Asked
from nvscope.check.check import Setting
from nvscope.check.condition import Condition
from nvscope.check.moments import MomentWatcher
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.tracker.event_kinds import FRAMES_KEPT


class Counts:
    """How often something happened in one window after the other: fewest, most, and how many windows break a rule.

    Windows are numbered from ``begin_ns`` on, when somebody began to listen. ``first_ns`` is when the first one began
    that breaks the rule.
    """

    def __init__(self, least: int | None, most: int | None, begin_ns: int, length_ns: int) -> None:
        self._least, self._most = least, most
        self._begin_ns, self._length_ns = begin_ns, length_ns
        self._window = self._count = 0
        self._frame: int | None = None
        self.fewest: int | None = None
        self.highest: int | None = None
        self.broken = 0
        self.first_ns: int | None = None
        self.frames: list[int] = []
        self.times_ns: list[int] = []

    def take(self, window: int, count: int, frame: int) -> None:
        """Take what happened in a window, none of those before being told of again; ``frame`` is that of the first."""
        self._end(window)
        self._count += count
        self._frame = frame if self._frame is None else self._frame

    def up_to(self, window: int) -> Counts:
        """Return what it would be if all windows before one had ended; this one goes on."""
        found = copy(self)
        found.frames, found.times_ns = list(self.frames), list(self.times_ns)
        found._end(window)
        return found

    def leave(self, windows: int) -> None:
        """End what nobody counts any more, after so many whole windows."""
        self._end(windows)
        self._window, self._count, self._frame = 0, 0, None

    def begin(self, begin_ns: int) -> None:
        """Let the next windows begin at a time."""
        self._begin_ns = begin_ns

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
        begin_ns = self._begin_ns + window * self._length_ns
        self.first_ns = begin_ns if self.first_ns is None else self.first_ns
        self.times_ns += [begin_ns] if len(self.times_ns) < FRAMES_KEPT else []
        if frame is not None and len(self.frames) < FRAMES_KEPT:
            self.frames.append(frame)


class Occurrences(MomentWatcher):
    """Watches when an expression becomes true: how often in each window of ``length_ns``, end to end.

    Without a ``text``, when telegrams of the rule's lists come; then ``counts`` are by the number of the list, else
    they are those of number 0. Windows begin anew when somebody listens again, and each time that the rule is judged
    again; those that are not over by then are left out.
    """

    def __init__(
        self, setting: Setting, text: str | None, length_ns: int, least: int | None, most: int | None
    ) -> None:  # fmt: skip
        self._condition = None if text is None else Condition(text, setting.fields, begins=True)
        conditions = [] if self._condition is None else [self._condition]
        super().__init__(setting, conditions, EVERY_LIST if text is None and not setting.lists else None)
        self.length_ns = length_ns
        self._nothing = Counts(least, most, 0, length_ns)
        """What was counted of what never came."""
        self.known = 0
        """At how many moments anybody knew whether the expression was true."""

        self._counts: dict[int, Counts] = {}
        self._ended = 0
        """How many whole windows there were before those that go on now."""
        self._begin_ns: int | None = None
        """Since when windows lie end to end; None while nobody counts."""
        self._is_heard, self._was_so, self._is_first = True, False, True

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if len(told):
            begin_ns = int(told.batch.packets.ts_ns.min())
            if not self._is_heard:
                self._is_heard, self.start_ns = True, begin_ns
            if self.start_ns is None:
                self.start_ns = told.start_ns
            if self._when is None and self._begin_ns is None:
                self._begin(self.start_ns)
        super().observe(told)

    def look(self, asked: Asked, judged: Bool) -> None:
        """Look at telegrams, of which some are to be judged, if it is the time for it; they follow those before."""
        if self.start_ns is None:
            self.start_ns = int(asked.time_ns[0])
        if self._when is None and self._begin_ns is None:
            self._begin(self.start_ns)
        with np.errstate(all="ignore"):
            happened = judged
            if self._condition is not None:
                true, known = self._condition.told(asked)
                happened = judged & true
                self.known += int(np.count_nonzero(judged & known))
            so = None if self._when is None else self._when.told(asked)[0]
        self.judged += int(np.count_nonzero(judged if so is None else judged & so))
        if so is None:
            self._take(asked, happened, slice(None))
            return
        changes = np.flatnonzero(np.diff(so, prepend=self._was_so)).tolist()
        bounds = [0, *(one for one in changes if one), len(so)]
        for start, stop in pairwise(bounds):
            is_first, self._is_first = self._is_first, False
            if not so[start]:
                self._leave(int(asked.time_ns[start]))
                continue
            if self._begin_ns is None:
                # What is so from the first moment on has never been otherwise.
                goes_on = is_first or (self._was_so and not start)
                since_ns = self.start_ns if goes_on else int(asked.time_ns[start])
                self._begin(max(since_ns, self.start_ns))
            self._take(asked, happened, slice(start, stop))
        self._was_so = bool(so[-1])

    def _take(self, asked: Asked, happened: Bool, part: slice) -> None:
        """Count what happened among some of the telegrams."""
        assert self._begin_ns is not None
        of = asked.list[part] if self._condition is None else np.zeros(len(asked.list[part]), np.int64)
        row = np.flatnonzero(happened[part] & (of >= 0))
        if not len(row):
            return
        window = (asked.time_ns[part][row] - self._begin_ns) // self.length_ns
        numbers, frame = of[row], asked.frame[part][row]
        if (numbers != numbers[0]).any():
            order = np.argsort(numbers, kind="stable")
            numbers, window, frame = numbers[order], window[order], frame[order]
        # Of one list, windows follow each other.
        first = np.flatnonzero(np.append(True, (numbers[1:] != numbers[:-1]) | (window[1:] != window[:-1])))
        count = np.diff(np.append(first, len(numbers)))
        columns = numbers[first].tolist(), window[first].tolist(), count.tolist(), frame[first].tolist()
        for number, place, many, frame in zip(*columns, strict=True):
            self._of(number).take(place, many, frame)

    def _begin(self, time_ns: int) -> None:
        """Let windows lie end to end from a time on."""
        for one in (self._nothing, *self._counts.values()):
            one.begin(time_ns)
        self._begin_ns = time_ns

    def _leave(self, time_ns: int) -> None:
        """Leave the last window out, which is not over by a time."""
        if self._begin_ns is None:
            return
        windows = self._whole(time_ns)
        for one in (self._nothing, *self._counts.values()):
            one.leave(windows)
        self._ended += windows
        self._begin_ns = None

    def resume(self, unheard: Unheard) -> None:
        """Leave the last window out of which nobody saw the end."""
        if unheard.everything and self._is_heard and self.start_ns is not None:
            self._leave(unheard.until_ns)
            self._is_heard = self._was_so = False

    def windows(self, until_ns: int) -> int:
        """Return how many whole windows there are up to a time."""
        return self._ended + self._whole(until_ns)

    def counts(self, number: int, until_ns: int) -> Counts:
        """Return what was counted of a list up to a time, in whole windows."""
        return self._of(number).up_to(self._whole(until_ns))

    def _whole(self, until_ns: int) -> int:
        return 0 if self._begin_ns is None else max(until_ns - self._begin_ns, 0) // self.length_ns

    def _of(self, number: int) -> Counts:
        if number not in self._counts:
            self._counts[number] = self._nothing.up_to(0)
        return self._counts[number]
