"""Segments that were captured in front of what they acknowledge.

Readings, where the rules leave a choice:

- the same ends are known not to be captured in the order in which they spoke, from when on something comes that nobody
  had captured before (data, SYN or FIN), all of which the other end had acknowledged, as far as that is to be believed,
  up to 1 MiB further at most; or from when on something that waited, as below, has come
- there, a segment waits that acknowledges up to 1 MiB behind all that was sent so far in the other direction, and with
  it all that comes behind it between these ends. Once segments of the other direction are there that begin in front of
  what it acknowledges, and bring all of that, those come first, then it
- it is taken as it came where another segment comes more than 100 ms behind it, or 128 others wait
- what one acknowledges that is elsewhere, or of a direction that has ended, is nothing to wait for
- a SYN that is the first thing at all of who sends it to whom comes late, where the last segment of the other
  direction acknowledges what follows on it, or up to 1 MiB more. Behind the first such frame of a capture, no
  ends are known to be in order, and what acknowledges something of a direction that has not begun waits, too, where its
  own one has brought nothing but SYN: for segments of the other direction, in front of what it acknowledges, that
  follow on each other up to there
- events are those of the frame with which segments are taken; times are those of the segments
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from tests.oracle.rules.streams_aside import told
from tests.oracle.rules.streams_state import Connection, Direction, End
from tests.oracle.rules.streams_told import NEAR, distance
from tests.oracle.tcp import FIN, RST, SYN, Segment

LONGEST_NS, MOST_WAITING = 100_000_000, 128


class Captured(NamedTuple):
    """A segment, who sent it, and when it was captured, with which frame."""

    segment: Segment
    source: End
    time: int
    number: int


class Held:
    """What waits between which ends; ``disordered`` are those that are known not to be in order."""

    def __init__(self) -> None:
        self.disordered: dict[frozenset[End], tuple[int, int]] = {}
        """With the time and the frame in which that was seen."""
        self.newest = (0, 0)
        self.waiting: dict[frozenset[End], list[Captured]] = {}
        self.opened_late: int | None = None
        self.said: dict[tuple[End, End], int | None] = {}
        """What the last segment of each direction acknowledged of which anything was captured."""

    def note(self, captured: Captured, destination: End) -> None:
        """Note what is captured, whatever waits."""
        segment, source, time, number = captured
        self.newest = time, number
        if (source, destination) not in self.said:
            if segment.flags & RST or not taken(segment):
                return
            before = self.said.get((destination, source))
            late = before is not None and 0 <= distance(before, segment.seq + 1) <= NEAR
            if segment.flags & SYN and late and self.opened_late is None:
                self.opened_late = number
        self.said[source, destination] = told(segment)

    def note_disorder(self, pair: frozenset[End]) -> None:
        self.disordered.setdefault(pair, self.newest)

    def released(
        self, pair: frozenset[End], captured: Captured, connection: Callable[[], Connection | None]
    ) -> Iterator[Captured]:
        """Yield what is to be taken now that a segment has come; ``connection`` is asked anew each time."""
        waiting = self.waiting.setdefault(pair, [])
        waiting.append(captured)
        while waiting:
            first, known = waiting[0], connection()
            if self.is_early(known, pair, first):
                bringing = brought_by(known, first, waiting)
                if bringing:
                    self.note_disorder(pair)
                for one in bringing:
                    yield one
                    waiting[:] = [other for other in waiting if other is not one]
                late = captured.time - first.time > LONGEST_NS
                if not (bringing or late or len(waiting) > MOST_WAITING):
                    return
            waiting.pop(0)
            yield first

    def is_early(self, connection: Connection | None, pair: frozenset[End], captured: Captured) -> bool:
        segment = captured.segment
        behind = self.opened_late is not None and captured.number > self.opened_late
        if connection is None:
            return behind and told(segment) is not None and taken(segment) > 0 and not segment.flags & RST
        from_client = captured.source == connection.client
        own, other = connection.directions[from_client], connection.directions[not from_client]
        ack = told(segment)
        if ack is None:
            return False
        if other.begin is None and not other.ended:
            has_brought = own.begin is not None and own.next > 0
            return behind and not has_brought
        if not (pair in self.disordered or behind) or other.ended or own.is_elsewhere(segment):
            return False
        return 0 < distance(ack, (other.begin or 0) + other.sent) <= NEAR


def taken(segment: Segment) -> int:
    return bool(segment.flags & SYN) + segment.length + bool(segment.flags & FIN)


def is_behind_its_acknowledgement(own: Direction, segment: Segment) -> bool:
    """Tell whether a segment of a direction that has not ended brings something that was acknowledged before."""
    if own.had.up_to is None or not taken(segment):
        return False
    end = segment.seq + taken(segment)
    is_new = own.begin is None or own.place(segment.seq) + taken(segment) > own.sent
    return is_new and 0 <= distance(own.had.up_to, end) <= NEAR


def brought_by(connection: Connection | None, first: Captured, waiting: list[Captured]) -> list[Captured]:
    """Return those that bring all that the first one acknowledges, none where not all is there."""
    other = Direction() if connection is None else connection.directions[first.source != connection.client]
    ack = first.segment.ack
    found, there = [], set[int]()
    for one in waiting:
        begin = distance(one.segment.seq, ack)
        if one.source == first.source or not -NEAR <= begin < 0:
            continue
        found.append(one)
        there |= set(range(begin, min(begin + taken(one.segment), 0)))
        since = min(there, default=0) if other.begin is None else distance(other.begin + other.sent, ack)
        if there and there >= set(range(since, 0)):
            return found
    return []
