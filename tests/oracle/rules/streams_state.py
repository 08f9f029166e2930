"""One direction of a TCP connection, and both together: where they are, and what is kept of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from tests.oracle.frame import Address
from tests.oracle.rules.streams_aside import Aside
from tests.oracle.rules.streams_told import FARTHEST, NEAR, Had, distance
from tests.oracle.tcp import ACK, RST, SYN, Segment

End = tuple[Address, int]
"""Address and port."""

Place = tuple[int, int]
"""A frame, and which of the segments that are taken with it."""


class Carried(NamedTuple):
    """A byte, None where it was not captured, and when it came; of a FIN just the latter."""

    byte: int | None
    place: Place
    time: int
    told: int | None = None
    """What its segment acknowledged."""


@dataclass
class Direction:
    """One direction of a connection; places are counted from its first byte."""

    begin: int | None = None
    """The sequence number of its first byte."""
    began_with_syn: bool = False
    next: int = 0
    """The place of the byte that is delivered next."""
    kept: dict[int, Carried] = field(default_factory=dict)
    fins: dict[int, Carried] = field(default_factory=dict)
    acknowledged: int | None = None
    """The highest acknowledgement that the other direction sent."""
    had: Had = field(default_factory=Had)
    """What of that is to be believed."""
    ended: bool = False
    finished: bool = False
    """Whether it ended by its FIN."""
    delivered: dict[int, int] = field(default_factory=dict)
    """What was delivered since the last hole, by place."""
    told: int | None = None
    """What the segment acknowledged whose bytes were delivered last."""
    first_told: int | None = None
    """What the first one did."""
    latest: int = 0
    """The time of the last frame of those that brought what was delivered, its end too."""
    latest_place: Place = (-1, 0)

    def place(self, seq: int) -> int:
        """Return the place that a sequence number is meant for: the one nearest to the next."""
        assert self.begin is not None
        return self.next + distance(seq, self.begin + self.next)

    def others(self, segment: Segment, begin: int) -> int:
        """Return how many bytes of a segment, which lies at a place, differ from those that came before."""
        if segment.length == 1 and begin == self.sent - 1:
            return 0
        if begin >= self.next and not self.kept:  # nothing has come before
            return 0
        found = 0
        for place, byte in enumerate(segment.payload, begin):
            before = self.kept[place].byte if place in self.kept else None
            if self.next - 4096 <= place < self.next:
                before = self.delivered.get(place)
            found += before is not None and before != byte
        return found

    def be_acknowledged(self, segment: Segment) -> None:
        known = self.acknowledged
        if segment.flags & ACK and (known is None or distance(segment.ack, known) > 0):
            self.acknowledged = segment.ack

    @property
    def sent(self) -> int:
        """The place behind all that was sent so far."""
        return max([self.next, *(place + 1 for place in [*self.kept, *self.fins])])

    @property
    def sequence(self) -> int:
        """The sequence number of the byte that is delivered next."""
        assert self.begin is not None
        return (self.begin + self.next) % 2**32

    def is_elsewhere(self, segment: Segment) -> bool:
        """Tell whether a segment is not one of this direction, by where it is."""
        if self.begin is None or segment.flags & SYN:
            return False
        place = self.place(segment.seq)
        is_in_front = place < -NEAR and self.next <= FARTHEST
        return abs(place - self.next) > FARTHEST or is_in_front or (self.ended and place > self.next + NEAR)

    def came_at(self, place: Place, time: int) -> None:
        if place >= self.latest_place:
            self.latest_place, self.latest = place, time

    def first_kept(self) -> int | None:
        return min([*self.kept, *self.fins], default=None) if self.kept or self.fins else None


@dataclass(eq=False)
class Connection:
    """Two ends and what goes between them; ``directions`` by whether the client speaks."""

    client: End
    server: End
    directions: dict[bool, Direction] = field(default_factory=lambda: {True: Direction(), False: Direction()})
    aside: Aside | None = None

    @property
    def ended_ns(self) -> int | None:
        """When both directions had ended; None where they have not."""
        both = self.directions.values()
        return max(one.latest for one in both) if all(one.ended for one in both) else None


def begins_another(segment: Segment, connection: Connection, from_client: bool) -> bool:
    """Whether a segment of a known connection, in this direction, begins another in its place."""
    own = connection.directions[from_client]
    if segment.flags & RST or not segment.flags & SYN:
        return False
    both = connection.directions.values()
    if not segment.flags & ACK and all(one.ended and not one.next and not one.finished for one in both):
        return True
    if segment.flags & ACK and own.begin is None:
        return False
    if own.begin is None and not own.ended and own.had.up_to is not None:
        # the other end has answered it before
        return not 0 <= distance(own.had.up_to, segment.seq + 1) <= NEAR
    return own.begin != (segment.seq + 1) % 2**32
