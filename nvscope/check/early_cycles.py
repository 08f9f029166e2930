"""The first cycles of lists that take several telegrams, before their intervals are known.

A report counts cycles once it knows how far their telegrams may be apart. Where the Counter says which telegrams belong
together, a rule can look at those before, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from msgspec import Struct

from nvscope.check.asked_rows import AskedRows, OfLists
from nvscope.check.judged_cycles import JudgedCycles
from nvscope.check.while_so import WhileSo
from nvscope.engine.told import Told
from nvscope.tracker.cycles import Cycles
from nvscope.tracker.event_kinds import FRAMES_KEPT

_MOST_TELEGRAMS = 64
_OPEN = 4
"""A telegram that was overtaken still belongs to one of so many cycles."""


class _Cycle(Struct):
    """One cycle: which streams are in it, its first frame, and its first and last time."""

    streams: set[int]
    frame: int
    begin_ns: int
    end_ns: int


class EarlyCycles:
    """An observer that keeps the first telegrams of each stream of some lists."""

    by_stream: ClassVar[bool] = True

    def __init__(self, rows: AskedRows, since_ns: int | None) -> None:
        self._rows, self._lists, self._since_ns = rows, OfLists(), since_ns
        self._telegrams: dict[int, list[tuple[int, int, int]]] = {}

    def want(self, lists: OfLists) -> None:
        """Keep those of some lists, beside those wanted so far."""
        self._lists = self._lists.and_of(lists)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not len(told):
            return
        for runs, places in self._rows.runs(told, self._lists):
            rows = runs.rows
            if runs.on_can:
                continue
            for run in places:
                known = self._telegrams.setdefault(int(rows.run_stream[run]), [])
                room = _MOST_TELEGRAMS - len(known)
                if room > 0:
                    part = slice(int(rows.start[run]), min(int(rows.stop[run]), int(rows.start[run]) + room))
                    packet = rows.packet[part]
                    columns = packet + told.first_frame, rows.time_ns[part], told.counter[packet]
                    known += zip(*(one.tolist() for one in columns), strict=True)

    def counted(self, streams: Sequence[int], cycles: Cycles, holds: WhileSo | None = None) -> JudgedCycles:
        """Return what there was of the streams of one list and node before the state counts, while it ``holds``."""
        found, seen, torn = JudgedCycles(), 0, 0
        frames: list[tuple[int, int]] = []
        if not all(self._telegrams.get(one) for one in streams):
            return found
        first_frame = max(self._telegrams[one][0][0] for one in streams)
        counts_from = _counts_from(streams[0], cycles)
        # Of the last one, nobody knows whether more of it would have come.
        for one in self._cycles(streams)[:-1]:
            if one.frame < first_frame or one.frame >= counts_from:
                continue
            is_torn = len(one.streams) < len(streams)
            seen, torn = seen + 1, torn + is_torn
            is_judged = self._since_ns is None or one.begin_ns >= self._since_ns
            if not is_judged or (holds is not None and not holds.spans.at_frames(np.array([one.frame]))[0]):
                continue
            found.cycles += 1
            if found.widest is None or one.end_ns - one.begin_ns > found.skew_ns:
                found.skew_ns, found.widest = one.end_ns - one.begin_ns, (one.frame, one.begin_ns)
            if is_torn:
                found.torn += 1
                if len(frames) < FRAMES_KEPT:
                    frames.append((one.frame, one.begin_ns))
        found.frames = frames
        # Where most are torn, its Counters do not say what belongs together.
        return found if 2 * torn <= seen else JudgedCycles()

    def _cycles(self, streams: Sequence[int]) -> list[_Cycle]:
        """Return the cycles of streams, by what their Counters say; those behind what was kept of any are left out."""
        ends = min(
            (self._telegrams[one][-1][0] for one in streams if len(self._telegrams[one]) >= _MOST_TELEGRAMS),
            default=None,
        )
        telegrams = sorted((*one, stream) for stream in streams for one in self._telegrams[stream])
        if len({counter for _, _, counter, _ in telegrams}) < 2:
            return []
        found: list[_Cycle] = []
        open_: dict[int, _Cycle] = {}
        for frame, time_ns, counter, stream in telegrams:
            if ends is not None and frame > ends:
                break
            cycle = open_.get(counter)
            if cycle is None:
                cycle = open_[counter] = _Cycle({stream}, frame, time_ns, time_ns)
                found.append(cycle)
                if len(open_) > _OPEN:
                    del open_[next(iter(open_))]
                continue
            cycle.streams.add(stream)
            cycle.end_ns = max(cycle.end_ns, time_ns)
        return found


def _counts_from(stream: int, cycles: Cycles) -> int:
    """Return the frame from which on the state counts the cycles of a stream."""
    pairs = cycles.streams.column("pair")
    pair = int(pairs[stream]) if stream < len(pairs) else -1
    never = int(np.iinfo(np.int64).max)
    if pair < 0:
        return never
    columns = cycles.columns
    is_ready = int(columns.ready[pair]) >= int(columns.streams[pair])
    return int(columns.ready_from[pair]) if is_ready else never
