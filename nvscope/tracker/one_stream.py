"""OneStream: one direction of a connection, of which segments are put in order one after the other."""

from __future__ import annotations

from heapq import heappop

from msgspec import Struct, field

from dissectors.headers import ACK, FIN, RST, SYN
from nvscope.tracker.kept_segments import Kept
from nvscope.tracker.segments import FAR, HALF, WRAP
from nvscope.tracker.segments_aside import NEAR, is_in_front

PATIENCE_NS = 10 * 10**9


class OneStream(Struct):
    """One direction of a connection (``StreamColumns``).

    ``at`` is how far it is, counted from where it was when it was made.
    """

    number: int
    begun: bool = False
    ended: bool = False
    disordered: bool = False
    next: int = 0
    first: int = -1
    acknowledged: int = -1
    had: int = -1
    ahead: int = -1
    told: int = -1
    latest_ns: int = 0
    # The place (``pieces``) that this is the time of, -1 for one in front of all that are to come.
    latest_place: int = -1
    at: int = 0
    kept: list[Kept] = field(default_factory=list)
    kept_bytes: int = 0
    # What is kept by place, and what was passed on since and has not come to the front.
    by_place: list[tuple[int, int, Kept]] = field(default_factory=list)

    def forget(self) -> None:
        """Become a stream that has not begun."""
        self.begun = self.ended = False
        self.first = self.acknowledged = self.had = self.ahead = self.told = -1
        self.latest_ns, self.latest_place = 0, -1

    def came_at(self, place: int, time_ns: int) -> None:
        """Note that something of the stream came at a place; what waited behind a hole came before what filled it."""
        if place >= self.latest_place:
            self.latest_place, self.latest_ns = place, time_ns

    def begin(self, sequence: int, size: int, told: int) -> None:
        """Begin with a segment, the first ``size`` places of which are no data."""
        self.begun, self.next, self.told = True, sequence, told
        self.first = (sequence + size) % WRAP
        if self.had >= 0 and abs(self.distance(self.had)) > FAR:
            self.had = -1

    def distance(self, sequence: int) -> int:
        """Return how far a sequence number is from where the stream is."""
        return (sequence - self.next + HALF) % WRAP - HALF

    @property
    def sent(self) -> int:
        """How far it is, with what is kept."""
        return self.kept[-1].end if self.kept else self.at

    def is_elsewhere(self, sequence: int) -> bool:
        """Tell whether what has such a sequence number is not of this stream, which has begun.

        Where nothing came of it before its connection was reset, nobody knows.
        """
        if self.first < 0:
            return False
        away = self.distance(sequence)
        is_beyond = abs(away) > FAR or (self.ended and away > NEAR)
        return is_beyond or is_in_front(sequence, self.first, self.next, FAR)

    @property
    def is_nothing(self) -> bool:
        """Whether it was reset before anything came."""
        return self.ended and (self.first < 0 or self.next == self.first)

    @property
    def hole_is_acknowledged(self) -> bool:
        """Whether the receiver has what is missing in front of what is kept."""
        return self.had >= 0 and self.distance(self.had) >= self.kept[0].begin - self.at

    def waits_longer_than(self, time_ns: int) -> bool:
        """Whether the first of what is kept came so long before a time."""
        while self.by_place[0][2].is_passed:
            heappop(self.by_place)
        return time_ns - self.by_place[0][2].time_ns > PATIENCE_NS

    def note_acknowledged(self, acknowledgement: int, flags: int) -> None:
        """Note what a segment of the other stream with such flags acknowledges."""
        if flags & ACK and (self.acknowledged < 0 or ahead_of(acknowledgement, self.acknowledged) > 0):
            self.acknowledged = acknowledgement

    def note_had(self, other: OneStream, sequence: int, flags: int, payload_bytes: int, told: int) -> None:
        """Note up to where its speaker has the other stream, by a segment of it that tells so, unless that is -1.

        One that is not where this stream is, or far from where the other one is, may be of another connection, or
        garbage: it says nothing.
        """
        is_new = False
        if not flags & RST and (payload_bytes or flags & (SYN | FIN)):
            if self.begun:
                if not flags & SYN and self.is_elsewhere(sequence):
                    return
                size = payload_bytes + (flags & SYN) // SYN + (flags & FIN)
                away = self.distance(sequence)
                is_new = not self.ended and abs(away) <= FAR and away + size > self.sent - self.at
                is_new = is_new and not self._is_ahead_of(sequence + size)
        elif self.first < 0:
            if not self._is_ahead_of(sequence):
                self.ahead = sequence
        else:
            away, sent = self.distance(sequence), self.sent - self.at
            if not -NEAR <= away <= sent + NEAR:
                return
            if away > sent and not self._is_ahead_of(sequence):
                self.ahead = sequence
        is_told = told >= 0 and (other.first < 0 or abs(other.distance(told)) <= FAR)
        if is_told and (is_new or other.had < 0 or ahead_of(told, other.had) > 0):
            other.had = told

    def _is_ahead_of(self, sequence: int) -> bool:
        """Tell whether what brought nothing shows that the stream was up to there before, at least."""
        return self.ahead >= 0 and (self.ahead - sequence) % WRAP <= NEAR


def ahead_of(sequence: int, known: int) -> int:
    """Return how far a sequence number is ahead of another one."""
    return (sequence - known + HALF) % WRAP - HALF
