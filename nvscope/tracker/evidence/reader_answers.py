"""ReaderAnswers: how often, from when to when and how fast each reader acknowledged each list."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I32, I64
from dissectors.keys import KeyTable
from nvscope.engine.events import EventBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of, stable_order
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.latency import Latencies

MOST_PAIRS = 1 << 16
"""So many pairs of list and reader are kept; acknowledgements of others are counted."""

_TAKEN_TOGETHER = 1 << 17


class AnswerColumns(KeyedColumns):
    """One row a list and reader: its acknowledgements, and when the first and the last one came."""

    count: I64
    first_ns: I64
    last_ns: I64
    COLUMNS: ClassVar = {"count": (np.int64(0), 1), "first_ns": (np.int64(0), 1), "last_ns": (np.int64(0), 1)}


class ReaderAnswers:
    """A listener, which takes many events at a time: ``settle`` before looking at it.

    ``pairs`` number lists and readers (``Keys``), which are the rows of ``columns``, and by which ``latencies`` are.
    ``left_out`` counts the acknowledgements for which there was no room.
    """

    def __init__(self, most: int = MOST_PAIRS) -> None:
        self._most = most
        self._waiting: list[tuple[I32, I32, I64, I64]] = []
        self._events = 0
        self.pairs = KeyTable()
        self.columns = AnswerColumns()
        self.latencies = Latencies()
        self.left_out = 0

    def hear(self, events: EventBatch) -> None:
        """Take events; those of any other kind than ``EventKind.ACKNOWLEDGED`` are not looked at."""
        if events.kind is EventKind.ACKNOWLEDGED and len(events):
            lists, peer = events.list.astype(np.int32), events.peer.astype(np.int32)
            self._waiting.append((lists, peer, events.time_ns, events.since_ns))
            self._events += len(events)
            if self._events >= _TAKEN_TOGETHER:
                self.settle()

    def settle(self) -> None:
        """Count what waits to be counted."""
        waiting, self._waiting, self._events = self._waiting, [], 0
        if not waiting:
            return
        lists, peer, time_ns, since_ns = (np.concatenate(parts) for parts in zip(*waiting, strict=True))
        number = self.pairs.numbers_within(self._most, lists.astype(np.uint64), peer.astype(np.uint64))
        room = number >= 0
        self.left_out += len(number) - int(np.count_nonzero(room))
        number, time_ns, since_ns = number[room], time_ns[room], since_ns[room]
        self._count(number, time_ns, since_ns)

    def _count(self, number: I64, time_ns: I64, since_ns: I64) -> None:
        columns, pairs = self.columns, len(self.pairs)
        columns.resize(pairs)
        self.latencies.observe(number, time_ns - since_ns, pairs)
        order = stable_order(number, pairs)
        number, time_ns = number[order], time_ns[order]
        start, stop = runs_of(number)
        if not len(start):
            return
        run = number[start]
        first_ns, last_ns = np.minimum.reduceat(time_ns, start), np.maximum.reduceat(time_ns, start)
        begins = columns.count[run] == 0
        columns.first_ns[run] = np.where(begins, first_ns, np.minimum(columns.first_ns[run], first_ns))
        columns.last_ns[run] = np.where(begins, last_ns, np.maximum(columns.last_ns[run], last_ns))
        columns.count[run] += stop - start
