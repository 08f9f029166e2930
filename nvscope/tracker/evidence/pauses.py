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

    ``left_out`` counts the others. A clock that steps back makes no pause, nor do times in which nobody listened.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, most: int = MOST_PAUSES) -> None:
        self._most = most
        self._last_ns: int | None = None
        self.table = PauseTable(*[np.empty(0, np.int64)] * len(PauseTable._fields))
        self.left_out = 0

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        time_ns = told.packets.ts_ns
        if told.is_deaf:
            self._last_ns = None
        if not len(time_ns):
            return
        before_ns = np.roll(time_ns, 1)
        before_ns[0] = time_ns[0] if self._last_ns is None else self._last_ns
        self._last_ns = int(time_ns[-1])
        row = np.flatnonzero(time_ns > before_ns)
        found = PauseTable(before_ns[row], time_ns[row], row + told.first_frame)
        since_ns, until_ns, frame = (
            np.concatenate(parts) for parts in zip(self.table, found, strict=True)
        )  # fmt: skip
        longest = np.argsort(since_ns - until_ns, kind="stable")[: self._most]
        self.left_out += len(frame) - len(longest)
        longest.sort()
        self.table = PauseTable(since_ns[longest], until_ns[longest], frame[longest])
