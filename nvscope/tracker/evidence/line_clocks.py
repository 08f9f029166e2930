"""LineClocks: whether the frames of each line on CAN, a channel in one direction, are in the order of their times.

Programs that log several channels take frames from each as they come, and mix them: what is not in order over all
lines can be in order in each of them, and then no clock was set.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.tracker.capture import CLOCK_STEP_NS

_DIRECTIONS = 4


class LineClocks:
    """An observer of CAN frames; ``are_in_order`` where no line has a frame far before the one in front of it."""

    by_stream: ClassVar[bool] = False

    def __init__(self) -> None:
        self._last_ns: dict[int, int] = {}
        self.are_in_order = True

    @property
    def count(self) -> int:
        """How many lines were seen."""
        return len(self._last_ns)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if told.can is None or not len(told.can):
            return
        line = told.can.channel.astype(np.int64) * _DIRECTIONS + told.can.direction
        order = stable_order(line, int(line.max()) + 1)
        line, time_ns = line[order], told.can.ts_ns[order]
        before_ns = np.roll(time_ns, 1)
        start, stop = runs_of(line)
        own = line[start].tolist()
        before_ns[start] = [self._last_ns.get(one, int(first)) for one, first in zip(own, time_ns[start], strict=True)]
        self._last_ns |= zip(own, time_ns[stop - 1].tolist(), strict=True)
        self.are_in_order &= not bool((before_ns - time_ns > CLOCK_STEP_NS).any())
