"""What rules about time watch while captures are read: the intervals of streams."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64
from nvscope.check.asked_rows import EVERY_LIST, AskedRows, OfLists
from nvscope.check.while_so import So, WhileSo
from nvscope.engine.keys import Keys
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.tracker.buckets import bucket_of
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.tracker.histograms import Histogram
from nvscope.tracker.state import TrackerState
from nvscope.tracker.timing import BatchIntervals


class StreamIntervals(Struct):
    """The intervals of a stream: how many, how many lie outside, which is farthest from what it should be, and when."""

    key: ListKey
    node: int
    subindex: int
    wanted_ns: int
    count: int = 0
    outside: int = 0
    worst_ns: int | None = None
    first_ns: int | None = None
    frames: list[int] = field(default_factory=list)
    times_ns: list[int] = field(default_factory=list)


class IntervalWatcher:
    """An observer of the intervals of each stream of some lists, as ``state`` measures them: it observes behind that.

    ``wanted_ns`` returns what the interval of a list should be, ``tolerance`` is by how much of it one may differ.
    ``since_ns``: intervals that began before do not count, nor those during which something that ``holds`` did not.
    """

    by_stream: ClassVar[bool] = True

    def __init__(
        self, wanted_ns: Callable[[ListKey], int | None], tolerance: float, since_ns: int | None = None, *,
        rows: AskedRows | None = None, lists: OfLists = EVERY_LIST, holds: WhileSo | None = None,
    ) -> None:  # fmt: skip
        self.holds = holds
        self.state: TrackerState | None = None
        """The state that measures; it has to be there before anything is observed."""
        self._wanted_ns, self._tolerance, self._since_ns = wanted_ns, tolerance, since_ns
        self._lists, self._rows = lists, AskedRows({}) if rows is None else rows
        self._streams: dict[int, StreamIntervals | None] = {}

    @property
    def streams(self) -> list[StreamIntervals]:
        """Those of the lists that were asked for, in the order of lists and streams."""
        known = [one for one in self._streams.values() if one is not None]
        return sorted(known, key=lambda one: (one.key, one.node, one.subindex))

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        so = None if self.holds is None else self.holds.see(told)
        if self.state is None or not len(told):
            return
        mask = self._rows.mask(self._lists, told.keys)
        for one in self.state.senders.intervals:
            own = np.flatnonzero(mask[told.keys.described(one.run)[0]])
            if not len(own):
                continue
            stop = np.cumsum(one.length)
            for run, number in zip(own.tolist(), one.run[own].tolist(), strict=True):
                known = self._stream(number, told.keys)
                if known is not None:
                    self._take(known, one, int(stop[run] - one.length[run]), int(stop[run]), told.first_frame, so)

    def _take(
        self, known: StreamIntervals, found: BatchIntervals, start: int, stop: int, first_frame: int, so: So | None
    ) -> None:  # fmt: skip
        place = np.arange(start, stop)
        packet = found.packets(place)
        time_ns, interval_ns = found.time_ns[start:stop], found.interval_ns[start:stop]
        if self._since_ns is not None or so is not None:
            began_ns = time_ns - interval_ns
            chosen = np.ones(len(place), np.bool_) if self._since_ns is None else began_ns >= self._since_ns
            if so is not None:
                chosen &= so.true[packet] & (began_ns >= so.since_ns[packet])
            time_ns, interval_ns, packet = time_ns[chosen], interval_ns[chosen], packet[chosen]
        if len(interval_ns):
            self._count(known, interval_ns, time_ns, packet + first_frame)

    def _stream(self, number: int, keys: Keys) -> StreamIntervals | None:
        if number not in self._streams:
            lists, node, subindex = (int(column[0]) for column in keys.described(np.array([number])))
            key = keys.list_key(lists)
            wanted_ns = self._wanted_ns(key)
            self._streams[number] = None if not wanted_ns else StreamIntervals(key, node, subindex, wanted_ns)
        return self._streams[number]

    def _count(self, known: StreamIntervals, interval_ns: I64, time_ns: I64, frame: I64) -> None:
        distance = np.abs(interval_ns - known.wanted_ns)
        outside = np.flatnonzero(distance > known.wanted_ns * self._tolerance)
        known.count += len(interval_ns)
        known.outside += len(outside)
        worst_ns = int(interval_ns[int(distance.argmax())])
        if known.worst_ns is None or abs(worst_ns - known.wanted_ns) > abs(known.worst_ns - known.wanted_ns):
            known.worst_ns = worst_ns
        if len(outside):
            known.first_ns = int(time_ns[outside[0]]) if known.first_ns is None else known.first_ns
            first = outside[: FRAMES_KEPT - len(known.frames)]
            known.frames += frame[first].tolist()
            known.times_ns += time_ns[first].tolist()


class StreamSpread(Struct):
    """The intervals of a stream by bucket, the extremes, and the frames that ended the first that were too short."""

    key: ListKey
    node: int
    subindex: int
    counts: dict[int, int] = field(default_factory=dict)
    least_ns: int | None = None
    most_ns: int = 0
    short: int = 0
    first_ns: int | None = None
    frames: list[int] = field(default_factory=list)

    @property
    def histogram(self) -> Histogram:
        """All of them."""
        bucket = np.array(sorted(self.counts), np.int64)
        count = np.array([self.counts[one] for one in bucket.tolist()], np.int64)
        return Histogram(bucket, count, self.least_ns or 0, self.most_ns)


class SpreadWatcher(IntervalWatcher):
    """An observer of how the intervals of each stream of some lists differ, and which are shorter than ``least_ns``."""

    def __init__(
        self, least_ns: int, since_ns: int | None = None, *, rows: AskedRows | None = None,
        lists: OfLists = EVERY_LIST, holds: WhileSo | None = None,
    ) -> None:  # fmt: skip
        super().__init__(lambda key: 1, 0.0, since_ns, rows=rows, lists=lists, holds=holds)
        self._least_ns = least_ns
        self._spreads: dict[tuple[ListKey, int, int], StreamSpread] = {}

    @property
    def spreads(self) -> list[StreamSpread]:
        """Those of the lists that were asked for, in the order of lists and streams."""
        return [self._spreads[place] for place in sorted(self._spreads)]

    def _count(self, known: StreamIntervals, interval_ns: I64, time_ns: I64, frame: I64) -> None:
        place = known.key, known.node, known.subindex
        spread = self._spreads.setdefault(place, StreamSpread(*place))
        bucket, count = np.unique(bucket_of(interval_ns), return_counts=True)
        for one, many in zip(bucket.tolist(), count.tolist(), strict=True):
            spread.counts[one] = spread.counts.get(one, 0) + many
        least_ns = int(interval_ns.min())
        spread.least_ns = least_ns if spread.least_ns is None else min(spread.least_ns, least_ns)
        spread.most_ns = max(spread.most_ns, int(interval_ns.max()))
        short = np.flatnonzero(interval_ns < self._least_ns)
        spread.short += len(short)
        if len(short):
            spread.first_ns = int(time_ns[short[0]]) if spread.first_ns is None else spread.first_ns
            spread.frames += frame[short[: FRAMES_KEPT - len(spread.frames)]].tolist()
