"""EventBatch: events as they happen, told to whoever wants to know of each.

What an accumulator notes passes through ``Told``, batch by batch: columns that keep all of them are one listener
(``nvscope.tracker.evidence``), triggers and rules can be others.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Protocol

import numpy as np
from msgspec import Struct

from dissectors.batch import I64

NOWHERE = -1
"""In place of the number of what an event does not concern, or of what nobody knows."""


class EventBatch(Struct, frozen=True):
    """Events of one kind that a batch showed; those of one place in the order in which they happened.

    ``kind`` is a ``nvscope.tracker.event_kinds.EventKind``, or a member of an enumeration of a protocol's own.
    ``list``, ``node``, ``peer`` and ``channel`` are numbers of the state (``Keys``; channels as in ``CanBatch``),
    ``NOWHERE`` where it concerns none, as ``subindex``. ``time_ns`` is when it happened, ``frame`` the frame that it is
    told of (from 1): what nobody answered is told of the frame that waited. ``since_ns`` is when it began, or the time
    of what went before; ``peer`` is the other node; ``amount`` is how much it was, ``detail`` what else is to be said.
    What these are is told by its kind; where that says nothing, they are ``time_ns``, ``NOWHERE``, 1 and 0. All int64
    of shape (n,).

    What a Counter shows depends on what it counts, which is known in the end: such an event is told for the stream's
    own sequence and for the node's, as ``scope`` says (``nvscope.tracker.counters.Scope``). None where no Counter is
    looked at. ``pair`` are numbers of who asks whom, by which a protocol tells conversations apart; None where it does
    not.
    """

    kind: IntEnum
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
    scope: int | None = None
    pair: I64 | None = None

    def __len__(self) -> int:
        return len(self.frame)

    def __getitem__(self, rows: slice) -> EventBatch:
        """Return the events of a slice."""
        return self.take(rows)

    def take(self, rows: slice | I64) -> EventBatch:
        """Return some of the events."""
        return EventBatch(
            self.kind, self.list[rows], self.node[rows], self.subindex[rows], self.channel[rows], self.since_ns[rows],
            self.time_ns[rows], self.frame[rows], self.amount[rows], self.peer[rows], self.detail[rows], self.scope,
            None if self.pair is None else self.pair[rows],
        )  # fmt: skip

    @staticmethod
    def of(
        kind: IntEnum, time_ns: I64, frame: I64, *, lists: I64 | None = None, node: I64 | None = None,
        subindex: I64 | None = None, channel: I64 | None = None, since_ns: I64 | None = None,
        amount: I64 | None = None, peer: I64 | None = None, detail: I64 | None = None, scope: int | None = None,
        pair: I64 | None = None,
    ) -> EventBatch:  # fmt: skip
        """Return events of which nothing else is to be told."""

        def filled(column: I64 | None, otherwise: int) -> I64:
            return np.full(len(frame), otherwise) if column is None else column

        return EventBatch(
            kind, filled(lists, NOWHERE), filled(node, NOWHERE), filled(subindex, NOWHERE), filled(channel, NOWHERE),
            time_ns if since_ns is None else since_ns, time_ns, frame, filled(amount, 1), filled(peer, NOWHERE),
            filled(detail, 0), scope, pair,
        )  # fmt: skip


class EventListener(Protocol):
    """Whoever wants to know of each event."""

    def hear(self, events: EventBatch) -> None:
        """Take events; batches of different kinds come in any order, those of one place as the capture goes on."""
        ...


Listeners = Sequence[EventListener]
