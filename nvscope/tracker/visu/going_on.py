"""GoingOn: when it is sure that a client, which closed its side while its request waited, waits no more.

A connection of which only the client's side is closed may still be answered: some clients close it with the request
(RFC 9293, section 3.6). What is sure is that the client goes on without a reply: it opens another connection to the
same server, ``PATIENCE_NS`` or longer after it closed its side of this one. Of who asks no more, time tells: the first
frame behind that, of whatever ports, that is ``LONGEST_NS`` later shows that it is over, for good.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, PacketBatch
from dissectors.headers import ACK, RST, SYN
from dissectors.keys import KeyTable
from dissectors.transport import SegmentBatch
from nvscope.tracker.connections import Connections
from nvscope.tracker.pieces import NEVER, ORDER_BITS, Order

PATIENCE_NS = 10**9
"""Who opens another connection sooner may ask for several things at a time."""

LONGEST_NS = 10 * 10**9
"""Nothing came for so long after the client closed its side: it is not waited for any more."""


class Closed(NamedTuple):
    """With which order a client closed its side of a connection, or its server was heard behind that; and when it did.

    ``over_frame`` is the frame of an earlier batch that showed that it is over, 0 without one.
    """

    order: int
    arrival_ns: int
    over_frame: int = 0

    @property
    def frame(self) -> int:
        """The frame of that order."""
        return self.order >> ORDER_BITS

    @property
    def over_ns(self) -> int:
        """When it is not waited for any more."""
        return self.arrival_ns + LONGEST_NS


class Over(NamedTuple):
    """Which frame showed that a client waited no more, and when that was: by time alone."""

    frame: int
    time_ns: int


class Gone(NamedTuple):
    """The order of the segment with which it is told that a client waits no more; ``over`` where time told it."""

    order: int
    over: Over | None = None


def first_behind(frame: int, over_ns: int, times_ns: I64, first_frame: int) -> int:
    """Return the first frame of a batch behind one that is not before a time, 0 without one."""
    begin = max(frame + 1 - first_frame, 0)
    late = times_ns[begin:] >= over_ns
    return first_frame + begin + int(late.argmax()) if late.any() else 0


class GoingOn:
    """The segments of a batch, by which it is known that clients go on; its row 0 is frame ``first_frame``.

    Most batches are never asked: then nothing of them is looked through.
    """

    def __init__(
        self, connections: Connections, packets: PacketBatch, segments: SegmentBatch, first_frame: int
    ) -> None:  # fmt: skip
        self._connections = connections
        self._packets, self._segments, self._first_frame = packets, segments, first_frame

    @cached_property
    def _time_ns(self) -> I64:
        return self._packets.ts_ns[self._segments.row]

    @cached_property
    def _order(self) -> I64:
        return (self._segments.row + self._first_frame) << ORDER_BITS | int(Order.ACKNOWLEDGED)

    @cached_property
    def _rises(self) -> bool:
        return bool((self._time_ns[1:] >= self._time_ns[:-1]).all())

    def since(self, connection: int, closed: Closed) -> Gone:
        """Return since when a client that has closed its side waits no more; ``NEVER`` where no segment tells it."""
        opened = self._first_of(self._opened_like(connection), closed.order, closed.arrival_ns + PATIENCE_NS)
        frame = self.passed(closed).over_frame
        if not frame:
            return Gone(opened)
        place = int(np.searchsorted(self._order, frame << ORDER_BITS))
        first = int(self._order[place]) if place < len(self._order) else NEVER
        return Gone(opened) if opened < first else Gone(first, Over(frame, closed.over_ns))

    def passed(self, closed: Closed) -> Closed:
        """Return the same with the frame of the batch that shows that it is over, if one does."""
        if closed.over_frame:
            return closed
        times_ns, first_frame = self._packets.ts_ns, self._first_frame
        return closed._replace(over_frame=first_behind(closed.frame, closed.over_ns, times_ns, first_frame))

    def _first_of(self, places: I64, order: int, time_ns: int) -> int:
        """Return the order of the first of some segments, rising, that is behind an order and not before a time."""
        behind = places[np.searchsorted(self._order[places], order, side="right") :]
        times = self._time_ns[behind]
        if self._rises:
            place = int(np.searchsorted(times, time_ns))
            return int(self._order[behind[place]]) if place < len(behind) else NEVER
        late = np.flatnonzero(times >= time_ns)
        return int(self._order[behind[late[0]]]) if len(late) else NEVER

    def _opened_like(self, connection: int) -> I64:
        """Return the segments with which its client opens connections to the same server."""
        pairs, number, places = self._opened
        ends = self._connections.ends_of(np.array([connection]))
        own = int(pairs.find(*ends.client, *ends.server, ends.server_port)[0])
        if own < 0:
            return places[:0]
        return places[np.searchsorted(number, own) : np.searchsorted(number, own, side="right")]

    @cached_property
    def _opened(self) -> tuple[KeyTable, I64, I64]:
        """Return between which pairs connections are opened, and, by pair, its number and the segments that do so."""
        segments, pairs = self._segments, KeyTable(5)
        places = np.flatnonzero((segments.flags & (SYN | ACK | RST)) == SYN)
        number = pairs.numbers(
            segments.source_hi[places], segments.source_lo[places], segments.destination_hi[places],
            segments.destination_lo[places], segments.destination_port[places].astype(np.uint64),
        )  # fmt: skip
        by_pair = np.argsort(number, kind="stable")
        return pairs, number[by_pair], places[by_pair]
