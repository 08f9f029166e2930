"""Segments held back: those that were captured in front of what they acknowledge, until that is there.

Two interfaces of which each sees one direction, queues of a card, or captures merged by clocks that differ, show an
answer in front of what it answers. Only connections that have shown that are treated so, and all behind one that was
opened behind what answers that (``nvscope.tracker.handshakes``): in others, whatever is acknowledged and not there is
missing, and nothing waits for it. In them, a segment that acknowledges more than was sent so far waits, and what comes
behind it in its connection with it, until segments of the other direction bring all of that: these come first. What one
direction begins with waits for the other one, too. What waits is bounded in number and in time; then it is taken as it
came.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dissectors.batch import U8
from dissectors.headers import RST, SYN
from nvscope.tracker.one_stream import OneStream, ahead_of
from nvscope.tracker.segments import Captured
from nvscope.tracker.segments_aside import NEAR

PATIENCE_NS = 10**8
MOST_HELD = 1 << 7
"""So many of a connection."""

MOST_HELD_BYTES = 1 << 24
"""So much of all connections together: what comes when there is more is taken as it comes."""


def is_early(ends: tuple[OneStream, OneStream], segment: Captured, opened_late: int) -> bool:
    """Tell whether a segment acknowledges something of the other direction behind all that was sent there so far.

    ``opened_late`` is the frame with which a connection was opened behind what answers that.
    """
    own, other = ends[segment.side], ends[1 - segment.side]
    if segment.told < 0:
        return False
    if not other.begun:
        if not own.begun and (segment.flags & RST or not segment.size):
            return False  # with which no connection begins
        return segment.frame > opened_late and (not own.begun or own.next == own.first)
    if not (own.disordered or segment.frame > opened_late) or other.ended:
        return False
    if own.begun and not segment.flags & SYN and own.is_elsewhere(segment.sequence):
        return False
    return 0 < ahead_of(segment.told, other.next + other.sent - other.at) <= NEAR


def is_behind_its_acknowledgement(own: OneStream, segment: Captured) -> bool:
    """Tell whether all that a segment brings, and some of it for the first time, was acknowledged before."""
    if segment.flags & RST or not segment.size or own.had < 0 or own.ended:
        return False
    end = segment.sequence + segment.size
    is_new = not own.begun or own.distance(end) > own.sent - own.at
    return is_new and 0 <= ahead_of(own.had, end) <= NEAR


class HeldBack:
    """Those of all connections, by the number of each."""

    def __init__(self) -> None:
        self._of: dict[int, list[Captured]] = {}
        self._bytes = 0

    def __contains__(self, connection: int) -> bool:
        return connection in self._of

    def clear(self) -> None:
        """Take none of them any more."""
        self._of.clear()
        self._bytes = 0

    def keep(self, numbers: Mapping[int, int]) -> None:
        """Forget those of all connections but some, which are numbered anew; ``numbers`` are of streams."""
        self._of = {numbers[2 * one] >> 1: held for one, held in self._of.items() if 2 * one in numbers}
        self._bytes = sum(one.room_bytes for held in self._of.values() for one in held)

    def hold_data(self, connection: int, data: U8) -> None:
        """Hold the data of a connection, which lies in the buffer of a batch."""
        if held := self._of.get(connection):
            held[:] = [segment.with_data(data) for segment in held]

    def released(
        self, connection: int, ends: tuple[OneStream, OneStream], segment: Captured, opened_late: int
    ) -> Iterator[Captured]:  # fmt: skip
        """Yield what is to be taken now that a segment has come, in order; ``ends`` are looked at in between."""
        held = self._of.setdefault(connection, [])
        held.append(segment)
        self._bytes += segment.room_bytes
        while held:
            first = held[0]
            if is_early(ends, first, opened_late):
                bringing = _bringing(held, ends[1 - first.side])
                if bringing:
                    ends[0].disordered = ends[1].disordered = True
                for place in bringing:
                    yield held[place]
                for place in reversed(bringing):
                    self._bytes -= held.pop(place).room_bytes
                is_late = segment.time_ns - first.time_ns > PATIENCE_NS or len(held) > MOST_HELD
                if not (bringing or is_late or self._bytes > MOST_HELD_BYTES):
                    return
            self._bytes -= held.pop(0).room_bytes
            yield first
        del self._of[connection]


def _bringing(held: list[Captured], other: OneStream) -> list[int]:
    """Return which ones of those behind the first bring all that it acknowledges, none where not all is there."""
    first, places, ends = held[0], list[int](), list[tuple[int, int]]()
    sent = ahead_of(other.next + other.sent - other.at, first.told) if other.begun else 0
    for place, one in enumerate(held):
        begin = ahead_of(one.sequence, first.told)
        if one.side == first.side or not -NEAR <= begin < 0:
            continue
        places.append(place)
        ends.append((begin, begin + one.size))
        reach = sent if other.begun else min(ends)[0]
        for start, end in sorted(ends):
            if start > reach:
                break
            reach = max(reach, end)
        if reach >= 0:
            return places
    return []
