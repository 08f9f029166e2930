"""Interval shapes: how the intervals of lists are spread, so that they can be drawn as bars beside a report."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from nvscope.tracker.buckets import bucket_bounds, bucket_of
from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary
from nvscope.tracker.histograms import Histogram, Histograms
from nvscope.tracker.state import TrackerState
from nvscope.tracker.stream_summary import StreamSummary
from nvscope.tracker.summary import ListSummary, Summary

_LEAST_BUCKETS = 2
"""A cell of a bar has so many buckets at least, a ratio of 1.1 %: else what is regular seems to have many habits."""

_BEYOND = 2
_BEYOND_ONE_IN = 200
_FEW = 20
_FAR_BUCKETS = 64
"""Of ``_FEW`` intervals or more, two at each end, or one in 200, are told in words if they are so far from the others:
a single outage leaves no room for the rest."""


class Bar(NamedTuple):
    """How many intervals lie in each of some cells, as many buckets wide each, from ``first_ns`` to ``last_ns``.

    ``nominal`` is the cell of the nominal interval, None where it lies in none. ``shorter`` and ``longer`` lie beyond.
    """

    cells: Sequence[int]
    first_ns: int
    last_ns: int
    nominal: int | None
    shorter: int
    longer: int


class IntervalShape(Struct, frozen=True):
    """The intervals of what one node sends of a list, each between two telegrams of one SubIndex."""

    histogram: Histogram
    nominal_ns: int | None

    @property
    def p50_ns(self) -> int | None:
        return self.histogram.percentile_ns(50)

    @property
    def p99_ns(self) -> int | None:
        return self.histogram.percentile_ns(99)

    def bar(self, cells: int) -> Bar | None:
        """Return the intervals in so many cells of a logarithmic scale; None where none is longer than nothing."""
        bucket, count = self.histogram.bucket, self.histogram.count
        placed = (bucket >= 0) & (count > 0)
        at_once, bucket, count = int(count[bucket < 0].sum()), bucket[placed], count[placed]
        if not len(bucket):
            return None
        total = int(count.sum())
        beyond = max(_BEYOND, total // _BEYOND_ONE_IN) if total >= _FEW else 0
        upto = np.cumsum(count)
        low, high = int(bucket[0]), int(bucket[-1])
        inner_low = int(bucket[np.searchsorted(upto, beyond, "right")])
        inner_high = int(bucket[np.searchsorted(upto, total - beyond)])
        low = inner_low if inner_low - low > _FAR_BUCKETS else low
        high = inner_high if high - inner_high > _FAR_BUCKETS else high
        width = max(_LEAST_BUCKETS, -(-(high - low + 1) // cells))
        first = max(low - (width * cells - (high - low + 1)) // 2, 0)
        inside = (bucket >= first) & (bucket < first + width * cells)
        found = np.zeros(cells, np.int64)
        np.add.at(found, (bucket[inside] - first) // width, count[inside])
        edges = bucket_bounds(np.array([first, first + width * cells - 1]))
        return Bar(
            found.tolist(), int(edges[0][0]), int(edges[1][1]), self._nominal(first, width, cells),
            at_once + int(count[bucket < first].sum()), int(count[bucket >= first + width * cells].sum()),
        )  # fmt: skip

    def _nominal(self, first: int, width: int, cells: int) -> int | None:
        if not self.nominal_ns:
            return None
        cell = (int(bucket_of(np.array([self.nominal_ns]))[0]) - first) // width
        return cell if 0 <= cell < cells else None


class IntervalShapes:
    """The shapes of all lists of a state, by the text of a list's key and of a node's address, None on CAN.

    They are computed when they are asked for.
    """

    def __init__(self, state: TrackerState, summary: Summary) -> None:
        self._state = state
        self._addresses = summary.addresses
        every: Sequence[ListSummary | CanListSummary] = (*summary.can.lists, *summary.lists)
        self.lists: Mapping[str, ListSummary | CanListSummary] = {str(entry.key): entry for entry in every}

    @cached_property
    def _histograms(self) -> Histograms:
        return Histograms(self._state.senders.timing)

    def of(self, key: str) -> dict[str | None, IntervalShape]:
        """Return the shapes of a list by sender; of senders without intervals, none."""
        senders: dict[str | None, list[StreamSummary | CanStreamSummary]] = defaultdict(list)
        for stream in self.lists[key].streams:
            if stream.intervals.count:
                senders[None if stream.node is None else self._addresses[stream.node]].append(stream)
        return {node: self._together(streams) for node, streams in senders.items()}

    def _together(self, streams: Sequence[StreamSummary | CanStreamSummary]) -> IntervalShape:
        found = [self._histograms.of(stream.stream) for stream in streams]
        bucket, place = np.unique(np.concatenate([one.bucket for one in found]), return_inverse=True)
        count = np.zeros(len(bucket), np.int64)
        np.add.at(count, place, np.concatenate([one.count for one in found]))
        least_ns, most_ns = min(one.least_ns for one in found), max(one.most_ns for one in found)
        nominal = next((stream.intervals.nominal for stream in streams if stream.intervals.nominal), None)
        return IntervalShape(Histogram(bucket, count, least_ns, most_ns), nominal)
