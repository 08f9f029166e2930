"""LiveJudge: what is known of senders while they send."""

from __future__ import annotations

import time
from collections.abc import Mapping

from nvscope.datalogger.losses import Judged
from nvscope.list_key import ListKey
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize

_BETWEEN_S = 1.0
"""So often is looked again: what a sender counts does not change from one telegram to the next."""


class LiveJudge:
    """Tells what a state that goes on shows of senders; called again soon, it is what was told before."""

    def __init__(self, state: TrackerState, defined_ns: Mapping[ListKey, int]) -> None:
        self._state = state
        self._defined_ns = defined_ns
        self._known = Judged()
        self._looked_s = -_BETWEEN_S
        self._streams = 0

    def __call__(self) -> Judged:
        now_s = time.monotonic()
        streams = len(self._state.keys.streams) if self._state.memory.columns.telegrams.size else 0
        if now_s - self._looked_s >= _BETWEEN_S or streams != self._streams:
            self._looked_s, self._streams = now_s, streams
            self._known = Judged.of(summarize(self._state, intervals_ns=self._defined_ns), self._defined_ns)
        return self._known
