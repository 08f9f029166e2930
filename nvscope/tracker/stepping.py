"""Who takes a step: all telegrams but those that are repeated, which a mirror or router shows again."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U8, Bool
from nvscope.tracker.node_steps import AnyColumn
from nvscope.tracker.steps import Step, Steps


class Stepping:
    """The telegrams of some sequences, laid end to end, without those that are ``repeated`` (None: without none).

    ``start`` and ``stop`` bound what is left of each sequence that has any left, and ``left`` says which these are;
    the others have only repeated telegrams here.
    """

    def __init__(self, repeated: Bool | None, start: I64, stop: I64) -> None:
        self._repeated = repeated
        self._whole_start, self._whole_stop = start, stop
        self.start, self.stop, self.left = start, stop, np.arange(len(start))
        if repeated is None:
            return
        self._place = np.flatnonzero(~repeated)
        bounds = np.searchsorted(self._place, np.append(start, len(repeated)))
        self.left = np.flatnonzero(bounds[1:] > bounds[:-1])
        self.start, self.stop = bounds[self.left], bounds[self.left + 1]

    def of(self, column: AnyColumn) -> AnyColumn:
        """Return a column of all telegrams without the repeated ones."""
        if self._repeated is None:
            return column
        left: AnyColumn = column[self._place]
        return left

    def among_all(self, steps: Steps) -> Steps:
        """Return the steps of all telegrams: the repeated ones are of those that were there before."""
        if self._repeated is None:
            return steps
        step: U8 = np.full(len(self._repeated), Step.LATE, np.uint8)
        distance = np.zeros(len(step), np.uint16)
        step[self._place], distance[self._place] = steps.step, steps.distance
        return Steps(step, distance, steps.current, steps.missing, np.flatnonzero(step != Step.REGULAR))

    def taken(self, begin: I64) -> I64:
        """Return of each sequence how many telegrams from place ``begin[i]`` on take a step."""
        count: I64 = self._whole_stop - begin
        if self._repeated is not None:
            before = np.append(0, np.cumsum(self._repeated))
            count -= before[self._whole_stop] - before[begin]
        return count
