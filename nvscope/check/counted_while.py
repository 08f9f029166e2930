"""What is counted of lists while something is so: telegrams, and what happened to them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from dissectors.batch import Bool
from nvscope.check.asked_rows import EVERY_LIST
from nvscope.check.check import Setting
from nvscope.check.open_gaps import OpenGaps
from nvscope.check.while_so import So, WhileSo, while_so
from nvscope.engine.events import EventBatch
from nvscope.engine.told import Told
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import FRAMES_KEPT, EventKind
from nvscope.tracker.frame_counts import STEPS
from nvscope.tracker.subjects import Subject

NOTHING_CAME = "none of its telegrams came while when was so"

_EVERY = -1
"""In place of a scope: no Counter is looked at."""

_COUNTED = ("lost", "gaps", "longest_gap", "duplicates", "overtaken", "restarts", "malformed")
_KINDS = frozenset(step.kind for name in _COUNTED for step in STEPS[name])


class CountedWhile:
    """An observer, and a listener of the state's events, that counts both while something ``holds``, None for always.

    Lists are by number. What a Counter shows is counted for each scope by itself, as events are told.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting, holds: WhileSo | None) -> None:
        self.holds, self._setting = holds, setting
        self._heard: list[EventBatch] = []
        self._telegrams: dict[int, int] = defaultdict(int)
        self._first: dict[int, tuple[int, int]] = {}
        self._sums: dict[tuple[int, int, int], int] = defaultdict(int)
        self._most: dict[tuple[int, int, int], int] = defaultdict(int)
        self._amounts: dict[tuple[int, int, int], int] = defaultdict(int)
        self._open: OpenGaps[bool] = OpenGaps()
        """With each gap, whether it counts."""

        self._back: dict[tuple[int, int], int] = defaultdict(int)
        self._frames: dict[tuple[int, int, int], list[tuple[int, int]]] = defaultdict(list)

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind, of the batch that is observed next."""
        if events.kind in _KINDS:
            self._heard.append(events)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far; its events were heard."""
        so = None if self.holds is None else self.holds.see(told)
        heard, self._heard = self._heard, []
        if not len(told):
            return
        masks = [self._judged(events, so, told.first_frame) for events in heard]
        for events, mask in zip(heard, masks, strict=True):
            self._count(events.take(np.flatnonzero(mask)))
        self._take_back(heard, masks)
        if so is None:
            return
        latest_ns, since_ns = self._setting.rows.latest_ns(told), self._setting.since_ns
        judged = so.true if since_ns is None else so.true & (latest_ns >= since_ns)
        for runs, _ in self._setting.rows.runs(told, EVERY_LIST):
            lists = np.repeat(runs.lists, runs.rows.stop - runs.rows.start)
            row = np.flatnonzero(judged[runs.rows.packet])
            own, packet = lists[row], runs.rows.packet[row]
            for number, count in enumerate(np.bincount(own).tolist()):
                self._telegrams[number] += count
            for number in set(np.unique(own).tolist()) - self._first.keys():
                first = packet[own == number].min()
                self._first[number] = int(latest_ns[first]), int(first) + told.first_frame

    def _judged(self, events: EventBatch, so: So | None, first_frame: int) -> Bool:
        """Tell which events are counted."""
        chosen = np.ones(len(events), np.bool_)
        if so is not None:
            packet = events.frame - first_frame
            chosen = (packet >= 0) & (packet < len(so.true))
            chosen[chosen] = so.true[packet[chosen]]
        if self._setting.since_ns is not None:
            chosen &= events.time_ns >= self._setting.since_ns
        return chosen

    def _take_back(self, heard: Sequence[EventBatch], masks: Sequence[Bool]) -> None:
        """Take what came late from the gap that it was missing in, whether that was counted or not."""
        rows = []
        for events, mask in zip(heard, masks, strict=True):
            if events.kind in (EventKind.GAP, EventKind.OVERTAKEN):
                columns = events.frame, events.list, events.node, events.subindex, events.amount, mask
                scope = _scope(events)
                rows += [(*row, scope, events.kind) for row in zip(*(one.tolist() for one in columns), strict=True)]
        for _, number, node, subindex, amount, counts, scope, kind in sorted(rows):
            place = number, node, subindex, scope
            if kind is EventKind.GAP:
                self._open.add(place, amount, counts)
                continue
            for back, was_counted in self._open.take_back(place, amount):
                self._back[number, scope] += back if was_counted else 0

    def _count(self, events: EventBatch) -> None:
        scope = _scope(events)
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

    def first(self, number: int | None) -> tuple[int, int] | None:
        """Return when the first one of a list came, and its frame; None before any."""
        return None if number is None else self._first.get(number)

    def figure(self, number: int, name: str, scope: Scope) -> int:
        """Return one of the figures of a list that events count."""
        found = 0
        for step in STEPS[name]:
            if name == "lost" and step.kind is EventKind.OVERTAKEN:
                found -= self._back.get((number, min(int(scope), int(Scope.NODE_TELEGRAM))), 0)
                continue
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


def _scope(events: EventBatch) -> int:
    return _EVERY if events.scope is None else min(int(events.scope), int(Scope.NODE_TELEGRAM))


def _places(kind: EventKind, number: int, scope: Scope) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    return (int(kind), number, min(int(scope), int(Scope.NODE_TELEGRAM))), (int(kind), number, _EVERY)


def watch_at_times(setting: Setting, told: Mapping[str, Any]) -> CountedWhile | None:
    """Return what counts at times only; what happened at any time is known from the report."""
    holds = while_so(setting)
    return None if holds is None else setting.shared(("counted", setting.when), lambda: CountedWhile(setting, holds))


def watch_counters(setting: Setting, told: Mapping[str, Any]) -> CountedWhile | None:
    """Return what counts at times only, or behind a warm-up: what was missing before may come behind it, and late."""
    if setting.since_ns is None and not setting.when:
        return None
    return setting.shared(("counted", setting.when), lambda: CountedWhile(setting, while_so(setting)))


def telegrams_of(subject: Subject, counted: CountedWhile | None) -> int:
    """Return how many telegrams of a list are judged."""
    assert subject.list is not None
    if counted is None or counted.holds is None:
        return subject.measured.telegrams
    return counted.telegrams(subject.list)
