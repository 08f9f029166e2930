"""EventColumns: the events that listeners are told of, as columns, up to a limit.

Causes are told from what happened, not from sums.

What is no event of a frame but holds for a time, such as who is present, or which reader answers, is to be an
``nvscope.tracker.accumulator.Accumulator`` of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.event_batch import EventBatch

MOST_EVENTS = 1 << 20
"""So many are kept, 64 bytes each; those behind them are counted."""

NO_SCOPE = -1


class EventTable(NamedTuple):
    """Events by frame, then kind, scope and place; columns as in ``EventBatch``, int64 of shape (n,).

    ``kind`` is an ``EventKind``, ``scope`` a ``Scope``, or ``NO_SCOPE``.
    """

    kind: I64
    scope: I64
    list: I64
    node: I64
    subindex: I64
    channel: I64
    time_ns: I64
    frame: I64
    amount: I64


_NOTHING = np.empty(0, np.int64)


class EventColumns:
    """A listener that keeps the first ``most`` events it is told; ``left_out`` counts the others."""

    def __init__(self, most: int = MOST_EVENTS) -> None:
        self._most = most
        self._parts: list[EventTable] = []
        self.count = 0
        self.left_out = 0

    def hear(self, events: EventBatch) -> None:
        """Take events, which may be of any kind."""
        room = min(len(events), self._most - self.count)
        self.left_out += len(events) - room
        if not room:
            return
        self.count += room
        scope = NO_SCOPE if events.scope is None else int(events.scope)
        kind, scopes = (np.full(room, number, np.int64) for number in (events.kind, scope))
        concerned = events.list, events.node, events.subindex, events.channel
        columns = (*concerned, events.time_ns, events.frame, events.amount)
        self._parts.append(EventTable(kind, scopes, *(column[:room].astype(np.int64) for column in columns)))

    def table(self) -> EventTable:
        """Return what was told so far; a later table is another one."""
        if not self._parts:
            return EventTable(*[_NOTHING] * len(EventTable._fields))
        columns = [np.concatenate(parts) for parts in zip(*self._parts, strict=True)]
        table = EventTable(*columns)
        place = table.subindex, table.node, table.channel, table.list
        order = np.lexsort((*place, table.scope, table.kind, table.frame))
        return EventTable(*(column[order] for column in table))
