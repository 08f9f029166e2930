"""EventColumns: the events that they are told of, as columns, up to a limit: the first ones, and the last ones.

What began long ago is told by the first events, what happens now by the last: a capture that goes on for weeks must
not stop to see.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.engine.events import NOWHERE, EventBatch
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.first_and_last import FirstAndLast

MOST_EVENTS = 1 << 18
"""So many are kept, 67 bytes each, of captures that have an end."""

MOST_EVENTS_LIVE = 1 << 15
"""So many are kept of live sources."""

_MOST_PARTS = 256
_LEAST_ROWS, _MOST_ROWS = 1 << 12, 1 << 14

NO_SCOPE = -1

FIRST_OF_PROTOCOLS = 1 << 16
"""From this number on, kinds are those of protocols."""


class EventTable(NamedTuple):
    """Events by frame, then kind, scope and place; columns as in ``EventBatch``, int64 of shape (n,).

    ``kind`` is an ``EventKind``, or one of ``EventColumns.kinds``; ``scope`` a ``nvscope.tracker.counters.Scope``, or
    ``NO_SCOPE``; ``pair`` is ``NOWHERE`` of what a protocol does not tell apart by it.
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
    pair: I64


_OF_BATCH = EventTable._fields[2:-1]
_NUMBERS = ("list", "node", "subindex", "channel", "peer", "pair")
_WIDTH = {"kind": np.int16, "scope": np.int8} | dict.fromkeys(_NUMBERS, np.int32)
_NOTHING = EventTable(*(np.empty(0, _WIDTH.get(name, np.int64)) for name in EventTable._fields))


class EventColumns:
    """A listener that keeps ``most`` of the events it is told: a quarter of them the first ones, the others the last.

    ``left_out`` counts those in between.
    """

    def __init__(self, most: int = MOST_EVENTS) -> None:
        self._room = FirstAndLast(most)
        # As they were told, in narrow columns; kinds by their place in ``_heard``.
        self._stored = _NOTHING
        self._waiting: list[EventBatch] = []
        self._rows_waiting = 0
        self._heard: dict[tuple[str, str, str], IntEnum] = {}
        self._table: EventTable | None = None
        self._told = 0

    @property
    def count(self) -> int:
        """How many are kept."""
        return min(self._told, self._room.most)

    @property
    def held(self) -> int:
        """How many are in memory: more than are kept, until those are thrown away together."""
        return len(self._stored.frame) + self._rows_waiting

    @property
    def left_out(self) -> int:
        """How many there was no room for."""
        return self._told - self.count

    def hear(self, events: EventBatch) -> None:
        """Take events, which may be of any kind."""
        if not len(events):
            return
        self._heard.setdefault(_name(events.kind), events.kind)
        self._told += len(events)
        self._table = None
        self._waiting.append(events)
        self._rows_waiting += len(events)
        # As many as are stored: then storing costs little for each of them. What waits takes more room.
        enough = min(max(len(self._stored.frame), _LEAST_ROWS), _MOST_ROWS)
        if len(self._waiting) >= _MOST_PARTS or self._rows_waiting >= enough:
            self._store()

    @property
    def kinds(self) -> Mapping[int, IntEnum]:
        """The kinds that there were events of, by their number in the table: those of protocols by name."""
        own: dict[int, IntEnum] = {int(kind): kind for kind in self._heard.values() if isinstance(kind, EventKind)}
        others = [name for name, kind in sorted(self._heard.items()) if not isinstance(kind, EventKind)]
        return own | {FIRST_OF_PROTOCOLS + place: self._heard[name] for place, name in enumerate(others)}

    def table(self) -> EventTable:
        """Return what was told so far; a later table is another one."""
        if self._table is None:
            self._table = self._made()
        return self._table

    def _store(self) -> None:
        """Put what waits behind what is stored; what there is no room for is thrown away, many at once."""
        if not self._waiting:
            return
        places = {name: place for place, name in enumerate(self._heard)}
        length = [len(part) for part in self._waiting]
        kind = np.repeat([places[_name(part.kind)] for part in self._waiting], length)
        scope = np.repeat([NO_SCOPE if part.scope is None else part.scope for part in self._waiting], length)
        columns = (np.concatenate([getattr(part, name) for part in self._waiting]) for name in _OF_BATCH)
        pair = [np.full(len(part), NOWHERE) if part.pair is None else part.pair for part in self._waiting]
        stored = zip(self._stored, (kind, scope, *columns, np.concatenate(pair)), strict=True)
        self._stored = EventTable(
            *(np.concatenate([known, new.astype(known.dtype, copy=False)]) for known, new in stored)
        )
        self._waiting, self._rows_waiting = [], 0
        if self._room.is_full(len(self._stored.frame)):
            self._stored = self._kept()

    def _kept(self) -> EventTable:
        """Return those of the stored ones that there is room for."""
        rows = len(self._stored.frame)
        if rows <= self._room.most:
            return self._stored
        kept = self._room.kept(rows)
        return EventTable(*(column[kept] for column in self._stored))

    def _made(self) -> EventTable:
        self._store()
        kept = self._kept()
        numbers = {_name(kind): number for number, kind in self.kinds.items()}
        number = np.array([numbers[name] for name in self._heard], np.int64)
        whole = EventTable(*(column.astype(np.int64) for column in kept))
        table = whole._replace(kind=number[kept.kind])
        place = table.subindex, table.node, table.channel, table.list
        # Where one frame ends several waits of a place, they are told by when they began.
        order = _sorted((table.frame, table.kind, table.scope, *place[::-1], table.since_ns, table.detail, table.pair))
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
