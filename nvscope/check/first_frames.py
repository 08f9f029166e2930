"""FirstFrames: the first frames of what happened to each list, so that a verdict can show where."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.engine.events import EventBatch
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import FRAMES_KEPT, EventKind
from nvscope.tracker.frame_counts import STEPS

_NONE = np.iinfo(np.int64).max
_EVERY = -1
"""In place of a scope: no Counter is looked at."""

_MOST_STEPS = 10_000
_TIMED = frozenset({EventKind.BOOT_UP_ANSWERED, EventKind.ACKNOWLEDGED})
"""Those of which the one is kept that took longest."""

_KINDS = (
    frozenset(
        {step.kind for steps in STEPS.values() for step in steps}
        | {EventKind.NO_ACKNOWLEDGEMENT, EventKind.BOOT_UP_UNANSWERED, EventKind.TORN_CYCLE, EventKind.STEP_BACK}
    )
    | _TIMED
)
"""Those that verdicts show; of the others, some happen to every telegram."""


_WAITS = _TIMED | {EventKind.NO_ACKNOWLEDGEMENT, EventKind.BOOT_UP_UNANSWERED}


class Longest(NamedTuple):
    """An event that took so long, the frame that it is told of, and when it was over."""

    took_ns: int
    frame: int
    time_ns: int


class FirstFrames:
    """A listener that keeps the first frames of each kind of event and list, and how long the longest of them took.

    ``since_ns``: what was before does not count. ``clock_steps`` are when the clock stepped back, and how far, in ns.
    """

    def __init__(self, since_ns: int | None = None) -> None:
        self._since_ns = since_ns
        self._frames: dict[tuple[int, int, int], list[tuple[int, int]]] = defaultdict(list)
        self._last: dict[tuple[int, int], I64] = {}
        """By kind and scope, for each list the last frame that is kept, of those that have as many as are kept."""

        self._longest: dict[tuple[int, int], Longest] = {}
        self.clock_steps: list[tuple[int, int]] = []
        self.begun_before: dict[tuple[int, int], int] = defaultdict(int)
        """By kind and list, of how many waits that ended behind the warm-up the beginning was in it."""

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind."""
        if events.kind not in _KINDS:
            return
        if self._since_ns is not None:
            events = events.take(np.flatnonzero(events.time_ns >= self._since_ns))
            if events.kind in _WAITS:
                early = events.since_ns < self._since_ns
                for number in events.list[early].tolist():
                    self.begun_before[int(events.kind), number] += 1
                events = events.take(np.flatnonzero(~early))
        if events.kind is EventKind.STEP_BACK:
            room = _MOST_STEPS - len(self.clock_steps)
            self.clock_steps += list(zip(events.time_ns.tolist(), events.amount.tolist(), strict=True))[:room]
            return
        scope = _EVERY if events.scope is None else int(events.scope)
        if events.kind in _TIMED:
            self._hear_times(events)
            return
        place = int(events.kind), min(scope, int(Scope.NODE_TELEGRAM))
        last = self._last.get(place, np.zeros(0, np.int64))
        lists = np.maximum(events.list, 0)
        if len(lists) and lists.max() >= len(last):
            last = np.append(last, np.full(int(lists.max()) + 1 - len(last), _NONE))
            self._last[place] = last
        # Most are behind the first ones, and are not looked at one by one.
        row = np.flatnonzero(events.frame < last[lists])
        columns = (events.list[row].tolist(), events.frame[row].tolist(), events.time_ns[row].tolist())
        for number, frame, time_ns in zip(*columns, strict=True):
            kept = self._frames[place[0], number, place[1]]
            kept.append((frame, time_ns))
            if len(kept) > FRAMES_KEPT:
                kept.sort()
                del kept[FRAMES_KEPT:]
                last[max(number, 0)] = kept[-1][0]

    def of(self, kinds: Sequence[EventKind], number: int, scope: Scope = Scope.STREAM) -> Sequence[tuple[int, int]]:
        """Return the first frames of some kinds of events of a list, by its number, each with its time."""
        own = min(int(scope), int(Scope.NODE_TELEGRAM))
        found = [one for kind in kinds for at in (own, _EVERY) for one in self._frames.get((int(kind), number, at), ())]
        return sorted(set(found))[:FRAMES_KEPT]

    def _hear_times(self, events: EventBatch) -> None:
        took_ns = events.time_ns - events.since_ns
        order = np.lexsort((-events.frame, took_ns, events.list))
        last = np.flatnonzero(np.diff(events.list[order], append=-1))
        for row in order[last].tolist():
            place = int(events.kind), int(events.list[row])
            known = self._longest.get(place)
            if known is None or took_ns[row] > known.took_ns:
                self._longest[place] = Longest(int(took_ns[row]), int(events.frame[row]), int(events.time_ns[row]))

    def longest(self, kind: EventKind, number: int) -> Longest | None:
        """Return the event of a kind and list that took longest, from since when it waited; None without any."""
        return self._longest.get((int(kind), number))
