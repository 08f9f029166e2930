"""Histograms of intervals: of one stream, and the percentiles of all streams at once as columns."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.engine.runs import runs_of
from nvscope.tracker.buckets import bounds_of, bucket_bounds
from nvscope.tracker.timing import UNUSUAL_STREAM_BIT, Timing, key_parts

UNKNOWN_LEAST, UNKNOWN_MOST = np.iinfo(np.int64).min, np.iinfo(np.int64).max
"""What stands for extremes that nobody knows, such as those of a difference: everything lies within them."""


def known_extreme(interval_ns: int) -> int | None:
    """Return an extreme, None where it is not known."""
    return None if interval_ns in (UNKNOWN_LEAST, UNKNOWN_MOST) else interval_ns


class StreamPercentiles(Struct, frozen=True):
    """What histograms tell, a row a stream that has intervals, rising: columns of shape (n,).

    ``at_ns`` has the percentiles by percent: each is the middle of its bucket, within the extremes.
    """

    stream: I64
    count: I64
    least_ns: I64
    most_ns: I64
    at_ns: dict[int, I64]


def percentiles_of_streams(
    percents: tuple[int, ...], stream: I64, bucket: I64, count: I64, least_ns: I64, most_ns: I64
) -> StreamPercentiles:
    """Return nearest-rank percentiles of counted intervals, which are sorted by stream and bucket.

    The columns have shape (m,); extremes are those of each row. A bucket may be there several times.
    """
    start, stop = runs_of(stream)
    total = np.append(0, np.cumsum(count))
    sizes = total[stop] - total[start]
    least = np.minimum.reduceat(least_ns, start) if len(start) else least_ns
    most = np.maximum.reduceat(most_ns, start) if len(start) else most_ns
    found = {}
    for percent in percents:
        rank = np.maximum(-(-percent * sizes // 100), 1)
        place = np.searchsorted(total[1:], total[start] + rank)
        low, high = bucket_bounds(bucket[place])
        found[percent] = np.minimum(np.maximum(low + (high - low) // 2, least), most)
    return StreamPercentiles(stream[start], sizes, least, most, found)


class Histograms:
    """A look at the histograms of a ``Timing``, with the unusual intervals found by stream."""

    def __init__(self, timing: Timing) -> None:
        self._columns = timing.columns
        self._rows = timing.unusual.rows
        self._order = timing.unusual.keys.rising()
        word = timing.unusual.keys.high.view(np.int64)[self._order]
        self._stream = word >> UNUSUAL_STREAM_BIT
        self._key = word & ((1 << UNUSUAL_STREAM_BIT) - 1)

    def unusual(self, stream: int) -> tuple[I64, I64, I64]:
        """Return the unusual intervals of a stream: bucket, loss bits, and their rows in ``Timing.unusual``."""
        begin, end = np.searchsorted(self._stream, (stream, stream + 1))
        return *key_parts(self._key[begin:end]), self._order[begin:end]

    def usual(self, stream: int) -> tuple[I64, I64]:
        """Return the other intervals of a stream, those near its usual one: bucket, rising, and how many."""
        dense = self._columns.dense[stream]
        inside = np.flatnonzero(dense)
        return inside + self._columns.first_bucket[stream], dense[inside]

    def first_usual(self, stream: int) -> tuple[I64, I64, I64]:
        """Return the first ten of those: bucket, loss bits, and the frames that ended them, rising."""
        kept = int(self._columns.usual_kept[stream])
        frames, keys = self._columns.usual_frames[stream, :kept], self._columns.usual_keys[stream, :kept]
        return *key_parts(keys), frames

    def of(self, stream: int) -> Histogram:
        """Return the histogram of one stream."""
        inside, dense = self.usual(stream)
        bucket, _, row = self.unusual(stream)
        everything = np.concatenate([inside, bucket])
        count = np.concatenate([dense, self._rows.count[row]])
        order = np.argsort(everything, kind="stable")
        everything, count = everything[order], count[order]
        start, _ = runs_of(everything)
        merged = np.add.reduceat(count, start) if len(start) else count
        extremes = int(self._columns.least_ns[stream]), int(self._columns.most_ns[stream])
        return Histogram(everything[start], merged, *extremes)

    def without_loss(self, stream: int, loss: int) -> Histogram:
        """Return the histogram of one stream without the intervals that have a loss bit of ``loss``."""
        whole = self.of(stream)
        bucket, bits, row = self.unusual(stream)
        lossy = (bits & loss) != 0
        count = whole.count.copy()
        np.subtract.at(count, np.searchsorted(whole.bucket, bucket[lossy]), self._rows.count[row[lossy]])
        return Histogram(whole.bucket, count, whole.least_ns, whole.most_ns)

    def percentiles(self, percents: tuple[int, ...], group_of: I64 | None = None) -> StreamPercentiles:
        """Return the percentiles of all streams that have intervals.

        With ``group_of``, those of streams taken together: it has the group of each stream, -1 for none, and ``stream``
        of the result is the group.
        """
        columns = self._columns
        stream, place = np.nonzero(columns.column("dense"))
        streams = np.concatenate([stream, self._stream])
        buckets = np.concatenate([place + columns.first_bucket[stream], key_parts(self._key)[0]])
        counts = np.concatenate([columns.dense[stream, place], self._rows.count[self._order]])
        groups = streams if group_of is None else group_of[streams]
        # In the difference of two histograms, some rows are empty.
        own = (counts > 0) & (groups >= 0)
        if not own.all():
            streams, buckets, counts, groups = streams[own], buckets[own], counts[own], groups[own]
        # Of one word, since both parts are in this order already: then they are only merged.
        least = int(buckets.min(initial=0))
        order = np.argsort(groups * (int(buckets.max(initial=0)) - least + 1) + buckets - least, kind="stable")
        extremes = columns.least_ns[streams[order]], columns.most_ns[streams[order]]
        return percentiles_of_streams(percents, groups[order], buckets[order], counts[order], *extremes)


class Histogram(Struct, frozen=True):
    """Counted intervals of one stream by bucket, rising; and the exact extremes."""

    bucket: I64
    count: I64
    least_ns: int
    most_ns: int

    def within(self, least_ns: int, most_ns: int) -> Histogram:
        """Return the same with other extremes."""
        return Histogram(self.bucket, self.count, least_ns, most_ns)

    def percentile_ns(self, percent: int) -> int | None:
        """Return the middle of the bucket of the nearest-rank percentile, within the extremes; None if empty."""
        total = int(self.count.sum())
        if not total:
            return None
        rank = max(-(-percent * total // 100), 1)
        place = int(np.searchsorted(np.cumsum(self.count), rank))
        low, high = bounds_of(int(self.bucket[place]))
        return min(max((low + high) // 2, self.least_ns), self.most_ns)
