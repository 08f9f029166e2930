"""Samples: some telegrams of each stream, few enough to be kept and looked at as a table.

Of each shape of a stream the first telegrams are kept, and of those behind them every n-th, where n doubles as the
stream grows. Which ones that are, their numbers within the stream decide, not how the capture is cut into batches.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, U8
from dissectors.netvar import ACKNOWLEDGE_WANTED, CHECKSUM_PRESENT
from nvscope.engine.told import Told
from nvscope.list_key import Transport
from nvscope.tracker.intervals import CYCLIC_SPREAD_PERCENT
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream, Telegrams, joined

MOST_ROWS = 512
"""Telegrams kept of the first ones, and again of those behind them."""

LEAST_INTERVALS = 4
MOST_SAMPLES = 512
MOST_SHAPES = 8
_SAMPLE_BYTES = 1 << 19


class Sample(Struct):
    """Telegrams of one stream and shape. ``telegrams`` counts all, ``every`` is n of what follows the first ones."""

    stream: Stream
    items: int
    size_bytes: int
    destination: str
    telegrams: int = 0
    every: int = 1
    acknowledge: bool = False
    checksum: bool = False
    _first: list[tuple[U8, I64]] = field(default_factory=list)
    _later: list[tuple[I64, U8]] = field(default_factory=list)

    @property
    def most_rows(self) -> int:
        """How many are kept of the first telegrams, and of the others."""
        return max(16, min(MOST_ROWS, _SAMPLE_BYTES // max(self.size_bytes, 1)))

    @property
    def first(self) -> U8:
        """The first telegrams, which follow each other, as (n, bytes)."""
        return np.concatenate([data for data, _ in self._first])

    @property
    def first_ns(self) -> I64:
        return np.concatenate([time_ns for _, time_ns in self._first])

    @property
    def data(self) -> U8:
        """All telegrams kept, as (n, bytes)."""
        return np.concatenate([self.first, *(data for _, data in self._later)])

    @property
    def nominal_ns(self) -> int | None:
        """The median interval of the first telegrams, None where they are not sent in a cycle."""
        intervals = np.sort(np.diff(self.first_ns))
        if len(intervals) < LEAST_INTERVALS:
            return None
        low, middle, high = (int(intervals[len(intervals) * percent // 100]) for percent in (5, 50, 95))
        return middle if middle > 0 and 100 * (high - low) <= CYCLIC_SPREAD_PERCENT * middle else None

    def add(self, telegrams: Telegrams) -> None:
        """Take the telegrams that follow, of this stream and shape."""
        count, begin = len(telegrams.frame), self.telegrams
        self.telegrams += count
        self.acknowledge |= bool(telegrams.flags & ACKNOWLEDGE_WANTED.mask)
        self.checksum |= bool(telegrams.flags & CHECKSUM_PRESENT.mask)
        room = max(0, self.most_rows - begin)
        if room:
            self._first.append((telegrams.data[:room].copy(), telegrams.time_ns[:room].copy()))
        number = np.arange(begin + min(room, count), begin + count)
        kept = number % self.every == 0
        if kept.any():
            self._later.append((number[kept], telegrams.data[number[kept] - begin].copy()))
        while sum(len(numbers) for numbers, _ in self._later) > self.most_rows:
            self.every *= 2
            numbers = np.concatenate([part for part, _ in self._later])
            data = np.concatenate([part for _, part in self._later])
            kept = numbers % self.every == 0
            self._later = [(numbers[kept], data[kept])]


class Samples:
    """The samples of all streams, by stream number and shape; however batches are cut, they are the same.

    ``left_out`` counts the telegrams of streams and shapes for which there was no room.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self) -> None:
        self.read = DataTelegrams()
        self.found: dict[tuple[int, int, int], Sample] = {}
        self.left_out = 0
        self._shapes: dict[int, int] = {}

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        for telegrams in joined(self.read.of(told)):
            self._add(telegrams)

    def _add(self, telegrams: Telegrams) -> None:
        stream, size = telegrams.stream, telegrams.data.shape[1]
        if stream.list.transport is Transport.CAN:
            return  # without Items, nothing tells how many variables a frame has
        key = stream.number, telegrams.items, size
        sample = self.found.get(key)
        if sample is None:
            shapes = self._shapes.get(stream.number, 0)
            if len(self.found) >= MOST_SAMPLES or shapes >= MOST_SHAPES:
                self.left_out += len(telegrams.frame)
                return
            self._shapes[stream.number] = shapes + 1
            sample = self.found[key] = Sample(stream, telegrams.items, size, telegrams.destination)
        sample.add(telegrams)

    def usual(self) -> list[tuple[Sample, int]]:
        """Return the sample of each stream's commonest shape, by list, sender and SubIndex, and how many others it has.

        Of equally common shapes it is the one that came first.
        """
        best: dict[int, Sample] = {}
        for sample in self.found.values():
            known = best.get(sample.stream.number)
            if known is None or sample.telegrams > known.telegrams:
                best[sample.stream.number] = sample
        rows = sorted(
            best.values(),
            key=lambda entry: (entry.stream.list, entry.stream.order, entry.stream.subindex),
        )
        return [(sample, self._shapes[sample.stream.number] - 1) for sample in rows]
