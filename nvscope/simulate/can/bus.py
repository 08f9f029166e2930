"""A CAN bus: one frame after the other, and of those that wait the one with the lowest identifier first."""

from __future__ import annotations

import heapq

import numpy as np

from dissectors.batch import I64, U32, Bool

_BASE_SHIFT = 18


def priority_of(identifier: U32, extended: Bool, remote: Bool) -> I64:
    """Return what is compared bit by bit when frames begin together: the lower number wins. Shapes (n,).

    ::

        standard   identifier 11 | RTR | IDE 0
        extended   base 11       | SRR 1 | IDE 1 | identifier 18 | RTR
    """
    word = identifier.astype(np.int64)
    base = np.where(extended, word >> _BASE_SHIFT, word)
    rest = np.where(
        extended, (3 << 19) | (word & ((1 << _BASE_SHIFT) - 1)) << 1 | remote, remote.astype(np.int64) << 20
    )
    return base << 21 | rest


def transmit(due: I64, priority: I64, duration: I64) -> I64:
    """Return when each frame has passed the bus that is due at a time and lasts for a while. Shapes (n,).

    A frame begins when the bus is free and no frame of a lower ``priority`` waits; it is never interrupted.
    """
    order = np.lexsort((priority, due))
    times, lasts, ranks = due[order], duration[order], priority[order]
    before = np.cumsum(lasts) - lasts
    # When the bus would be free, were every frame sent in the order in which it is due.
    ends = np.maximum.accumulate(times - before) + before + lasts if len(order) else times
    begins = np.ones(len(order), np.bool_)
    begins[1:] = times[1:] >= ends[:-1]
    disordered = ~begins
    disordered[1:] &= ranks[1:] < ranks[:-1]
    starts = np.append(np.flatnonzero(begins), len(order))
    busy = np.unique(np.searchsorted(starts, np.flatnonzero(disordered), "right") - 1)
    for first, last in zip(starts[busy].tolist(), starts[busy + 1].tolist(), strict=True):
        ends[first:last] = _arbitrated(
            times[first:last].tolist(), ranks[first:last].tolist(), lasts[first:last].tolist()
        )
    passed = np.empty(len(order), np.int64)
    passed[order] = ends
    return passed


def _arbitrated(due: list[int], priority: list[int], duration: list[int]) -> list[int]:
    """Return the ends of frames, by time of being due, between two moments at which the bus is idle."""
    ends = [0] * len(due)
    waiting: list[tuple[int, int]] = []
    now, coming = due[0], 0
    while coming < len(due) or waiting:
        while coming < len(due) and due[coming] <= now:
            heapq.heappush(waiting, (priority[coming], coming))
            coming += 1
        _, number = heapq.heappop(waiting)
        now += duration[number]
        ends[number] = now
    return ends
