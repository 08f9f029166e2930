"""What rules about whole cycles watch: how many of the cycles that are judged lack a part, and how far these are apart.

It counts what the state has told apart already, and only that which began while it was to be judged.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dissectors.batch import I64
from nvscope.check.asked_rows import EVERY_LIST, OfLists
from nvscope.check.check import Setting
from nvscope.check.early_cycles import EarlyCycles
from nvscope.check.judged_cycles import JudgedCycles
from nvscope.check.while_so import WhileSo, while_so
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.tracker.cycles import Cycles
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.tracker.state import TrackerState
from nvscope.tracker.whole_cycles import Over, PairCounts, StreamCounts, count_cycles, end_counting

_SIZE_BITS = 20
_MOST_SIZE = (1 << _SIZE_BITS) - 1


class _Widest(KeyedColumns):
    """One row a pair of sender and list: its longest skew, and the frame and time with which that cycle began."""

    skew_ns: I64
    frame: I64
    begin_ns: I64
    COLUMNS: ClassVar = {"skew_ns": (np.int64(-1), 1), "frame": (np.int64(0), 1), "begin_ns": (np.int64(0), 1)}


class CycleWatcher:
    """An observer of the cycles that ``state`` tells apart; it observes behind it."""

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting) -> None:
        self.holds: WhileSo | None = while_so(setting)
        self._since_ns = setting.since_ns
        self._early = EarlyCycles(setting.rows, setting.since_ns)
        self._telegrams, self._frames = _Telegrams(), _CanFrames()
        self._told: Told | None = None
        self.state: TrackerState | None = None
        """The state that counts all others; it has to be there before anything is asked."""

    def want(self, lists: OfLists) -> None:
        """Look at the first cycles of some lists, beside those wanted so far; at all others of every list anyway."""
        self._early.want(lists)

    def observe(self, told: Told) -> None:
        """Take a batch that the state has taken; several rules may hand over the same one."""
        if self._told is told:
            return
        self._told = told
        assert self.state is not None
        if self.holds is not None:
            self.holds.see(told)
        self._early.observe(told)
        senders = self.state.senders
        if len(told):
            self._telegrams.take(told, senders.cycles, self._judged(senders.cycles.over))
            self._frames.take(senders.can_cycles, self._judged(senders.can_cycles.over))
        for unheard in told.unheard:
            self._telegrams.resume(unheard, senders.cycles)

    def _judged(self, over: Over | None) -> Over | None:
        """Return the cycles that began while the rule is judged."""
        if over is None:
            return None
        chosen = np.ones(len(over.pair), np.bool_)
        if self._since_ns is not None:
            chosen &= over.begin_ns >= self._since_ns
        if self.holds is not None:
            chosen &= self.holds.spans.at_frames(over.begin_frame)
        return over if chosen.all() else Over(*(column[chosen] for column in over))

    def of(self, streams: Sequence[int], *, early: bool) -> JudgedCycles | None:
        """Return what there was of the streams of one sender and list; None where nobody looked at such cycles.

        With ``early``, those before their intervals are known, too.
        """
        assert self.state is not None
        cycles = self.state.senders.cycles
        found = self._telegrams.of(streams, cycles)
        if early:
            first = self._early.counted(streams, cycles, self.holds)
            found = first if found is None else found.and_of(first)
        return found

    def on_can(self, streams: Sequence[int], parts: int) -> JudgedCycles | None:
        """Return what there was of a list on CAN that has so many parts; None where nobody looked at its cycles."""
        assert self.state is not None
        return self._frames.of(streams, parts, self.state.senders.can_cycles)


class _Telegrams:
    """Cycles of telegrams: those that end while all streams of their sender and list are sent."""

    def __init__(self) -> None:
        self._pairs, self._streams, self._widest = PairCounts(), StreamCounts(), _Widest()
        self._torn: dict[tuple[int, int], list[tuple[int, int, int]]] = defaultdict(list)
        """By pair and how many streams that had, of the first torn cycles the first frame, its time, the last frame."""

    def take(self, told: Told, cycles: Cycles, over: Over | None) -> None:
        rows = told.laid.data
        if not len(rows):
            return
        self._pairs.resize(len(cycles.pairs))
        self._streams.resize(len(cycles.streams))
        frame = rows.packet[rows.stop - 1] + told.first_frame
        count_cycles(self._pairs, self._streams, cycles.streams.column("pair"), over, rows.run_stream, frame)
        if over is None or not len(over.pair):
            return
        _widen(self._widest, over, len(cycles.pairs))
        torn = np.flatnonzero(over.size < over.known)
        torn = torn[np.argsort(over.begin_frame[torn], kind="stable")]
        columns = over.pair, over.known, over.begin_frame, over.begin_ns, over.end_frame
        for pair, known, *cycle in zip(*(one[torn].tolist() for one in columns), strict=True):
            if len(kept := self._torn[pair, known]) < FRAMES_KEPT:
                kept.append(tuple(cycle))

    def resume(self, unheard: Unheard, cycles: Cycles) -> None:
        """Leave of what is unheard what was counted up to there."""
        pair_of = cycles.streams.column("pair")
        pair = np.unique(pair_of[unheard.streams[unheard.streams < len(pair_of)]])
        stream = np.flatnonzero(np.isin(pair_of, pair[pair >= 0]))
        if len(stream):
            self._pairs.resize(len(cycles.pairs))
            self._streams.resize(len(cycles.streams))
            end_counting(self._pairs, self._streams, stream, pair_of[stream])

    def of(self, streams: Sequence[int], cycles: Cycles) -> JudgedCycles | None:
        pair_of = cycles.streams.column("pair")
        pair = int(pair_of[streams[0]]) if streams[0] < len(pair_of) else -1
        if not 0 <= pair < len(self._pairs) or self._pairs.known[pair] < len(streams):
            return None
        first = min(streams, key=lambda stream: int(self._streams.last_frame[stream]))
        last_frame = int(self._streams.last_frame[first])
        torn = self._torn.get((pair, len(streams)), ())
        frames = [(frame, begin_ns) for frame, begin_ns, end in torn if end <= last_frame]
        counted = int(self._streams.cycles[first]), int(self._streams.torn[first])
        return JudgedCycles(*counted, frames, *_widest_of(self._widest, pair))


class _CanFrames:
    """Cycles of frames, of which a definition says how many there are in one."""

    def __init__(self) -> None:
        self._sizes: Counter[tuple[int, int]] = Counter()
        self._first: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
        self._widest = _Widest()

    def take(self, cycles: Cycles, over: Over | None) -> None:
        if over is None or not len(over.pair):
            return
        _widen(self._widest, over, len(cycles.pairs))
        order = np.argsort(over.begin_frame, kind="stable")
        place = over.pair[order] << _SIZE_BITS | np.minimum(over.size[order], _MOST_SIZE)
        places, where = np.unique(place, return_inverse=True)
        for own, (at, number) in enumerate(zip(places.tolist(), np.bincount(where).tolist(), strict=True)):
            key = at >> _SIZE_BITS, at & _MOST_SIZE
            self._sizes[key] += number
            if room := FRAMES_KEPT - len(self._first[key]):
                row = order[np.flatnonzero(where == own)[:room]]
                self._first[key] += zip(over.begin_frame[row].tolist(), over.begin_ns[row].tolist(), strict=True)

    def of(self, streams: Sequence[int], parts: int, cycles: Cycles) -> JudgedCycles | None:
        pair_of = cycles.streams.column("pair")
        pair = int(pair_of[streams[0]]) if streams[0] < len(pair_of) else -1
        own = {size: number for (of, size), number in self._sizes.items() if of == pair}
        if pair < 0 or not own:
            return None
        torn = [size for size in own if size < parts]
        frames = sorted(one for size in torn for one in self._first[pair, size])[:FRAMES_KEPT]
        cycle = JudgedCycles(sum(own.values()), sum(own[size] for size in torn), frames)
        cycle.skew_ns, cycle.widest = _widest_of(self._widest, pair)
        return cycle


def _widen(widest: _Widest, over: Over, pairs: int) -> None:
    """Take the longest skew of each pair, the first where several are as long."""
    widest.resize(pairs)
    wider = np.flatnonzero(over.skew_ns > widest.skew_ns[over.pair])
    order = wider[np.lexsort((-over.begin_frame[wider], over.skew_ns[wider], over.pair[wider]))]
    row = order[np.flatnonzero(np.diff(over.pair[order], append=-1))]
    pair = over.pair[row]
    widest.skew_ns[pair], widest.frame[pair] = over.skew_ns[row], over.begin_frame[row]
    widest.begin_ns[pair] = over.begin_ns[row]


def _widest_of(widest: _Widest, pair: int) -> tuple[int, tuple[int, int] | None]:
    if pair >= len(widest) or widest.skew_ns[pair] < 0:
        return 0, None
    return int(widest.skew_ns[pair]), (int(widest.frame[pair]), int(widest.begin_ns[pair]))


def watch_cycles(setting: Setting) -> CycleWatcher:
    """Return what watches cycles, one for all rules that are judged at the same times."""
    watcher = setting.shared(("cycles", setting.when), lambda: CycleWatcher(setting))
    watcher.want(OfLists(patterns=setting.lists) if setting.lists else EVERY_LIST)
    return watcher
