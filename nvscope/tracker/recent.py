"""The intervals of the last minute, beside those of the whole run."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.timing import Histogram, bucket_of

WINDOW_S = 60
_S_NS = 1_000_000_000
_MAX_WAITING = 1 << 20

# Stream, second of the window and bucket are sorted as one number.
_BUCKET_BITS, _SECOND_BITS = 21, 6
_BUCKET_OFFSET = 1 << (_BUCKET_BITS - 1)


class Recent:
    """Counts intervals by stream, second of their end, and bucket, for the last minute of the capture.

    The minute is the second of the latest time and the 59 before it. What was not counted yet waits in columns as it
    came; what is older is let go, so that memory depends on the streams and their traffic in a minute's seconds only.
    """

    def __init__(self) -> None:
        self._waiting: list[tuple[I64, I64, I64]] = []
        self._waiting_s: list[int] = []  # their latest seconds
        self._waiting_count = 0
        self._latest_s = np.iinfo(np.int64).min
        self._keys = np.empty((0, 3), np.int64)  # stream, second, bucket
        self._counts = np.empty((0, 3), np.int64)  # intervals, least, most

    def observe(self, stream: I64, time_ns: I64, interval_ns: I64) -> None:
        """Take intervals with the times of their ends. Shapes (n,)."""
        self._waiting.append((stream, time_ns, interval_ns))
        self._waiting_s.append(int(time_ns.max()) // _S_NS)
        self._waiting_count += len(stream)
        self._latest_s = max(self._latest_s, self._waiting_s[-1])
        if self._waiting_count >= _MAX_WAITING:
            # In a file that is read faster than it was recorded, whole batches are too old by then.
            since = self._latest_s - WINDOW_S
            self._waiting = [
                part for part, last_s in zip(self._waiting, self._waiting_s, strict=True) if last_s > since
            ]
            self._waiting_s = [last_s for last_s in self._waiting_s if last_s > since]
            self._waiting_count = sum(len(stream) for stream, _, _ in self._waiting)
            if self._waiting_count >= _MAX_WAITING:
                self._count()

    def histograms(self) -> dict[int, Histogram]:
        """Return the histogram of the last minute of each stream that ended an interval in it."""
        self._count()
        rows: dict[int, list[int]] = defaultdict(list)
        for row, stream in enumerate(self._keys[:, 0].tolist()):
            rows[stream].append(row)
        found = {}
        for stream, own in rows.items():
            bucket, place = np.unique(self._keys[own, 2], return_inverse=True)
            count = np.zeros(len(bucket), np.int64)
            np.add.at(count, place, self._counts[own, 0])
            extremes = int(self._counts[own, 1].min()), int(self._counts[own, 2].max())
            found[stream] = Histogram(bucket, count, *extremes)
        return found

    def _count(self) -> None:
        """Sort in what waits, and let go of what is older than the window."""
        if not self._waiting and not len(self._keys):
            return
        since = self._latest_s - WINDOW_S
        keys, counts = [self._keys], [self._counts]
        for stream, time_ns, interval_ns in self._waiting:
            second = time_ns // _S_NS
            inside = np.flatnonzero(second > since)
            if len(inside):
                interval = interval_ns[inside]
                keys.append(np.stack([stream[inside], second[inside], bucket_of(interval)], axis=1))
                counts.append(np.stack([np.ones_like(interval), interval, interval], axis=1))
        self._waiting, self._waiting_s, self._waiting_count = [], [], 0
        key, count = np.concatenate(keys), np.concatenate(counts)
        inside = np.flatnonzero(key[:, 1] > since)
        key, count = key[inside], count[inside]
        number = key[:, 0] << (_SECOND_BITS + _BUCKET_BITS)
        number |= (key[:, 1] - (since + 1)) << _BUCKET_BITS
        number |= key[:, 2] + _BUCKET_OFFSET
        order = np.argsort(number)
        number, count = number[order], count[order]
        start = np.flatnonzero(np.append(True, number[1:] != number[:-1]))[: len(number)]
        self._keys = key[order[start]]
        merge = (np.add, np.minimum, np.maximum)
        columns = [how.reduceat(count[:, at], start) for at, how in enumerate(merge)] if len(key) else [count[:, 0]] * 3
        self._counts = np.stack(columns, axis=1)
