"""EventLog: how often something happened, when first and last, and in which frames, for every key at once."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U64
from dissectors.keys import KeyTable
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of, stable_order
from nvscope.tracker.event_kinds import FRAMES_KEPT


class EventRows(KeyedColumns):
    """One row a key; ``frames`` holds frame numbers (from 1), 0 where there are fewer."""

    count: I64
    first_ns: I64
    last_ns: I64
    frames: I64
    COLUMNS: ClassVar = {
        "count": (np.int64(0), 1),
        "first_ns": (np.int64(0), 1),
        "last_ns": (np.int64(0), 1),
        "frames": (np.int64(0), FRAMES_KEPT),
    }

    def add(self, row: I64, start: I64, stop: I64, time_ns: I64, frame: I64, place: I64 | None = None) -> None:
        """Add the events ``start[i]`` to ``stop[i]`` to row ``row[i]`` of this table; rows differ.

        Event j is described by the j-th entries of ``time_ns`` and ``frame``, or by those at ``place[j]``.
        """
        before = self.count[row]
        begins = before == 0
        first, last = (start[begins], stop - 1) if place is None else (place[start[begins]], place[stop - 1])
        self.first_ns[row[begins]] = time_ns[first]
        self.last_ns[row] = time_ns[last]
        self.count[row] = before + stop - start
        room = np.flatnonzero(before < FRAMES_KEPT)
        if not len(room):
            return
        row, start, stop, before = row[room], start[room], stop[room], before[room]
        for event in range(FRAMES_KEPT):
            fits = (start + event < stop) & (before + event < FRAMES_KEPT)
            if not fits.any():
                break
            entry = start[fits] + event
            self.frames[row[fits], before[fits] + event] = frame[entry if place is None else place[entry]]


_FEW = 4096
"""Fewer events than this are collected before they are sorted in."""


class EventLog:
    """Events by key (two 64-bit words), kept as counts, the first and last time, and the first ten frames.

    Few events at a time are the rule, and sorting in a few costs as much as sorting in thousands: they wait until there
    are enough of them, or somebody looks.
    """

    def __init__(self) -> None:
        self._keys = KeyTable()
        self._rows = EventRows()
        self._waiting: list[tuple[U64, U64, I64, I64]] = []
        self._waiting_count = 0

    @property
    def keys(self) -> KeyTable:
        """The keys, by row."""
        self._sort_in()
        return self._keys

    @property
    def rows(self) -> EventRows:
        """What is known of each key."""
        self._sort_in()
        return self._rows

    def record(self, high: U64, low: U64, time_ns: I64, frame: I64) -> None:
        """Add one event a row, in the order in which they happened."""
        if not len(high):
            return
        self._waiting.append((high, low, time_ns, frame))
        self._waiting_count += len(high)
        if self._waiting_count >= _FEW:
            self._sort_in()

    def _sort_in(self) -> None:
        if not self._waiting:
            return
        high, low, time_ns, frame = (np.concatenate(column) for column in zip(*self._waiting, strict=True))
        self._waiting, self._waiting_count = [], 0
        number = self._keys.numbers(high, low)
        order = stable_order(number, len(self._keys))
        number = number[order]
        start, stop = runs_of(number)
        self._rows.resize(len(self._keys))
        self._rows.add(number[start], start, stop, time_ns[order], frame[order])
