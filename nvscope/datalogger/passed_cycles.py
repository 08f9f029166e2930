"""Passed cycles: what comes when a later cycle of its list has begun, of senders whose Counter runs over all telegrams.

Telegrams of a cycle are sent in the order of their SubIndexes. So between one and another of a later cycle there are at
least the rest of its own cycle and what is in front of the other one in that. Counters tell then that a telegram is
late, though no other of its stream has come since::

    A0=1 A2=3 B0=4 A1=2 B1=5     A1 is late: A2 and B0 are sent behind it, and it is two in front of B0
    A0=1 A2=3 A1=2 B0=4          A1 is in time: of the cycle in front of that of A2, it would be four in front of A2

What else the sender sends between them takes them further apart.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64
from nvscope.definition.layouts import Layouts
from nvscope.engine.rows import DataRows
from nvscope.list_key import ListKey
from nvscope.tracker.steps import WINDOW, Step, Steps

_WRAP = 1 << 16
_LATE = (Step.OVERTAKEN, Step.LATE)


def sent_whole(layouts: Layouts, keys: Collection[ListKey]) -> dict[ListKey, tuple[int, ...]]:
    """Return the SubIndexes of lists of several telegrams, all of which are sent in each cycle."""
    found = {}
    for key in keys:
        definitions = layouts.candidates_of(key)
        subindexes = {tuple(sorted({one.subindex for one in telegrams})) for telegrams in definitions}
        is_whole = all(one.list.is_sent_whole for telegrams in definitions for one in telegrams)
        if is_whole and len(subindexes) == 1 and len(only := subindexes.pop()) > 1:
            found[key] = only
    return found


class _Sent(Struct):
    """A list as a node sends it: so many ``telegrams`` a cycle, and at which place in it each stream comes."""

    telegrams: int
    rank: dict[int, int] = field(default_factory=dict)


class PassedCycles:
    """Knows the newest telegram of each stream of lists that are sent whole, by their SubIndexes in ``parts``."""

    def __init__(self, parts: Mapping[ListKey, Collection[int]]) -> None:
        self._rank = {key: {subindex: rank for rank, subindex in enumerate(sorted(own))} for key, own in parts.items()}
        self._lists: dict[tuple[int, ListKey], _Sent] = {}
        self._list_of: dict[int, _Sent] = {}
        self._newest: dict[int, tuple[int, int]] = {}
        """The Counter and the frame of the newest telegram of each stream, up to the batch."""
        self._runs: dict[int, tuple[int, int]] = {}
        """Where each stream has its rows in the batch."""
        self._on_time: dict[int, I64] = {}
        """Those of its rows that were not late, of streams that were asked for."""
        self._rows: DataRows
        self._steps: Steps
        self._first_frame = 0

    def begin(self, node: int, key: ListKey, subindex: int, stream: int) -> None:
        """Take note of a stream that has come."""
        rank = self._rank.get(key, {})
        if subindex in rank:
            own = self._list_of[stream] = self._lists.setdefault((node, key), _Sent(len(rank)))
            own.rank[stream] = rank[subindex]

    def take(self, rows: DataRows, steps: Steps, first_frame: int) -> None:
        """Take a batch, with the steps of its streams, and be asked for its telegrams."""
        self._rows, self._steps, self._first_frame = rows, steps, first_frame
        runs = zip(*(one.tolist() for one in (rows.run_stream, rows.start, rows.stop)), strict=True)
        self._runs = {stream: (start, stop) for stream, start, stop in runs if stream in self._list_of}
        self._on_time = {}

    def end(self) -> None:
        """Remember the newest telegrams of the batch."""
        for stream in self._runs:
            if (found := self._newest_in_batch(stream, None)) is not None:
                self._newest[stream] = found

    def has_passed(self, row: int, since: int) -> bool:
        """Tell whether a later cycle of its list had begun when a telegram came, in a frame from ``since`` on."""
        rows, stream = self._rows, int(self._rows.stream[row])
        own = self._list_of.get(stream)
        if own is None:
            return False
        counter, packet = int(rows.counter[row]), int(rows.packet[row])
        for other, rank in own.rank.items():
            newest = self._newest_in_batch(other, packet) or self._newest.get(other)
            if newest is None or newest[1] < since:
                continue
            least = own.telegrams - own.rank[stream] + rank
            if least <= (newest[0] - counter) % _WRAP <= WINDOW:
                return True
        return False

    def _newest_in_batch(self, stream: int, packet: int | None) -> tuple[int, int] | None:
        """Return the Counter and the frame of the newest telegram of a stream in the batch, in front of a packet."""
        if stream not in self._runs:
            return None
        rows, (start, last) = self._rows, self._runs[stream]
        if packet is not None:
            last = start + int(rows.packet[start:last].searchsorted(packet))
        last -= 1
        if last >= start and self._steps.step[last] in _LATE:
            on_time = self._on_time.get(stream)
            if on_time is None:
                step = self._steps.step[slice(*self._runs[stream])]
                on_time = self._on_time[stream] = start + np.flatnonzero(~np.isin(step, _LATE))
            place = int(on_time.searchsorted(last))
            last = int(on_time[place - 1]) if place else -1
        return None if last < start else (int(rows.counter[last]), int(rows.packet[last]) + self._first_frame)
