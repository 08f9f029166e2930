"""Answers of what was asked while something was so: acknowledgements, and values for who starts."""

from __future__ import annotations

from bisect import insort
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from nvscope.check.check import Setting
from nvscope.check.first_frames import Longest
from nvscope.check.so_spans import SoSpans
from nvscope.check.while_so import WhileSo, while_so
from nvscope.engine.events import EventBatch
from nvscope.engine.told import Told
from nvscope.tracker.event_kinds import FRAMES_KEPT, EventKind

_KINDS = frozenset(
    {
        EventKind.ACKNOWLEDGED, EventKind.NO_ACKNOWLEDGEMENT, EventKind.BOOT_UP_ANSWERED,
        EventKind.BOOT_UP_UNANSWERED,
    }
)  # fmt: skip


class AnsweredWhile:
    """An observer, and a listener of the state's events, of what was asked while something ``holds``.

    It goes by when something was asked: an answer, or its time, may come when it holds no more. Lists are by number.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting, holds: WhileSo) -> None:
        self.holds, self._since_ns = holds, setting.since_ns
        self._heard: list[EventBatch] = []
        self._counts: dict[tuple[int, int], int] = defaultdict(int)
        self._frames: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
        self._longest: dict[tuple[int, int], Longest] = {}

    @property
    def spans(self) -> SoSpans:
        """When it held."""
        return self.holds.spans

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind, of the batch that is observed next."""
        if events.kind in _KINDS:
            self._heard.append(events)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far; its events were heard."""
        self.holds.see(told)
        heard, self._heard = self._heard, []
        for events in heard:
            judged = self.spans.at(events.since_ns)
            if self._since_ns is not None:
                judged &= events.since_ns >= self._since_ns
            self._take(events.take(np.flatnonzero(judged)))

    def _take(self, events: EventBatch) -> None:
        columns = events.list, events.frame, events.time_ns, events.since_ns
        for number, frame, time_ns, since_ns in zip(*(one.tolist() for one in columns), strict=True):
            place = int(events.kind), number
            self._counts[place] += 1
            kept = self._frames[place]
            if len(kept) < FRAMES_KEPT or frame < kept[-1][0]:
                insort(kept, (frame, time_ns))
                del kept[FRAMES_KEPT:]
            known = self._longest.get(place)
            if known is None or time_ns - since_ns > known.took_ns:
                self._longest[place] = Longest(time_ns - since_ns, frame, time_ns)

    def count(self, kind: EventKind, number: int) -> int:
        """Return how many events of a kind and list there were."""
        return self._counts.get((int(kind), number), 0)

    def of(self, kind: EventKind, number: int) -> Sequence[tuple[int, int]]:
        """Return the first frames of events of a kind and list, each with its time."""
        return self._frames.get((int(kind), number), ())

    def longest(self, kind: EventKind, number: int) -> Longest | None:
        """Return the event of a kind and list that took longest, from since when it waited; None without any."""
        return self._longest.get((int(kind), number))


def watch_answers(setting: Setting, told: Mapping[str, Any]) -> AnsweredWhile | None:
    """Return what watches at times only; what was asked at any time is known from the report."""
    holds = while_so(setting)
    return None if holds is None else setting.shared(("answers", setting.when), lambda: AnsweredWhile(setting, holds))
