"""EventColumns: the events that they are told of, as columns, up to a limit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.engine.events import EventBatch
from nvscope.tracker.event_kinds import EventKind

MOST_EVENTS = 1 << 18
"""So many are kept, 96 bytes each; those behind them are counted."""

NO_SCOPE = -1

FIRST_OF_PROTOCOLS = 1 << 16
"""From this number on, kinds are those of protocols."""


class EventTable(NamedTuple):
    """Events by frame, then kind, scope and place; columns as in ``EventBatch``, int64 of shape (n,).

    ``kind`` is an ``EventKind``, or one of ``EventColumns.kinds``; ``scope`` a ``nvscope.tracker.counters.Scope``, or
    ``NO_SCOPE``.
    """

    kind: I64
    scope: I64
    list: I64
    node: I64
    subindex: I64
    channel: I64
    since_ns: I64
    time_ns: I64
    frame: I64
    amount: I64
    peer: I64
    detail: I64


_OF_BATCH = EventTable._fields[2:]
_NOTHING = np.empty(0, np.int64)


class EventColumns:
    """A listener that keeps the first ``most`` events it is told; ``left_out`` counts the others."""

    def __init__(self, most: int = MOST_EVENTS) -> None:
        self._most = most
        self._parts: list[EventBatch] = []
        self._table: EventTable | None = None
        self.count = 0
        self.left_out = 0

    def hear(self, events: EventBatch) -> None:
        """Take events, which may be of any kind."""
        room = min(len(events), self._most - self.count)
        self.left_out += len(events) - room
        if not room:
            return
        self.count += room
        self._table = None
        self._parts.append(events if room == len(events) else events[:room])

    @property
    def kinds(self) -> Mapping[int, IntEnum]:
        """The kinds that there are events of, by their number in the table: those of protocols by name."""
        heard = {_name(part.kind): part.kind for part in self._parts}
        own: dict[int, IntEnum] = {int(kind): kind for kind in heard.values() if isinstance(kind, EventKind)}
        others = [name for name, kind in sorted(heard.items()) if not isinstance(kind, EventKind)]
        return own | {FIRST_OF_PROTOCOLS + place: heard[name] for place, name in enumerate(others)}

    def table(self) -> EventTable:
        """Return what was told so far; a later table is another one."""
        if self._table is None:
            self._table = self._made()
        return self._table

    def _made(self) -> EventTable:
        if not self._parts:
            return EventTable(*[_NOTHING] * len(EventTable._fields))
        numbers = {_name(kind): number for number, kind in self.kinds.items()}
        length = [len(part) for part in self._parts]
        kind = np.repeat([numbers[_name(part.kind)] for part in self._parts], length)
        scope = np.repeat([NO_SCOPE if part.scope is None else part.scope for part in self._parts], length)
        columns = (np.concatenate([getattr(part, name) for part in self._parts]) for name in _OF_BATCH)
        table = EventTable(kind, scope, *(column.astype(np.int64, copy=False) for column in columns))
        place = table.subindex, table.node, table.channel, table.list
        # Where one frame ends several waits of a place, they are told by when they began.
        order = _sorted((table.frame, table.kind, table.scope, *place[::-1], table.since_ns, table.detail))
        return EventTable(*(column[order] for column in table))


def _sorted(keys: Sequence[I64]) -> I64:
    """Return the order of rows by several keys, the first one before all others; hardly any are equal in that."""
    order = np.argsort(keys[0], kind="stable")
    first = keys[0][order]
    follows = np.append(False, first[1:] == first[:-1])[: len(order)]
    alike = np.flatnonzero(follows | np.append(follows[1:], False)[: len(order)])
    some = order[alike]
    order[alike] = some[np.lexsort([key[some] for key in reversed(keys)])]
    return order


def _name(kind: IntEnum) -> tuple[str, str, str]:
    """Return what tells a kind from all others: members of different enumerations are equal if their numbers are."""
    return type(kind).__module__, type(kind).__qualname__, kind.name
