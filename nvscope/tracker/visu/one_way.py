"""OneWay: what the acknowledgements of one direction say of the other one, of which nothing was captured.

A mirror port of one direction shows half of each connection. Whoever acknowledges more than before has got bytes which
the capture lacks; a peer that says nothing is acknowledged no further.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from dissectors.headers import ACK, SYN
from dissectors.transport import SegmentBatch
from nvscope.engine.runs import distinct, stable_order
from nvscope.tracker.connections import Connections
from nvscope.tracker.pieces import NEVER, ORDER_BITS, Order
from nvscope.tracker.segments import FAR, WRAP
from nvscope.tracker.visu.reach import UNKNOWN, latest_of

_LEAST_BYTES = 2
"""One more is what the end of a direction takes, which carries nothing (RFC 9293, section 3.4)."""

_FIRST_LOOK = 16


class More(NamedTuple):
    """With which order somebody acknowledged how many bytes more than before."""

    order: int
    size: int


NO_MORE = More(NEVER, 0)


class OneWay:
    """The acknowledgements of a batch, whose row 0 is frame ``first_frame``; few batches are ever asked."""

    def __init__(self, connections: Connections, segments: SegmentBatch, first_frame: int) -> None:
        self._connections, self._segments, self.first_frame = connections, segments, first_frame

    @cached_property
    def _stream(self) -> I64:
        """The stream of each segment, -1 of those of connections that nobody knows."""
        return self._connections.streams_of(self._segments, np.zeros(len(self._segments), np.bool_))

    @cached_property
    def _by_stream(self) -> tuple[I64, I64, I64]:
        """Return the streams of what acknowledges something and begins nothing, by stream; frames, and how far."""
        segments = self._segments
        places = np.flatnonzero(((segments.flags & (ACK | SYN)) == ACK) & (self._stream >= 0))
        places = places[stable_order(self._stream[places], 2 * len(self._connections) + 1)]
        frame = segments.row[places] + self.first_frame
        return self._stream[places], frame, segments.acknowledgement[places].astype(np.int64)

    def of_clients(self, connections: set[int]) -> list[int]:
        """Return those of some connections, rising, whose client acknowledges something in the batch."""
        if not connections:
            return []
        streams = distinct(self._by_stream[0])
        return sorted(connections.intersection((streams[streams % 2 == 0] >> 1).tolist()))

    def more_than(self, acknowledged: int, stream: int, order: int) -> More:
        """Return what a stream's speaker acknowledges first, behind an order, that is more than so much."""
        streams, frame, told = self._by_stream
        begin, end = np.searchsorted(streams, (stream, stream + 1)).tolist()
        begin += int(np.searchsorted(frame[begin:end], order >> ORDER_BITS, side="right"))
        many = _FIRST_LOOK
        while begin < end:
            stop = min(begin + many, end)
            size = (told[begin:stop] - acknowledged) % WRAP
            found = np.flatnonzero((size >= _LEAST_BYTES) & (size < FAR))
            if len(found):
                place = int(found[0])
                return More(int(frame[begin + place]) << ORDER_BITS | int(Order.ACKNOWLEDGED), int(size[place]))
            begin, many = stop, 2 * many
        return NO_MORE

    def most_acknowledged(self, stream: int, first: int, stop: int) -> int:
        """Return how far a stream's speaker acknowledges at most from one frame on in front of another one."""
        streams, frame, told = self._by_stream
        begin, end = np.searchsorted(streams, (stream, stream + 1)).tolist()
        own = slice(*(begin + np.searchsorted(frame[begin:end], (first, stop))).tolist())
        return latest_of(UNKNOWN, told[own])

    def missed_of(self, connection: int) -> MissedReplies:
        """Return what tells of the replies of a connection that were missed."""
        return MissedReplies(self, connection)

    def acknowledged_at(self, stream: int, order: int) -> int:
        """Return how far a stream's speaker acknowledges in the frame of an order, ``UNKNOWN`` where it is no such."""
        segments, row = self._segments, (order >> ORDER_BITS) - self.first_frame
        place = int(np.searchsorted(segments.row, row))
        if place == len(segments) or segments.row[place] != row or not segments.flags[place] & ACK:
            return UNKNOWN
        return int(segments.acknowledgement[place]) if self._stream[place] == stream else UNKNOWN


class MissedReplies(NamedTuple):
    """The replies of a server that were missed before it was heard (``Missed``)."""

    one_way: OneWay
    connection: int

    def acknowledged(self, order: int) -> int:
        """Return up to where the client acknowledges the server's bytes with an order."""
        return self.one_way.acknowledged_at(2 * self.connection, order)

    def by(self, order: int, acknowledged: int, before: int) -> int:
        """Return with which order a reply was missed to what was asked with one; ``NEVER`` without any before."""
        if acknowledged == UNKNOWN:
            return NEVER
        found = self.one_way.more_than(acknowledged, 2 * self.connection, order).order
        return found if found < before else NEVER


def more_bytes(acknowledged: int, before: int) -> int:
    """Return how many bytes more are acknowledged than before, 0 where that does not say that there were any."""
    if UNKNOWN in (acknowledged, before):
        return 0
    size = (acknowledged - before) % WRAP
    return size if _LEAST_BYTES <= size < FAR else 0
