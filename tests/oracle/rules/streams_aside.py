"""Segments that are not of the connection that is known between their ends, and may be those of another one.

Readings, where the rules leave a choice:

- segments that are elsewhere may be those of another connection, whose SYN was not captured. One that acknowledges
  something is kept aside, those that follow on it with it, up to 64 KiB and 256 of them; another one takes its place
- if a segment of the other direction begins where the last of these acknowledges, and acknowledges some of them, the
  other connection has begun with them, in the frame that shows that
- data, FIN or SYN that are not elsewhere, and an RST, make that what is aside is ignored: the connection goes on
"""

from __future__ import annotations

from dataclasses import dataclass

from tests.oracle.tcp import ACK, FIN, RST, SYN, Segment

MOST_ASIDE, MOST_SEGMENTS = 2**16, 256


def told(segment: Segment) -> int | None:
    """Return what a segment acknowledges, None where it says nothing."""
    return segment.ack or None if segment.flags & ACK else None


@dataclass
class Aside:
    """Segments that may be the first ones of another connection, which follow on each other, and when they came."""

    from_client: bool
    segments: list[tuple[Segment, int]]

    @property
    def size(self) -> int:
        return sum(segment.length for segment, _ in self.segments)

    def goes_on_with(self, segment: Segment, from_client: bool) -> bool:
        end = self.segments[0][0].seq + self.size
        follows = from_client == self.from_client and (segment.seq - end) % 2**32 == 0
        return follows and self.size + segment.length <= MOST_ASIDE and len(self.segments) < MOST_SEGMENTS

    def is_proven_by(self, segment: Segment, from_client: bool) -> bool:
        first, last = self.segments[0][0], self.segments[-1][0]
        if from_client == self.from_client or segment.flags & (SYN | RST) or told(segment) is None:
            return False
        size = self.size + bool(last.flags & FIN)
        return segment.seq == last.ack and 0 < (segment.ack - first.seq) % 2**32 <= size


def put(known: Aside | None, segment: Segment, time: int, *, from_client: bool) -> Aside | None:
    """Return what is aside once a segment has come that is elsewhere."""
    if told(segment) is None:
        return None
    if known is not None and known.goes_on_with(segment, from_client):
        known.segments.append((segment, time))
        return known
    return Aside(from_client, [(segment, time)])
