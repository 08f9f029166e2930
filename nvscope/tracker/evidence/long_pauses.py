"""LongPauses: when streams paused for so long that it shows in a picture of the whole capture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.engine.events import EventBatch
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.timing import LONG_BITS

MOST_PAUSES = 1 << 18
"""So many are kept, 40 bytes each; those for which there is no room are counted."""


class PauseColumns(NamedTuple):
    """Pauses of streams in the order in which they ended; columns int64 of shape (n,)."""

    list: I64
    node: I64
    subindex: I64
    since_ns: I64
    time_ns: I64


_NONE = PauseColumns(*[np.empty(0, np.int64)] * len(PauseColumns._fields))


class LongPauses:
    """A listener; as the capture goes on, what was a long pause becomes a short one, and is forgotten."""

    def __init__(self, most: int = MOST_PAUSES) -> None:
        self._most = most
        self._start_ns: int | None = None
        self._parts: list[PauseColumns] = []
        self._kept = 0
        self._prune_at = min(most, 1 << 12)
        self.left_out = 0

    def hear(self, events: EventBatch) -> None:
        """Take events; those of any other kind than ``EventKind.UNUSUAL_INTERVAL`` are not looked at."""
        if events.kind is not EventKind.UNUSUAL_INTERVAL or not len(events):
            return
        if self._start_ns is None:
            self._start_ns = int(events.since_ns.min())
        long = np.flatnonzero(events.amount >= events.time_ns - self._start_ns >> LONG_BITS)
        room = long[: max(self._most - self._kept, 0)]
        self.left_out += len(long) - len(room)
        if not len(room):
            return
        self._parts.append(PauseColumns(*(getattr(events, name)[room] for name in PauseColumns._fields)))
        self._kept += len(room)
        if self._kept >= self._prune_at:
            self._forget(int(events.time_ns.max()))

    def columns(self) -> PauseColumns:
        """Return those that were told so far; later ones are others."""
        if not self._parts:
            return _NONE
        columns = zip(*self._parts, strict=True)
        return PauseColumns(*(np.concatenate(column).astype(np.int64) for column in columns))

    def _forget(self, now_ns: int) -> None:
        whole = self.columns()
        long = whole.time_ns - whole.since_ns >= now_ns - (self._start_ns or 0) >> LONG_BITS
        self._parts = [PauseColumns(*(column[long] for column in whole))]
        self._kept = int(long.sum())
        self._prune_at = min(max(2 * self._kept, 1 << 12), self._most)
