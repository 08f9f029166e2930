"""Unanswered: how often, and when, a node did not answer for a list, rejected it, or asked for it in vain."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64
from dissectors.keys import KeyTable
from nvscope.engine.events import EventBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.reader_answers import MOST_PAIRS

KINDS = (
    EventKind.NO_ACKNOWLEDGEMENT, EventKind.NEGATIVE_ACKNOWLEDGEMENT, EventKind.SEND_REJECTED,
    EventKind.BOOT_UP_UNANSWERED,
)  # fmt: skip


class UnansweredColumns(KeyedColumns):
    """One row an event kind, list and peer: how often it happened, and when first and last."""

    count: I64
    first_ns: I64
    last_ns: I64
    COLUMNS: ClassVar = {
        "count": (np.int64(0), 1), "first_ns": (np.iinfo(np.int64).max * np.int64(1), 1),
        "last_ns": (np.iinfo(np.int64).min * np.int64(1), 1),
    }  # fmt: skip


class Unanswered:
    """A listener: ``keys`` number (kind, list, peer), the rows of ``columns``; a peer below 0 is nobody in particular.

    ``left_out`` counts the events for which there was no room.
    """

    def __init__(self, most: int = MOST_PAIRS) -> None:
        self._most = most
        self.keys = KeyTable(3)
        self.columns = UnansweredColumns()
        self.left_out = 0

    def hear(self, events: EventBatch) -> None:
        """Take events; those of other kinds than ``KINDS`` are not looked at."""
        if events.kind not in KINDS or not len(events):
            return
        kind = np.full(len(events), int(events.kind), np.uint64)
        lists, peer = (column.astype(np.int64).view(np.uint64) for column in (events.list, events.peer))
        number = self.keys.numbers_within(self._most, kind, lists, peer)
        room = number >= 0
        self.left_out += len(number) - int(np.count_nonzero(room))
        number, time_ns = number[room], events.time_ns[room]
        self.columns.resize(len(self.keys))
        np.add.at(self.columns.count, number, 1)
        np.minimum.at(self.columns.first_ns, number, time_ns)
        np.maximum.at(self.columns.last_ns, number, time_ns)
