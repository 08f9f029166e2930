"""Silent spans: when none of the streams of a list was heard, however many there are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.causes.spans import joined


class SilentSpans(NamedTuple):
    """Spans of time in which streams were silent; columns int64 of shape (n,), ``stream`` from 0 on."""

    stream: I64
    since_ns: I64
    until_ns: I64

    def of_groups(self, group: I64, groups: int, start_ns: int, end_ns: int) -> SilentSpans:
        """Return from when to when all streams of each group were silent, within a time; ``stream`` is the group then.

        ``group`` is that of each stream, 0 … ``groups`` - 1. The spans of a group rise; one without streams is silent.
        """
        since_ns, until_ns = self.since_ns.clip(start_ns, end_ns), self.until_ns.clip(start_ns, end_ns)
        some = until_ns > since_ns
        # Those of one stream overlap where a clock was set back.
        own = SilentSpans(*joined(self.stream[some], since_ns[some], until_ns[some], 0))
        streams = np.bincount(group, minlength=groups)
        # Of a group, one more is silent from each beginning on, one less from each end; none behind the last.
        of_group = np.tile(group[own.stream], 2)
        times_ns = np.concatenate([own.since_ns, own.until_ns])
        order = np.lexsort((times_ns, of_group))
        silent = np.cumsum(np.repeat([1, -1], len(own.stream))[order])
        times_ns, of_group = times_ns[order], of_group[order]
        whole = (silent[:-1] == streams[of_group[:-1]]) & (times_ns[1:] > times_ns[:-1])
        from_ = np.flatnonzero(whole & (of_group[1:] == of_group[:-1]))
        empty = np.flatnonzero(streams == 0) if end_ns > start_ns else np.empty(0, np.int64)
        return SilentSpans(
            np.append(of_group[from_], empty),
            np.append(times_ns[from_], np.full(len(empty), start_ns)),
            np.append(times_ns[from_ + 1], np.full(len(empty), end_ns)),
        )


def within_ns(since_ns: I64, until_ns: I64, edge: I64) -> I64:
    """Return how much of spans that rise and do not overlap lies between each edge and the next."""
    length = np.append(0, np.cumsum(until_ns - since_ns))
    begun = np.searchsorted(since_ns, edge, "right")
    # Of the last one that has begun, what lies behind the edge does not count yet.
    behind = np.where(begun > 0, np.maximum(np.append(0, until_ns)[begun] - edge, 0), 0)
    within: I64 = np.diff(length[begun] - behind)
    return within
