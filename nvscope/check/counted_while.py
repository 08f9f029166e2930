"""What is counted of lists while something is so: telegrams, and what happened to them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from nvscope.check.asked_rows import EVERY_LIST
from nvscope.check.check import Setting
from nvscope.check.while_so import So, WhileSo, while_so
from nvscope.engine.events import EventBatch
from nvscope.engine.told import Told
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import FRAMES_KEPT, EventKind
from nvscope.tracker.frame_counts import STEPS
from nvscope.tracker.subjects import Subject

_EVERY = -1
"""In place of a scope: no Counter is looked at."""

_COUNTED = ("lost", "gaps", "longest_gap", "duplicates", "overtaken", "restarts", "malformed")
_KINDS = frozenset(step.kind for name in _COUNTED for step in STEPS[name])


class CountedWhile:
    """An observer, and a listener of the state's events, that counts both while something ``holds``.

    Lists are by number. What a Counter shows is counted for each scope by itself, as events are told.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting, holds: WhileSo) -> None:
        self.holds, self._setting = holds, setting
        self._heard: list[EventBatch] = []
        self._telegrams: dict[int, int] = defaultdict(int)
        self._first_ns: dict[int, int] = {}
        self._sums: dict[tuple[int, int, int], int] = defaultdict(int)
        self._most: dict[tuple[int, int, int], int] = defaultdict(int)
        self._amounts: dict[tuple[int, int, int], int] = defaultdict(int)
        self._frames: dict[tuple[int, int, int], list[tuple[int, int]]] = defaultdict(list)

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind, of the batch that is observed next."""
        if events.kind in _KINDS:
            self._heard.append(events)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far; its events were heard."""
        so = self.holds.see(told)
        heard, self._heard = self._heard, []
        if not len(told):
            return
        for events in heard:
            self._count(events, so, told.first_frame)
        latest_ns, since_ns = self._setting.rows.latest_ns(told), self._setting.since_ns
        judged = so.true if since_ns is None else so.true & (latest_ns >= since_ns)
        for runs, _ in self._setting.rows.runs(told, EVERY_LIST):
            lists = np.repeat(runs.lists, runs.rows.stop - runs.rows.start)
            row = np.flatnonzero(judged[runs.rows.packet])
            own, packet = lists[row], runs.rows.packet[row]
            for number, count in enumerate(np.bincount(own).tolist()):
                self._telegrams[number] += count
            for number in set(np.unique(own).tolist()) - self._first_ns.keys():
                self._first_ns[number] = int(latest_ns[packet[own == number].min()])

    def _count(self, events: EventBatch, so: So, first_frame: int) -> None:
        packet = events.frame - first_frame
        chosen = (packet >= 0) & (packet < len(so.true))
        chosen[chosen] = so.true[packet[chosen]]
        if self._setting.since_ns is not None:
            chosen &= events.time_ns >= self._setting.since_ns
        events = events.take(np.flatnonzero(chosen))
        scope = _EVERY if events.scope is None else min(int(events.scope), int(Scope.NODE_TELEGRAM))
        columns = events.list.tolist(), events.amount.tolist(), events.frame.tolist(), events.time_ns.tolist()
        for number, amount, frame, time_ns in zip(*columns, strict=True):
            place = int(events.kind), number, scope
            self._sums[place] += 1
            self._amounts[place] += amount
            self._most[place] = max(self._most[place], amount)
            if len(self._frames[place]) < FRAMES_KEPT:
                self._frames[place].append((frame, time_ns))

    def telegrams(self, number: int) -> int:
        """Return how many telegrams of a list came."""
        return self._telegrams.get(number, 0)

    def first_ns(self, number: int) -> int | None:
        """Return when its first one came, None before any."""
        return self._first_ns.get(number)

    def figure(self, number: int, name: str, scope: Scope) -> int:
        """Return one of the figures of a list that events count."""
        found = 0
        for step in STEPS[name]:
            for place in _places(step.kind, number, scope):
                if name == "longest_gap":
                    found = max(found, self._most.get(place, 0))
                else:
                    found += step.by * (self._amounts if step.of_amount else self._sums).get(place, 0)
        return found

    def frames(self, kinds: Sequence[EventKind], number: int, scope: Scope) -> Sequence[tuple[int, int]]:
        """Return the first frames of some kinds of events of a list, each with its time."""
        places = [place for kind in kinds for place in _places(kind, number, scope)]
        return sorted({one for place in places for one in self._frames.get(place, ())})[:FRAMES_KEPT]


def _places(kind: EventKind, number: int, scope: Scope) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    return (int(kind), number, min(int(scope), int(Scope.NODE_TELEGRAM))), (int(kind), number, _EVERY)


def watch_at_times(setting: Setting, told: Mapping[str, Any]) -> CountedWhile | None:
    """Return what counts at times only; what happened at any time is known from the report."""
    holds = while_so(setting)
    return None if holds is None else setting.shared(("counted", setting.when), lambda: CountedWhile(setting, holds))


def telegrams_of(subject: Subject, counted: CountedWhile | None) -> int:
    """Return how many telegrams of a list are judged."""
    assert subject.list is not None
    return subject.measured.telegrams if counted is None else counted.telegrams(subject.list)
