"""Changes: where a sender goes on from one of its streams to another, or from one list to another."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.keys import Keys
from nvscope.engine.told import Told
from nvscope.tracker.repeated import Repeated
from nvscope.tracker.steps import Step, Steps

_FEW = 32  # senders: so few are counted one by one


class Changes:
    """The telegrams ``packet`` of a batch in the order of their nodes, ``start`` are where nodes begin.

    ``before`` is the stream of each node's telegram before, -1 where there was none. Those that are repeated are passed
    over. ``between_streams`` counts the telegrams of another stream than their node's telegram before,
    ``between_lists`` those of another list; ``last_stream`` is the stream of the last one. All by node.
    """

    def __init__(self, told: Told, keys: Keys, packet: I64, start: I64, before: I64, again: Repeated) -> None:
        self._start = start
        lists = keys.places.high[keys.place_of(np.arange(len(keys.streams)))].astype(np.int64)
        # List and stream in one number, as narrow as it can be: this is done with every telegram.
        bits = len(lists).bit_length()
        wide = lists << bits | np.arange(len(lists))
        number = wide.astype(np.min_scalar_type(int(wide.max())))
        now = number[keys.varieties.column("stream")].take(told.variety).take(packet)
        if len(again):
            again.pass_over(now, number[before])
        differs = np.empty_like(now)
        np.bitwise_xor(now[1:], now[:-1], out=differs[1:])
        differs[start] = np.where(before < 0, 0, now[start] ^ number[before])
        self._of_stream: Bool = differs != 0
        self._of_list: Bool = differs >= 1 << bits
        self.between_streams, self.between_lists = self._count(self._of_stream), self._count(self._of_list)
        self.last_stream: I64 = now[np.append(start[1:], len(now)) - 1].astype(np.int64) & (1 << bits) - 1

    def within_sends(self, steps: Steps) -> I64:
        """Count, by node, the telegrams with the current counter that are of the same list and another SubIndex."""
        same = steps.at(Step.SAME)
        together = same[self._of_stream[same] & ~self._of_list[same]]
        counts: I64 = np.diff(np.searchsorted(together, np.append(self._start, len(steps.step))))
        return counts

    def regular(self, steps: Steps) -> tuple[I64, I64]:
        """Count, by node, the changes of stream and those of list that are regular steps."""
        regular = steps.step == Step.REGULAR
        return self._count(self._of_stream & regular), self._count(self._of_list & regular)

    def _count(self, mask: Bool) -> I64:
        if len(self._start) > _FEW:
            sums: I64 = np.add.reduceat(mask, self._start, dtype=np.int64)
            return sums
        bounds = np.append(self._start, len(mask)).tolist()
        return np.array([np.count_nonzero(mask[begin:end]) for begin, end in pairwise(bounds)])
