"""Unusual intervals: those of a stream that are longer or shorter than somebody allows, and what loss explains of them.

An interval that has a loss in it is long because of the loss: the sender kept its time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from nvscope.engine.runs import distinct
from nvscope.findings.finding import Events
from nvscope.tracker.buckets import bucket_bounds
from nvscope.tracker.can.summary import CanStreamSummary
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.tracker.histograms import Histograms
from nvscope.tracker.kept_rows import LOSS_OF_NODE, LOSS_OF_STREAM
from nvscope.tracker.state import TrackerState
from nvscope.tracker.stream_summary import StreamSummary

AnyStream = StreamSummary | CanStreamSummary
Choice = Callable[[I64, I64], Bool]
"""Says of buckets, by their least and greatest intervals in ns, which are looked for."""


_NEAR = 5
"""An interval within a fifth of the nominal one of a multiple of it is about that."""


class Beyond(NamedTuple):
    """Intervals beyond a limit: their events, ``at_least`` so many, and the shortest and the longest one.

    Of these two, one that is no extreme of the stream is within 0.8 %.
    """

    events: Events
    at_least: bool
    shortest_ns: int
    longest_ns: int


class UnusualIntervals:
    """A look at the intervals of all streams of a state."""

    def __init__(self, state: TrackerState) -> None:
        self._state = state
        self._histograms = Histograms(state.senders.timing)

    def beyond(self, stream: AnyStream, chosen: Choice, *, lossless: bool = False) -> Beyond | None:
        """Return the intervals of the chosen buckets; None where there are none.

        With ``lossless``, only those without a loss. A bucket is chosen or not as a whole, so that intervals within
        0.8 % of a limit may count as kept. Of intervals near the usual one nobody knows when they were: they are as old
        and as young as the stream. Of the first ten of them, the frames are known.
        """
        rows, histograms = self._state.senders.timing.unusual.rows, self._histograms
        bucket, bits, row = histograms.unusual(stream.stream)
        wanted = chosen(*bucket_bounds(bucket))
        usual_bucket, usual_count = histograms.usual(stream.stream)
        near = chosen(*bucket_bounds(usual_bucket))
        usual = int(usual_count[near].sum())
        first_bucket, first_bits, first_frames = histograms.first_usual(stream.stream)
        first = chosen(*bucket_bounds(first_bucket))
        doubtful = 0
        if lossless:
            lossy = (bits & _loss_bit(stream)) != 0
            wanted &= ~lossy
            first &= (first_bits & _loss_bit(stream)) == 0
            # Near the usual interval it is not known which ones have a loss in them, but how many there are at most.
            doubtful = min(usual, max(0, self.gaps(stream) - int(rows.count[row[lossy]].sum())))
        row = row[wanted]
        count = int(rows.count[row].sum()) + usual - doubtful
        if not count:
            return None
        first_ns, last_ns = stream.first_ns, stream.last_ns
        if not usual:
            first_ns, last_ns = int(rows.first_ns[row].min()), int(rows.last_ns[row].max())
        frames = distinct(np.append(rows.frames[row], first_frames[first]))
        events = Events(count, first_ns, last_ns, tuple(frames[frames > 0][:FRAMES_KEPT].tolist()))
        low, high = bucket_bounds(np.append(bucket[wanted], usual_bucket[near]))
        shortest_ns, longest_ns = int(low.min()), int(high.max())
        least_ns, most_ns = stream.intervals.minimum, stream.intervals.maximum
        return Beyond(
            events, doubtful > 0, shortest_ns if least_ns is None else max(shortest_ns, least_ns),
            longest_ns if most_ns is None else min(longest_ns, most_ns),
        )  # fmt: skip

    def gaps(self, stream: AnyStream) -> int:
        """Return in how many intervals of a stream, at most, telegrams were lost."""
        if isinstance(stream, CanStreamSummary):
            return 0  # nobody counts there
        loss = self._state.senders.loss
        if _counted_by_node(stream):
            return int(loss.nodes.gaps[stream.node])
        return int(loss.streams.gaps[stream.stream, Scope.STREAM])

    def knows_loss(self, stream: AnyStream) -> bool:
        """Tell whether it is known which intervals have a loss in them, and which have none."""
        return isinstance(stream, CanStreamSummary) or stream.scope is not None

    def p99_without_loss(self, stream: AnyStream) -> int | None:
        """Return the 99th percentile of the intervals that have no loss in them, None where all have."""
        return self._histograms.without_loss(stream.stream, _loss_bit(stream)).percentile_ns(99)

    def p99_without_multiples(self, stream: AnyStream) -> int | None:
        """Return the same of those that are not about two, three … times the nominal one, None where all are."""
        whole, nominal_ns = self._histograms.of(stream.stream), stream.intervals.nominal or 1
        low, high = bucket_bounds(whole.bucket)
        middle = low + (high - low) // 2
        times = np.maximum((2 * middle + nominal_ns) // (2 * nominal_ns), 2)
        multiple = np.abs(middle - times * nominal_ns) * _NEAR <= nominal_ns
        return replace(whole, bucket=whole.bucket[~multiple], count=whole.count[~multiple]).percentile_ns(99)


def _loss_bit(stream: AnyStream) -> int:
    return LOSS_OF_NODE if _counted_by_node(stream) else LOSS_OF_STREAM


def _counted_by_node(stream: AnyStream) -> bool:
    """Tell whether a sender counts beyond its streams; where nobody knows, +1 along a stream is no loss in any case."""
    return isinstance(stream, StreamSummary) and stream.scope not in (None, Scope.STREAM)
