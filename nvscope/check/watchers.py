"""What rules about time watch while captures are read: intervals of streams, and silences of lists."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from dissectors.batch import I64
from nvscope.engine.keys import Keys
from nvscope.engine.rows import DataRows
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.tracker.event_kinds import FRAMES_KEPT


@dataclass(slots=True)
class StreamIntervals:
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


class IntervalWatcher:
    """An observer of the intervals between the telegrams of each stream of some lists.

    ``wanted_ns`` returns what the interval of a list should be, ``tolerance`` is by how much of it one may differ.
    ``since_ns``: intervals that began before do not count.
    """

    by_stream: ClassVar[bool] = True

    def __init__(
        self, wanted_ns: Callable[[ListKey], int | None], tolerance: float, since_ns: int | None = None
    ) -> None:
        self._wanted_ns, self._tolerance, self._since_ns = wanted_ns, tolerance, since_ns
        self._streams: dict[tuple[bool, int], StreamIntervals | None] = {}

    @property
    def streams(self) -> list[StreamIntervals]:
        """Those of the lists that were asked for, in the order of lists and streams."""
        known = [one for one in self._streams.values() if one is not None]
        return sorted(known, key=lambda one: (one.key, one.node, one.subindex))

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not len(told):
            return
        laid = told.laid
        for rows, on_can in ((laid.data, False), (laid.pdos, True)):
            if len(rows):
                self._take(rows, on_can, laid.keys, told.first_frame)

    def _take(self, rows: DataRows, on_can: bool, keys: Keys, first_frame: int) -> None:
        before_ns = rows.times_before(np.arange(len(rows)))
        starts, stops = rows.start.tolist(), rows.stop.tolist()
        for run, (start, stop) in enumerate(zip(starts, stops, strict=True)):
            number = int(rows.run_stream[run])
            known = self._stream(number, on_can, keys)
            if known is None:
                continue
            chosen = np.ones(stop - start, np.bool_)
            chosen[0] = not rows.fresh[run]
            if rows.repeated is not None:
                chosen &= ~rows.repeated[start:stop]
            if self._since_ns is not None:
                chosen &= before_ns[start:stop] >= self._since_ns
            interval_ns = (rows.time_ns[start:stop] - before_ns[start:stop])[chosen]
            if len(interval_ns):
                at = np.arange(start, stop)[chosen]
                self._count(known, interval_ns, rows.time_ns[at], rows.packet[at] + first_frame)

    def _stream(self, number: int, on_can: bool, keys: Keys) -> StreamIntervals | None:
        place = on_can, number
        if place not in self._streams:
            lists, node, subindex = (int(column[0]) for column in keys.described(np.array([number])))
            key = keys.list_key(lists)
            wanted_ns = self._wanted_ns(key)
            self._streams[place] = None if not wanted_ns else StreamIntervals(key, node, subindex, wanted_ns)
        return self._streams[place]

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
            known.frames += frame[outside[: FRAMES_KEPT - len(known.frames)]].tolist()


@dataclass(slots=True)
class Silence:
    """The longest time without a telegram of a list: from when to when, and the frame that ended it, None for none."""

    last_ns: int
    longest_ns: int = 0
    begin_ns: int | None = None
    frame: int | None = None


class SilenceWatcher:
    """An observer of how long lists are not sent, from ``since_ns`` on; None for the first frame."""

    by_stream: ClassVar[bool] = True

    def __init__(self, since_ns: int | None = None) -> None:
        self._since_ns = since_ns
        self._lists: dict[ListKey, Silence] = {}
        self._numbers: dict[int, ListKey] = {}

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not len(told):
            return
        self._since_ns = told.start_ns if self._since_ns is None else self._since_ns
        for rows in (told.laid.data, told.laid.pdos):
            if len(rows):
                self._take(rows, told.laid.keys, told.first_frame)

    def _take(self, rows: DataRows, keys: Keys, first_frame: int) -> None:
        assert self._since_ns is not None
        lists, _, _ = keys.described(rows.stream)
        order = np.lexsort((rows.packet, lists))
        lists, time_ns, frame = lists[order], rows.time_ns[order], rows.packet[order] + first_frame
        begins = np.flatnonzero(np.diff(lists, prepend=-1))
        for begin, end in zip(begins.tolist(), [*begins[1:].tolist(), len(lists)], strict=True):
            number = int(lists[begin])
            key = self._numbers.setdefault(number, keys.list_key(number))
            known = self._lists.setdefault(key, Silence(self._since_ns))
            behind = np.maximum.accumulate(np.maximum(time_ns[begin:end], known.last_ns))
            before = np.append(known.last_ns, behind[:-1])
            gap_ns = behind - before
            place = int(gap_ns.argmax())
            if int(gap_ns[place]) > known.longest_ns:
                known.longest_ns, known.begin_ns = int(gap_ns[place]), int(before[place])
                known.frame = int(frame[begin + place])
            known.last_ns = int(behind[-1])

    def of(self, lists: Collection[ListKey], until_ns: int) -> Mapping[ListKey, Silence]:
        """Return the longest silence of each of some lists that were ever sent, up to a time."""
        found = {}
        for key in sorted(lists):
            known = self._lists.get(key)
            if known is None:
                continue
            left_ns = until_ns - known.last_ns
            found[key] = known if left_ns <= known.longest_ns else Silence(known.last_ns, left_ns, known.last_ns)
        return found
