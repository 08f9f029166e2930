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

    def resume(self, windows: int, begin_ns: int) -> None:
        """End what nobody listens to any more, after so many whole windows; the next ones begin at a time."""
        self._end(windows)
        self._window, self._count, self._frame = 0, 0, None
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
    they are those of number 0.
    """

    def __init__(
        self, setting: Setting, text: str | None, length_ns: int, least: int | None, most: int | None
    ) -> None:  # fmt: skip
        self._condition = None if text is None else Condition(text, setting.fields, begins=True)
        conditions = [] if self._condition is None else [self._condition]
        super().__init__(setting, conditions, EVERY_LIST if text is None and not setting.lists else None)
        self.length_ns, self._least, self._most = length_ns, least, most
        self._counts: dict[int, Counts] = {}
        self._runs: list[tuple[int, int]] = []
        """Since when somebody listened, and for how many whole windows; of each time that has ended."""
        self._is_heard = True

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if len(told) and not self._is_heard:
            self._is_heard, self.start_ns = True, int(told.batch.packets.ts_ns.min())
            for one in self._counts.values():
                one.resume(self._runs[-1][1], self.start_ns)
        super().observe(told)

    def take(self, asked: Asked, judged: Bool) -> None:
        begin_ns = int(asked.time_ns[0]) if self.start_ns is None else self.start_ns
        of = asked.list
        if self._condition is not None:
            judged, of = judged & self._condition.told(asked)[0], np.zeros(len(asked), np.int64)
        row = np.flatnonzero(judged & (of >= 0))
        if not len(row):
            return
        window = (asked.time_ns[row] - begin_ns) // self.length_ns
        numbers, frame = of[row], asked.frame[row]
        if (numbers != numbers[0]).any():
            order = np.argsort(numbers, kind="stable")
            numbers, window, frame = numbers[order], window[order], frame[order]
        # Of one list, windows follow each other.
        first = np.flatnonzero(np.append(True, (numbers[1:] != numbers[:-1]) | (window[1:] != window[:-1])))
        count = np.diff(np.append(first, len(numbers)))
        columns = numbers[first].tolist(), window[first].tolist(), count.tolist(), frame[first].tolist()
        for number, place, many, frame in zip(*columns, strict=True):
            self._of(number).take(place, many, frame)

    def resume(self, unheard: Unheard) -> None:
        """Leave the last window out of which nobody saw the end."""
        if unheard.everything and self._is_heard and self.start_ns is not None:
            self._is_heard = False
            self._runs.append((self.start_ns, self._whole(unheard.until_ns)))

    def windows(self, until_ns: int) -> int:
        """Return how many whole windows there are up to a time."""
        return sum(windows for _, windows in self._runs) + (self._whole(until_ns) if self._is_heard else 0)

    def counts(self, number: int, until_ns: int) -> Counts:
        """Return what was counted of a list up to a time, in whole windows."""
        return self._of(number).up_to(self._whole(until_ns) if self._is_heard else self._runs[-1][1])

    def _whole(self, until_ns: int) -> int:
        return 0 if self.start_ns is None else max(until_ns - self.start_ns, 0) // self.length_ns

    def _of(self, number: int) -> Counts:
        if number not in self._counts:
            begin_ns = self.start_ns or 0
            runs = [*self._runs[: None if self._is_heard else -1], (begin_ns, 0)]
            found = self._counts[number] = Counts(self._least, self._most, runs[0][0], self.length_ns)
            for (_, windows), (next_ns, _) in pairwise(runs):
                found.resume(windows, next_ns)
        return self._counts[number]
