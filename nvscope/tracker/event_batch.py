"""EventBatch: events as they happen, told to whoever wants to know of each.

What the tracker notes by itself passes here, batch by batch: the log that keeps ten of a kind and place is one
listener, columns that keep all of them another (``nvscope.tracker.event_columns``); triggers and rules can be more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import EventKind

NOWHERE = -1
"""In place of the number of what an event does not concern."""


@dataclass(frozen=True, slots=True)
class EventBatch:
    """Events of one kind that a batch showed; those of one place in the order in which they happened.

    ``list``, ``node`` and ``channel`` are numbers of the state (``Keys``; channels as in ``CanBatch``), ``NOWHERE``
    where it concerns none, as ``subindex``. ``time_ns`` is when it happened, ``frame`` the frame that it is told of
    (from 1): what nobody answered is told of the frame that waited. ``amount`` is how much it was, such as the counters
    that a gap left out, else 1. All int64 of shape (n,).

    What a Counter shows depends on what it counts, which is known in the end: such an event is told for the stream's
    own sequence and for the node's, as ``scope`` says. None where no Counter is looked at.
    """

    kind: EventKind
    list: I64
    node: I64
    subindex: I64
    channel: I64
    time_ns: I64
    frame: I64
    amount: I64
    scope: Scope | None = None

    def __len__(self) -> int:
        return len(self.frame)

    @staticmethod
    def on_list(
        kind: EventKind, lists: I64, node: I64, subindex: I64, time_ns: I64, frame: I64, *,
        amount: I64 | None = None, scope: Scope | None = None,
    ) -> EventBatch:  # fmt: skip
        """Return events that concern lists, or nodes."""
        count = len(frame)
        return EventBatch(
            kind, lists, node, subindex, np.full(count, NOWHERE), time_ns, frame,
            np.ones(count, np.int64) if amount is None else amount, scope,
        )  # fmt: skip

    @staticmethod
    def on_bus(kind: EventKind, channel: I64, time_ns: I64, frame: I64) -> EventBatch:
        """Return events that concern a CAN channel, or, with ``NOWHERE``, the capture."""
        nowhere = np.full(len(frame), NOWHERE)
        return EventBatch(kind, nowhere, nowhere, nowhere, channel, time_ns, frame, np.ones(len(frame), np.int64))


class EventListener(Protocol):
    """Whoever wants to know of each event."""

    def hear(self, events: EventBatch) -> None:
        """Take events; batches of different kinds come in any order, those of one kind as the capture goes on."""
        ...


Listeners = Sequence[EventListener]


def tell(listeners: Listeners, events: EventBatch) -> None:
    """Tell events to all listeners; of none, nothing is told."""
    if len(events):
        for listener in listeners:
            listener.hear(events)
