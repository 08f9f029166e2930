"""ListLog: the events of lists that are findings as they stand, by kind and place, each with its first ten frames."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from dissectors.batch import I64, U64
from nvscope.engine.events import EventBatch
from nvscope.tracker.events import EventLog


class ListLog(EventLog):
    """An ``EventLog`` that listens; its keys are those of ``event_key``."""

    def hear(self, events: EventBatch) -> None:
        """Note events, which are sorted in when the log is settled."""
        words = event_key(events.kind, events.list, events.node, events.subindex)
        self.record(events.time_ns, events.frame, *words)


def event_key(event: IntEnum, lists: I64, node: I64, subindex: I64) -> tuple[U64, U64]:
    """Return the key of events: kind, numbers of list and node, and SubIndex, -1 each for none."""
    high = (np.uint64(event) << np.uint64(32)) | (lists + 1).astype(np.uint64)
    return high, ((node + 1).astype(np.uint64) << np.uint64(32)) | (subindex + 1).astype(np.uint64)


def event_parts(high: int, low: int) -> tuple[int, int, int, int]:
    """Take a key apart: kind, list, node, SubIndex, -1 each for none."""
    return high >> 32, (high & 0xFFFFFFFF) - 1, (low >> 32) - 1, (low & 0xFFFFFFFF) - 1
