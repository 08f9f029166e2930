"""What rules about time watch while captures are read: intervals of streams, and silences of lists."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.can.pdo import PdoRules
from nvscope.check.asked_rows import EVERY_LIST, AskedRows, OfLists, Runs
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import Keys
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
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
    ``since_ns``: intervals that began before do not count. ``rows`` are the telegrams of batches by stream.
    """

    by_stream: ClassVar[bool] = True

    def __init__(
        self, wanted_ns: Callable[[ListKey], int | None], tolerance: float, since_ns: int | None = None, *,
        rows: AskedRows | None = None, lists: OfLists = EVERY_LIST,
    ) -> None:  # fmt: skip
        self._wanted_ns, self._tolerance, self._since_ns = wanted_ns, tolerance, since_ns
        self._rows, self._lists = AskedRows({}) if rows is None else rows, lists
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
        for runs, places in self._rows.runs(told, self._lists):
            for run in places:
                self._take(runs, run, told)

    def _take(self, runs: Runs, run: int, told: Told) -> None:
        rows = runs.rows
        known = self._stream(int(rows.run_stream[run]), runs.on_can, told.keys)
        if known is None:
            return
        start, stop = int(rows.start[run]), int(rows.stop[run])
        before_ns, time_ns = runs.before_ns(run), rows.time_ns[start:stop]
        chosen = np.ones(stop - start, np.bool_)
        chosen[0] = not rows.fresh[run]
        if rows.repeated is not None:
            chosen &= ~rows.repeated[start:stop]
        if self._since_ns is not None:
            chosen &= before_ns >= self._since_ns
        if chosen.any():
            at = np.flatnonzero(chosen)
            packet = rows.packet[start + at]
            self._count(known, time_ns[at] - before_ns[at], time_ns[at], packet + told.first_frame)

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
    """The longest time without a telegram of a list: how long, since when, and the frame that ended it, None for none.

    ``is_first``: it was before its first telegram.
    """

    longest_ns: int
    begin_ns: int
    frame: int | None
    is_first: bool


