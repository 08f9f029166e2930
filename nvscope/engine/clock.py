"""Clock: the times of the frames of a batch, to be asked which frame is the first behind a moment."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64


class Clock:
    """The times of the frames of a batch; ``steady`` where none is earlier than the one before it.

    ``step_ns`` are the times between one of them and the next one, ``longest_step_ns`` is the longest, 0 of a frame
    alone.
    """

    def __init__(self, time_ns: I64) -> None:
        self.time_ns = time_ns
        self.step_ns: I64 = np.diff(time_ns)
        self.steady = not len(self.step_ns) or bool(self.step_ns.min() >= 0)
        self.longest_step_ns = int(self.step_ns.max()) if len(self.step_ns) else 0
        self.latest = time_ns if self.steady else np.maximum.accumulate(time_ns)

    def __len__(self) -> int:
        return len(self.time_ns)

    def expired(self, deadline_ns: I64, packet: I64, until: I64) -> I64:
        """Return the same as ``first_behind``, but the count of packets also where it lies after packet ``until``."""
        found = np.full(len(packet), len(self))
        last = np.minimum(until, len(self) - 1)
        # Looking it up is only worth it where the deadline has passed at all.
        passed = np.flatnonzero(self.latest[last] > deadline_ns)
        first = self.first_behind(deadline_ns[passed], packet[passed])
        found[passed] = np.where(first <= until[passed], first, len(self))
        return found

    def first_behind(self, deadline_ns: I64, packet: I64) -> I64:
        """Return the first packet after each given one (-1: from the first) with a later time; their count if none."""
        found = np.searchsorted(self.latest, deadline_ns, "right")
        # The clock may have been ahead before the wait began: then the running maximum says nothing.
        ahead = np.flatnonzero(found <= packet)
        if len(ahead):
            found[ahead] = _first_greater(self.time_ns, packet[ahead] + 1, deadline_ns[ahead])
        return found


def _first_greater(values: I64, start: I64, bound: I64) -> I64:
    """Return, for each start, the first place from there on whose value is above the bound; the length if none.

    The maxima of all stretches of 1, 2, 4 … values let every search skip by halving steps.
    """
    maxima = [values]
    while 1 << len(maxima) <= len(values):
        half = 1 << (len(maxima) - 1)
        maxima.append(np.maximum(maxima[-1][:-half], maxima[-1][half:]))
    place = start.copy()
    for level in reversed(range(len(maxima))):
        highest = maxima[level]
        skips = (place < len(highest)) & (highest[np.minimum(place, len(highest) - 1)] <= bound)
        place[skips] += 1 << level
    return place
