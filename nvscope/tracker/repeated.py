"""Repeated telegrams, which a mirror or router shows again: they take no step in any sequence of counters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.batch import I64, U16, U64, Bool
from nvscope.engine.runs import distinct
from nvscope.tracker.sequence import walk
from nvscope.tracker.steps import Step, Steps, walk_one

if TYPE_CHECKING:  # as in dissectors.batch, importing it takes too long
    import numpy.typing as npt


class Repeated:
    """The places, rising, of repeated telegrams in sequences laid end to end, which begin at ``start``."""

    def __init__(self, place: I64, start: I64) -> None:
        self.place, self._start = place, start
        begins = np.append(start, -1)[np.searchsorted(start, place)] == place
        # In a row of them, all stand behind the same telegram.
        first = np.flatnonzero(np.append(True, (np.diff(place) != 1) | begins[1:])[: len(place)])
        length = np.diff(np.append(first, len(place)))
        self._behind = np.repeat(place[first] - 1, length)
        self._begins = np.repeat(begins[first], length)

    def __len__(self) -> int:
        return len(self.place)

    @property
    def sequence(self) -> I64:
        """Which sequence each of them is in."""
        sequence: I64 = np.searchsorted(self._start, self.place, "right") - 1
        return sequence

    def pass_over(self, column: npt.NDArray[Any], before: npt.NDArray[Any]) -> None:
        """Let each of them have what the last telegram has that is none of them; ``before`` is that of the sequences.

        Where all up to the beginning of the sequence are repeated, that is what stood ``before`` it.
        """
        column[self.place] = np.where(self._begins, before[self.sequence], column[self._behind])

    def walk(self, counter: U16, current: U16, missing: U64, fresh: Bool) -> Steps:
        """Walk as ``nvscope.tracker.sequence.walk`` does, past those that are repeated: these are LATE.

        What they have in ``counter`` is of no matter, and is overwritten.
        """
        if not len(self):
            return walk(counter, self._start, current, missing, fresh)
        # The counter in front of it once more moves nothing, unless that was a 0 or 1 that was overtaken.
        self.pass_over(counter, current)
        steps = walk(counter, self._start, current, missing, fresh)
        restarts = steps.step[self.place] == Step.RESTART
        steps.step[self.place] = Step.LATE
        if restarts.any():
            for sequence in distinct(self.sequence[restarts]).tolist():
                self._walk_by_rule(
                    steps, counter, sequence, None if fresh[sequence] else int(current[sequence]), missing
                )
            steps.irregular = np.flatnonzero(steps.step != Step.REGULAR)
        return steps

    def _walk_by_rule(self, steps: Steps, counter: U16, sequence: int, current: int | None, missing: U64) -> None:
        """Walk one sequence without those that are repeated."""
        stop = np.append(self._start[1:], len(counter))[sequence]
        taken = np.ones(len(counter), np.bool_)
        taken[self.place] = False
        row = int(self._start[sequence]) + np.flatnonzero(taken[self._start[sequence] : stop])
        step, distance, last, word = walk_one(counter[row].tolist(), current, int(missing[sequence]))
        steps.step[row], steps.distance[row] = step, distance
        steps.current[sequence], steps.missing[sequence] = last, word
