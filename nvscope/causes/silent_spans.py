"""Silent spans: when none of the streams of a list was heard, however many there are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.engine.runs import runs_of


class SilentSpans(NamedTuple):
    """Spans of time in which streams were silent; columns int64 of shape (n,), ``stream`` from 0 on."""

    stream: I64
    since_ns: I64
    until_ns: I64

    def of_all(self, streams: int, start_ns: int, end_ns: int) -> tuple[I64, I64]:
        """Return from when to when all of so many streams were silent, within a time; the spans rise."""
        if not streams:
            return np.array([start_ns]), np.array([end_ns])
        since_ns, until_ns = self.since_ns.clip(start_ns, end_ns), self.until_ns.clip(start_ns, end_ns)
        some = until_ns > since_ns
        own = _apart(SilentSpans(self.stream[some], since_ns[some], until_ns[some]))
        # One more is silent from each beginning on, one less from each end.
        times_ns = np.concatenate([own.since_ns, own.until_ns])
        order = np.argsort(times_ns, kind="stable")
        silent = np.cumsum(np.repeat([1, -1], len(own.stream))[order])
        times_ns = times_ns[order]
        from_ = np.flatnonzero((silent[:-1] == streams) & (times_ns[1:] > times_ns[:-1]))
        return times_ns[from_], times_ns[from_ + 1]


def within_ns(since_ns: I64, until_ns: I64, edge: I64) -> I64:
    """Return how much of spans that rise and do not overlap lies between each edge and the next."""
    length = np.append(0, np.cumsum(until_ns - since_ns))
    begun = np.searchsorted(since_ns, edge, "right")
    # Of the last one that has begun, what lies behind the edge does not count yet.
    behind = np.where(begun > 0, np.maximum(np.append(0, until_ns)[begun] - edge, 0), 0)
    within: I64 = np.diff(length[begun] - behind)
    return within


def _apart(spans: SilentSpans) -> SilentSpans:
    """Return spans of which those of one stream do not overlap, as where a clock was set back; sorted by stream."""
    order = np.lexsort((spans.since_ns, spans.stream))
    stream, since_ns, until_ns = (column[order] for column in spans)
    start, stop = runs_of(stream)
    if not ((since_ns[1:] < until_ns[:-1]) & (stream[1:] == stream[:-1])).any():
        return SilentSpans(stream, since_ns, until_ns)
    latest_ns = until_ns.copy()
    for begin, end in zip(start.tolist(), stop.tolist(), strict=True):
        latest_ns[begin:end] = np.maximum.accumulate(until_ns[begin:end])
    begins = np.append(True, (since_ns[1:] > latest_ns[:-1]) | (stream[1:] != stream[:-1]))
    first = np.flatnonzero(begins)
    return SilentSpans(stream[first], since_ns[first], np.maximum.reduceat(latest_ns, first))
