"""Segments aside: those that lie elsewhere than their connection is, and may be the first ones of another one.

Ports are used again, and the SYN need not have been captured. A segment alone says nothing: it may be garbage. That the
other end goes on where such segments acknowledge, and acknowledges them, shows that they arrived, and that another
connection has begun: in no other can both be.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from dissectors.batch import U8
from dissectors.headers import FIN
from nvscope.tracker.segments import HALF, WRAP, Captured

NEAR = 1 << 20
"""What is that near to where a stream has begun, or has ended, may be of it all the same."""

MOST_ASIDE_BYTES = 1 << 16
MOST_ASIDE_SEGMENTS = 1 << 8
"""So many of a connection: a FIN that comes again has no bytes, and others may have one."""

MOST_ASIDE_IN_ALL = 1 << 8


class Aside:
    """Segments of one direction that follow on each other."""

    def __init__(self, first: Captured) -> None:
        self.segments = [first]
        self._size = first.payload_bytes

    def goes_on_with(self, segment: Captured) -> bool:
        """Tell whether a segment follows on these, and keep it with them then."""
        size = self._size + segment.payload_bytes
        is_room = size <= MOST_ASIDE_BYTES and len(self.segments) < MOST_ASIDE_SEGMENTS
        if segment.side != self.segments[0].side or (segment.sequence - self._end) % WRAP or not is_room:
            return False
        self.segments.append(segment)
        self._size = size
        return True

    def is_proven_by(self, segment: Captured) -> bool:
        """Tell whether a segment, which is no SYN or RST, begins where these acknowledge, and acknowledges some."""
        last = self.segments[-1]
        if segment.side == last.side or segment.sequence != last.told or segment.told < 0:
            return False
        ahead = (segment.told - self.segments[0].sequence) % WRAP
        return 0 < ahead <= self._size + (last.flags & FIN)

    @property
    def _end(self) -> int:
        return self.segments[0].sequence + self._size


class SegmentsAside:
    """Those of all connections, by the number of each; of further ones, none are kept."""

    def __init__(self) -> None:
        self._of: dict[int, Aside] = {}

    def __contains__(self, connection: int) -> bool:
        return connection in self._of

    def clear(self) -> None:
        """Ignore all."""
        self._of.clear()

    def keep(self, numbers: Mapping[int, int]) -> None:
        """Ignore those of all connections but some, which are numbered anew; ``numbers`` are of streams."""
        self._of = {numbers[2 * one] >> 1: aside for one, aside in self._of.items() if 2 * one in numbers}

    def put(self, connection: int, segment: Captured) -> None:
        """Keep a segment, in place of what it does not follow on; one that acknowledges nothing tells nothing."""
        known = self._of.get(connection)
        if segment.told < 0:
            self._of.pop(connection, None)
        elif not (known and known.goes_on_with(segment)) and (known or len(self._of) < MOST_ASIDE_IN_ALL):
            self._of[connection] = Aside(segment)

    def drop(self, connection: int) -> None:
        """Ignore what is kept of a connection: that goes on."""
        self._of.pop(connection, None)

    def proven_by(self, connection: int, segment: Captured) -> Aside | None:
        """Return what a segment shows to be of another connection, and keep it no more; None where it shows nothing."""
        aside = self._of.get(connection)
        return self._of.pop(connection) if aside and aside.is_proven_by(segment) else None

    def hold_data(self, connection: int, data: U8) -> None:
        """Hold the data of a connection, which lies in the buffer of a batch."""
        if aside := self._of.get(connection):
            aside.segments = [segment.with_data(data) for segment in aside.segments]


def is_in_front(sequence: int, first: int, at: int, most: int) -> bool:
    """Tell whether a sequence number is in front of where a stream has begun, which is ``at`` now.

    Where it has gone on for more than ``most``, nobody knows.
    """
    return first >= 0 and (at - first) % WRAP <= most and (sequence - first + HALF) % WRAP - HALF < -NEAR


def missing_behind(at: int, known: Iterable[int]) -> int:
    """Return how many bytes are missing behind a stream that is over, which is ``at`` there.

    ``known`` are sequence numbers up to which it was sent, -1 for none. What lies far ahead is garbage, and a single
    place may be that of a FIN.
    """
    ahead = ((one - at + HALF) % WRAP - HALF for one in known if one >= 0)
    return max((one for one in ahead if 1 < one <= NEAR), default=0)
