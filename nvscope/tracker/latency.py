"""Latency: how long data telegrams waited for their acknowledgement, as a logarithmic histogram of each stream.

Buckets are those of intervals (``nvscope.tracker.buckets``), everything is an integer: histograms of several streams
add up to that of their list, and those of several windows to that of the whole.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from dissectors.keys import KeyTable
from nvscope.engine.dealing import Share
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.tracker.buckets import bucket_of
from nvscope.tracker.histograms import StreamPercentiles, known_extreme, percentiles_of_streams

_STREAM_BIT = 32
_BUCKET_OFFSET = 1 << 20
_PERCENTS = (50, 99)


class LatencyFigures(Struct, frozen=True):
    """How long acknowledgements took, in ns; None where there were none. Percentiles are within 0.5 %.

    ``count`` is None where nobody knows: acknowledgements were left out.
    """

    count: int | None = 0
    p50: int | None = None
    p99: int | None = None
    maximum: int | None = None


UNKNOWN_LATENCY = LatencyFigures(count=None)


class LatencyColumns(KeyedColumns):
    """One row a stream: the extremes of what its acknowledgements took."""

    least_ns: I64
    most_ns: I64
    COLUMNS: ClassVar = {
        "least_ns": (np.iinfo(np.int64).max * np.int64(1), 1),
        "most_ns": (np.iinfo(np.int64).min * np.int64(1), 1),
    }


class BucketColumns(KeyedColumns):
    """One row a stream and bucket: how many acknowledgements took so long."""

    count: I64
    COLUMNS: ClassVar = {"count": (np.int64(0), 1)}


class Latencies:
    """The acknowledgements of all streams, by how long they took.

    ``keys`` number streams with buckets, in one word: the stream from bit 32 on, below it the bucket.
    """

    def __init__(self) -> None:
        self.columns = LatencyColumns()
        self.keys = KeyTable(1)
        self.buckets = BucketColumns()

    def observe(self, stream: I64, latency_ns: I64, streams: int) -> None:
        """Take acknowledgements: of which streams' telegrams, and how long each took. Shapes (n,)."""
        self.columns.resize(streams)
        if not len(stream):
            return
        np.minimum.at(self.columns.least_ns, stream, latency_ns)
        np.maximum.at(self.columns.most_ns, stream, latency_ns)
        word = stream << _STREAM_BIT | (bucket_of(latency_ns) + _BUCKET_OFFSET)
        number = self.keys.numbers(word.view(np.uint64))
        self.buckets.resize(len(self.keys))
        np.add.at(self.buckets.count, number, 1)

    def take(self, part: Latencies, share: Share) -> None:
        """Take over the acknowledgements of a part's share of the lists."""
        self.columns.take(part.columns, share.streams)
        self.buckets.take_keyed(self.keys, part.buckets, part.keys.words)

    def counts_of(self, stream: int) -> tuple[I64, I64]:
        """Return buckets (``nvscope.tracker.buckets``), rising, and how many of one stream lie in each."""
        streams, bucket, count = self._counts()
        own = np.flatnonzero(streams == stream)
        own = own[np.argsort(bucket[own])]
        return bucket[own], count[own]

    def _counts(self) -> tuple[I64, I64, I64]:
        """Return stream, bucket and count of each histogram's parts."""
        word = self.keys.high.view(np.int64)
        bucket = (word & ((1 << _STREAM_BIT) - 1)) - _BUCKET_OFFSET
        return word >> _STREAM_BIT, bucket, self.buckets.column("count")

    def percentiles(self, percents: tuple[int, ...]) -> StreamPercentiles:
        """Return percentiles of all streams that have acknowledgements, as columns."""
        stream, bucket, count = self._counts()
        order = np.lexsort((bucket, stream))
        order = order[count[order] > 0]
        extremes = (column[stream[order]] for column in (self.columns.least_ns, self.columns.most_ns))
        return percentiles_of_streams(percents, stream[order], bucket[order], count[order], *extremes)

    def figures(self, group_of: I64) -> dict[int, LatencyFigures]:
        """Return the figures of streams taken together, by group; ``group_of`` has the group of each stream.

        Groups without acknowledgements are not there.
        """
        stream, bucket, count = self._counts()
        known = np.flatnonzero((count > 0) & (group_of[stream] >= 0))  # of windows, others are left as 0
        stream, bucket, count = stream[known], bucket[known], count[known]
        group = group_of[stream]
        order = np.lexsort((bucket, group))
        extremes = (column[stream[order]] for column in (self.columns.least_ns, self.columns.most_ns))
        told = percentiles_of_streams(_PERCENTS, group[order], bucket[order], count[order], *extremes)
        columns = told.stream, told.count, told.at_ns[50], told.at_ns[99], told.most_ns
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return {number: LatencyFigures(count, p50, p99, known_extreme(most)) for number, count, p50, p99, most in rows}
