"""What a segment tells of the other direction: up to where its speaker has that, as far as it is to be believed.

Readings, where the rules leave a choice:

- a segment says nothing that is elsewhere, or brings nothing 1 MiB or more away from all that was sent so far: it may
  be of another connection. Nor does one count that acknowledges what is farther than 2^30 away
- data or FIN behind all that was sent so far was sent later than all that came before. What it acknowledges counts in
  place of that: whoever acknowledges less than before has never had more
- a segment that brings nothing shows how far its direction was sent, too: data in front of that may be older. What a
  direction begins with is later than nothing
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tests.oracle.rules.streams_aside import told
from tests.oracle.tcp import FIN, RST, SYN, Segment

if TYPE_CHECKING:
    from tests.oracle.rules.streams import Direction

FARTHEST, NEAR = 2**30, 2**20


def distance(a: int, b: int) -> int:
    """Return how far sequence number ``a`` is behind ``b``, from −2^31 to 2^31 − 1."""
    return (a - b + 2**31) % 2**32 - 2**31


@dataclass
class Had:
    """Of one direction: ``up_to`` is the sequence number up to which the other end has it, None where nobody said so.

    ``bare`` is the furthest one at which a segment without anything was sent, behind what had come by then.
    """

    up_to: int | None = None
    bare: int | None = None

    def begin(self, seq: int) -> None:
        """Take that the direction begins; what was acknowledged far away was of another connection."""
        if self.up_to is not None and abs(distance(self.up_to, seq)) > FARTHEST:
            self.up_to = None

    def is_bare_behind(self, seq: int) -> bool:
        return self.bare is not None and (self.bare - seq) % 2**32 <= NEAR


def hear(own: Direction, other: Direction, segment: Segment) -> None:
    """Take what a segment of ``own`` tells of the other direction."""
    taken = bool(segment.flags & SYN) + segment.length + bool(segment.flags & FIN)
    place = None if own.begin is None else own.place(segment.seq)
    is_later = False
    if taken and not segment.flags & RST:
        if own.is_elsewhere(segment):
            return
        if place is not None and not own.ended and abs(place - own.next) <= FARTHEST:
            is_later = place + taken > own.sent and not own.had.is_bare_behind(segment.seq + taken)
    else:
        if place is not None and not own.next - NEAR <= place <= own.sent + NEAR:
            return
        if (place is None or place > own.sent) and not own.had.is_bare_behind(segment.seq):
            own.had.bare = segment.seq
    ack = told(segment)
    if ack is not None and other.begin is not None and abs(distance(ack, other.sequence)) > FARTHEST:
        return
    if ack is not None and (is_later or other.had.up_to is None or distance(ack, other.had.up_to) > 0):
        other.had.up_to = ack
