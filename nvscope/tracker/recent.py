"""The intervals of the last minute, beside those of the whole run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.buckets import bucket_of
from nvscope.tracker.histograms import StreamPercentiles, percentiles_of_streams

WINDOW_S = 60
_S_NS = 1_000_000_000
_MAX_WAITING = 1 << 20

# Stream, second of the window and bucket are sorted as one number.
_BUCKET_BITS, _SECOND_BITS = 21, 6
_BUCKET_OFFSET = 1 << (_BUCKET_BITS - 1)


class _Counted(NamedTuple):
    """Intervals counted by stream, second and bucket, rising, with their extremes. Columns of shape (n,)."""

    stream: I64
    second: I64
    bucket: I64
    intervals: I64
    least_ns: I64
    most_ns: I64

    def since(self, second: int) -> _Counted:
        """Return those that ended after a second."""
        inside = self.second > second
        return self if inside.all() else _Counted(*(column[inside] for column in self))


_NOTHING = np.empty(0, np.int64)
_NONE = _Counted(_NOTHING, _NOTHING, _NOTHING, _NOTHING, _NOTHING, _NOTHING)


class Recent:
    """The intervals of the last minute of the capture: of the second of the latest time and the 59 before it.

    What came is kept as columns. Where that is too much, it is counted by stream, second and bucket, and what is older
    is let go, so that memory depends on the streams and their traffic in a minute's seconds only.
    """

    def __init__(self) -> None:
        self._waiting: list[tuple[I64, I64, I64]] = []
        self._waiting_s: list[int] = []  # their latest seconds
        self._waiting_count = 0
        self._latest_s = np.iinfo(np.int64).min
        self._counted = _NONE

    def observe(self, stream: I64, time_ns: I64, interval_ns: I64) -> None:
        """Take intervals with the times of their ends. Shapes (n,)."""
        self._waiting.append((stream, time_ns, interval_ns))
        self._waiting_s.append(int(time_ns.max()) // _S_NS)
        self._waiting_count += len(stream)
        self._latest_s = max(self._latest_s, self._waiting_s[-1])
        if self._waiting_count >= _MAX_WAITING:
            # In a file that is read faster than it was recorded, whole batches are too old by then.
            since = self._latest_s - WINDOW_S
            kept = [place for place, last_s in enumerate(self._waiting_s) if last_s > since]
            self._waiting = [self._waiting[place] for place in kept]
            self._waiting_s = [self._waiting_s[place] for place in kept]
            self._waiting_count = sum(len(stream) for stream, _, _ in self._waiting)
            if self._waiting_count >= _MAX_WAITING:
                self._counted = self._count()
                self._waiting, self._waiting_s, self._waiting_count = [], [], 0

    def take(self, part: Recent) -> None:
        """Take over what a part has kept of other streams."""
        self._waiting += part._waiting
        self._waiting_s += part._waiting_s
        self._waiting_count += part._waiting_count
        self._latest_s = max(self._latest_s, part._latest_s)
        self._counted = _Counted(*map(np.concatenate, zip(self._counted, part._counted, strict=True)))

    def percentiles(self, percents: tuple[int, ...]) -> StreamPercentiles:
        """Return what the last minute tells of each stream that ended an interval in it."""
        counted = self._count()
        order = np.lexsort((counted.bucket, counted.stream))
        return percentiles_of_streams(
            percents, counted.stream[order], counted.bucket[order], counted.intervals[order], counted.least_ns[order],
            counted.most_ns[order],
        )  # fmt: skip

    def _count(self) -> _Counted:
        """Return all that is within the window, counted."""
        since = self._latest_s - WINDOW_S
        parts = [self._counted.since(since)]
        for stream, time_ns, interval_ns in self._waiting:
            second = time_ns // _S_NS
            inside = np.flatnonzero(second > since)
            if len(inside):
                interval = interval_ns[inside]
                parts.append(
                    _Counted(
                        stream[inside], second[inside], bucket_of(interval), np.ones_like(interval), interval, interval
                    )
                )
        if len(parts) == 1:
            return parts[0]
        whole = _Counted(*map(np.concatenate, zip(*parts, strict=True)))
        number = whole.stream << (_SECOND_BITS + _BUCKET_BITS)
        number |= (whole.second - (since + 1)) << _BUCKET_BITS
        number |= whole.bucket + _BUCKET_OFFSET
        order = np.argsort(number)
        number = number[order]
        start = np.flatnonzero(np.append(True, number[1:] != number[:-1]))
        first = order[start]
        return _Counted(
            whole.stream[first], whole.second[first], whole.bucket[first],
            np.add.reduceat(whole.intervals[order], start),
            np.minimum.reduceat(whole.least_ns[order], start), np.maximum.reduceat(whole.most_ns[order], start),
        )  # fmt: skip
