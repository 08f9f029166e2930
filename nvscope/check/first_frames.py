"""FirstFrames: the first frames of what happened to each list, so that a verdict can show where."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from nvscope.engine.events import EventBatch
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import FRAMES_KEPT, EventKind

_STREAM = int(Scope.STREAM)


class FirstFrames:
    """A listener that keeps the first frames of each kind of event, list and node, and when the first one was.

    ``since_ns``: what was before does not count.
    """

    def __init__(self, since_ns: int | None = None) -> None:
        self._since_ns = since_ns
        self._frames: dict[tuple[int, int, int], list[tuple[int, int]]] = defaultdict(list)

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind."""
        if not isinstance(events.kind, EventKind):
            return
        scope = _STREAM if events.scope is None else int(events.scope)
        columns = (events.list.tolist(), events.frame.tolist(), events.time_ns.tolist())
        for number, frame, time_ns in zip(*columns, strict=True):
            if self._since_ns is not None and time_ns < self._since_ns:
                continue
            kept = self._frames[int(events.kind), number, min(scope, int(Scope.NODE_TELEGRAM))]
            kept.append((frame, time_ns))
            if len(kept) > FRAMES_KEPT:
                kept.sort()
                del kept[FRAMES_KEPT:]

    def of(self, kinds: Sequence[EventKind], number: int, scope: Scope = Scope.STREAM) -> Sequence[tuple[int, int]]:
        """Return the first frames of some kinds of events of a list, by its number, each with its time."""
        own = min(int(scope), int(Scope.NODE_TELEGRAM))
        found = [one for kind in kinds for one in self._frames.get((int(kind), number, own), ())]
        return sorted(set(found))[:FRAMES_KEPT]
