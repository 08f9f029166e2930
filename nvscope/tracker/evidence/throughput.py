"""Throughput: how much was captured in each tenth of a second."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64
from dissectors.keys import KeyTable
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import distinct, runs_of
from nvscope.engine.told import Told
from nvscope.tracker.evidence.first_and_last import FirstAndLast

SLOT_NS = 100_000_000

MOST_SLOTS = 1 << 20
"""So many slots with frames are kept, 29 hours without a pause."""

MOST_SLOTS_LIVE = 1 << 17
"""So many are kept of live sources, of which the last hours count."""

_MOST_WAITING = 1 << 14


class SlotColumns(KeyedColumns):
    """One row a slot in which there were frames: how many, and how many bytes they had on the wire."""

    frames: I64
    bytes: I64
    COLUMNS: ClassVar = {"frames": (np.int64(0), 1), "bytes": (np.int64(0), 1)}


class Throughput:
    """An observer of all frames, which sums up many batches at a time: ``settle`` before looking at it.

    ``slots`` number the slots, by time // ``SLOT_NS`` as a 64-bit word, in the order in which they were seen; they are
    the rows of ``columns``. Of more than ``most``, the first and the last ones are kept; ``left_out`` counts the frames
    of the others.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, most: int = MOST_SLOTS) -> None:
        self._room = FirstAndLast(most)
        self.slots = KeyTable(1)
        self.columns = SlotColumns()
        self.left_out = 0
        self._parts: list[tuple[I64, I64, I64]] = []
        self._waiting = 0

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not len(told):
            return
        start = _starts(told)
        slot = told.packets.ts_ns[start] // SLOT_NS
        self._parts.append((slot, np.diff(start, append=len(told)), np.add.reduceat(told.packets.original, start)))
        self._waiting += len(start)
        if self._waiting >= _MOST_WAITING:
            self.settle()

    def settle(self) -> None:
        """Sum up what waits: of many batches at once, that costs hardly more than of one."""
        if not self._parts:
            return
        slot, frames, size_bytes = (np.concatenate(columns) for columns in zip(*self._parts, strict=True))
        self._parts, self._waiting = [], 0
        number = self.slots.numbers(slot.view(np.uint64))
        self.columns.resize(len(self.slots))
        np.add.at(self.columns.frames, number, frames)
        np.add.at(self.columns.bytes, number, size_bytes)
        if self._room.is_full(len(self.slots)):
            self.throw_away()

    def throw_away(self) -> None:
        """Throw away the slots for which there is no room; what is kept then does not hang on when it was done before.

        By itself that is done for many at once.
        """
        old, rows = self.columns, len(self.columns)
        if rows <= self._room.most:
            return
        kept = self._room.kept(rows)
        words, self.slots, self.columns = self.slots.words[0][kept], KeyTable(1), old.rows(kept)
        self.slots.numbers(words)
        self.left_out += int(old.column("frames").sum()) - int(self.columns.column("frames").sum())


def _starts(told: Told) -> I64:
    """Return where in a batch stretches begin whose packets are of one slot."""
    time_ns = told.packets.ts_ns
    first, last = int(time_ns[0]) // SLOT_NS, int(time_ns[-1]) // SLOT_NS
    if told.clock.steady and last - first < len(told):
        edge = np.searchsorted(time_ns, np.arange(first + 1, last + 1) * SLOT_NS)
        return distinct(np.append(0, edge))
    slot = time_ns // SLOT_NS
    return runs_of(slot)[0]
