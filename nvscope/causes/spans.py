"""Spans of time, as two columns: which of some touch one of others."""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.runs import runs_of

MOMENT_NS = 100_000_000
"""What is so near to each other is of one moment."""


def touching(since_ns: I64, until_ns: I64, others_since_ns: I64, others_until_ns: I64) -> Bool:
    """Tell which spans have a moment in common with one of some others; shape of the former.

    One that ends before it begins, as where a clock steps back, touches what contains it.
    """
    # Of the others that began until then, not all had ended before.
    begun = np.searchsorted(np.sort(others_since_ns), until_ns, "right")
    ended = np.searchsorted(np.sort(others_until_ns), since_ns, "left")
    touches: Bool = begun > ended
    return touches


def joined(group: I64, since_ns: I64, until_ns: I64, apart_ns: int) -> tuple[I64, I64, I64]:
    """Return spans as those of which two of one group lie at least ``apart_ns`` apart; by group, rising.

    Of two that are nearer or overlap, one is made.
    """
    order = np.lexsort((since_ns, group))
    group, since_ns, until_ns = group[order], since_ns[order], until_ns[order]
    if not ((since_ns[1:] - until_ns[:-1] < apart_ns) & (group[1:] == group[:-1])).any():
        return group, since_ns, until_ns
    latest_ns = until_ns.copy()
    for begin, end in zip(*(bound.tolist() for bound in runs_of(group)), strict=True):
        latest_ns[begin:end] = np.maximum.accumulate(until_ns[begin:end])
    begins = np.append(True, (since_ns[1:] - latest_ns[:-1] >= apart_ns) | (group[1:] != group[:-1]))
    first = np.flatnonzero(begins)
    return group[first], since_ns[first], np.maximum.reduceat(latest_ns, first)


def moments(times_ns: I64) -> int:
    """Return how many moments of a tenth of a second sorted times are of, each from the first one in it."""
    start, stop = runs_of(np.cumsum(np.append(0, np.diff(times_ns) > MOMENT_NS))[: len(times_ns)])
    long = times_ns[stop - 1] - times_ns[start] > MOMENT_NS
    count = len(start) - int(long.sum())
    # Only where one follows the other is there something to walk.
    for begin, end in zip(start[long].tolist(), stop[long].tolist(), strict=True):
        times, at = times_ns[begin:end].tolist(), 0
        while at < len(times):
            count += 1
            at = bisect_right(times, times[at] + MOMENT_NS, at)
    return count
