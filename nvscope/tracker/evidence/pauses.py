"""Pauses: the longest times in which the capture holds no frame at all."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.engine.told import Told

MOST_PAUSES = 200


class PauseTable(NamedTuple):
    """Pauses by the frame that ends them, rising: the time of the frame before, of this one, and its number."""

    since_ns: I64
    time_ns: I64
    frame: I64


class Pauses:
    """An observer of all frames, which keeps the ``most`` longest pauses; of those as long, the first ones.

    A clock that steps back makes no pause, nor do times in which nobody listened.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, most: int = MOST_PAUSES) -> None:
        self._most = most
        self._last_ns: int | None = None
        self._longer_than_ns = 0
        self.table = PauseTable(*[np.empty(0, np.int64)] * len(PauseTable._fields))

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        time_ns = told.packets.ts_ns
        if told.is_deaf:
            self._last_ns = None
        if not len(time_ns):
            return
        before_ns, self._last_ns = self._last_ns, int(time_ns[-1])
        first_ns = 0 if before_ns is None else int(time_ns[0]) - before_ns
        # Once there are enough, hardly any batch has one that is longer than the shortest of them.
        if max(told.clock.longest_step_ns, first_ns) <= self._longer_than_ns:
            return
        row = np.flatnonzero(told.clock.step_ns > self._longer_than_ns) + 1
        length_ns = told.clock.step_ns[row - 1]
        if first_ns > self._longer_than_ns:
            row, length_ns = np.append(0, row), np.append(first_ns, length_ns)
        if len(row) > self._most:
            least_ns = np.partition(length_ns, -self._most)[-self._most]
            row, length_ns = row[length_ns >= least_ns], length_ns[length_ns >= least_ns]
        found = PauseTable(time_ns[row] - length_ns, time_ns[row], row + told.first_frame)
        since_ns, until_ns, frame = (np.concatenate(parts) for parts in zip(self.table, found, strict=True))
        longest = np.argsort(since_ns - until_ns, kind="stable")[: self._most]
        if len(longest) == self._most:
            self._longer_than_ns = int((until_ns - since_ns)[longest[-1]])
        longest.sort()
        self.table = PauseTable(since_ns[longest], until_ns[longest], frame[longest])