class SilenceWatcher:
    """An observer of how long lists are not sent, from ``since_ns`` on; None for the first frame.

    A silence ends where nobody listens any more; the next one begins when somebody does again.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, since_ns: int | None = None, *, rows: AskedRows | None = None) -> None:
        self._since_ns = since_ns
        self._rows = AskedRows({}) if rows is None else rows
        self._keys: list[ListKey] = []
        self._lists = _SilentColumns()
        self._is_heard = True
        self._before = 0, 0
        """The longest time up to an end of all listening, and since when it was: so long a list was silent at least."""

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if len(told):
            self._look_at(told)
        for unheard in told.unheard:
            self._leave(unheard, told.keys, told.pdos)

    def _leave(self, unheard: Unheard, keys: Keys, pdos: PdoRules) -> None:
        """End the silences of what nobody listens to any more."""
        known = self._lists
        if unheard.everything:
            own = np.arange(len(known))
        else:
            channels = {pdos.channel(number) for number in unheard.channels.tolist()}
            of_channels = [number for number, key in enumerate(self._keys) if key.port in channels]
            of_streams = keys.described(unheard.streams)[0] if len(unheard.streams) else np.zeros(0, np.int64)
            own = np.unique(np.append(of_streams[of_streams < len(known)], of_channels).astype(np.int64))
        if self._since_ns is None or unheard.until_ns < self._since_ns:
            return
        own = own[~known.paused[own]]
        since_ns = np.where(known.came[own], known.last_ns[own], self._since_ns)
        longer = unheard.until_ns - since_ns > known.longest_ns[own]
        row = own[longer]
        known.longest_ns[row], known.begin_ns[row] = unheard.until_ns - since_ns[longer], since_ns[longer]
        known.frame[row], known.first[row] = 0, ~known.came[row]
        known.paused[own] = True
        if unheard.everything:
            self._is_heard = False
            self._before = max(self._before, (unheard.until_ns - self._since_ns, self._since_ns))

    def _look_at(self, told: Told) -> None:
        self._since_ns = told.start_ns if self._since_ns is None else self._since_ns
        if not self._is_heard:
            self._is_heard, self._since_ns = True, max(self._since_ns, int(told.batch.packets.ts_ns.min()))
            known = self._lists
            known.last_ns[known.paused], known.paused[:] = self._since_ns, False
        keys = told.keys
        before = len(self._lists)
        self._lists.resize(len(keys.lists))
        longest_ns, begin_ns = self._before
        self._lists.longest_ns[before:], self._lists.begin_ns[before:] = longest_ns, begin_ns
        self._keys += [keys.list_key(number) for number in range(len(self._keys), len(keys.lists))]
        for runs, _ in self._rows.runs(told, EVERY_LIST):
            self._take(runs, self._rows.latest_ns(told), told.first_frame)

    def _take(self, runs: Runs, latest_ns: I64, first_frame: int) -> None:
        assert self._since_ns is not None
        known, rows = self._lists, runs.rows
        lists = np.repeat(runs.lists, rows.stop - rows.start)
        order = np.lexsort((rows.packet, lists))
        lists, packet = lists[order], rows.packet[order]
        behind_ns = np.maximum(latest_ns[packet], self._since_ns)
        begin = np.flatnonzero(np.diff(lists, prepend=-1))
        own = lists[begin]
        before_ns = np.append(self._since_ns, behind_ns[:-1])
        before_ns[begin] = np.where(known.came[own], known.last_ns[own], self._since_ns)
        before_ns[begin] = np.where(known.paused[own], behind_ns[begin], before_ns[begin])
        known.paused[own] = False
        gap_ns = behind_ns - before_ns
        longest_ns = np.maximum.reduceat(gap_ns, begin)
        # Of each list the first gap that is as long as its longest one here.
        group = np.repeat(np.arange(len(begin)), np.diff(np.append(begin, len(lists))))
        row = np.flatnonzero(gap_ns == longest_ns[group])
        row = row[np.unique(group[row], return_index=True)[1]]
        longer = longest_ns > known.longest_ns[own]
        known.longest_ns[own[longer]] = longest_ns[longer]
        known.begin_ns[own[longer]] = before_ns[row[longer]]
        known.frame[own[longer]] = packet[row[longer]] + first_frame
        known.first[own[longer]] = ~known.came[own[longer]] & (row[longer] == begin[longer])
        known.last_ns[own] = behind_ns[np.append(begin[1:], len(lists)) - 1]
        known.came[own] = True

    def of(self, lists: Collection[ListKey], until_ns: int) -> Mapping[ListKey, Silence]:
        """Return the longest silence of each of some lists that were ever sent, up to a time."""
        numbers = {key: number for number, key in enumerate(self._keys)}
        found, known = {}, self._lists
        for key in sorted(lists):
            number = numbers.get(key)
            if number is None or not known.came[number]:
                continue
            last_ns, longest_ns = int(known.last_ns[number]), int(known.longest_ns[number])
            if until_ns - last_ns > longest_ns and not known.paused[number]:
                found[key] = Silence(until_ns - last_ns, last_ns, None, is_first=False)
                continue
            frame = int(known.frame[number]) or None
            found[key] = Silence(longest_ns, int(known.begin_ns[number]), frame, is_first=bool(known.first[number]))
        return found


class _SilentColumns(KeyedColumns):
    """One row a list: whether it came, when last, whether nobody listens to it.

    Of its longest silence: how long it was, when it began, the frame that ended it, 0 for none, and whether it was
    before its first telegram.
    """

    came: Bool
    paused: Bool
    first: Bool
    last_ns: I64
    longest_ns: I64
    begin_ns: I64
    frame: I64
    COLUMNS: ClassVar = {
        "came": (np.False_, 1),
        "paused": (np.False_, 1),
        "first": (np.True_, 1),
        "last_ns": (np.int64(0), 1),
        "longest_ns": (np.int64(0), 1),
        "begin_ns": (np.int64(0), 1),
        "frame": (np.int64(0), 1),
    }
