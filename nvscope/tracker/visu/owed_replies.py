"""Owed replies: how many requests that are known around missing bytes have not been answered so far.

Nobody knows what is in a hole, but it is known which requests were there: those that waited in front of it, one for
each hole of the client, and those behind it. What answers nobody else answers the first of them. While some of them are
left, a client that asks for more does not wait for all of its replies. Of one that sends one request at a time, a hole
of its server has the replies to all of them; of one that was seen to send several at once, it has one.
"""

from __future__ import annotations

from msgspec import Struct, field

from nvscope.tracker.segments_aside import NEAR
from nvscope.tracker.visu.reach import UNKNOWN, Reach, distance, is_had, latest

_MOST_PASSED = 8
"""So many responses are remembered of which nobody knows what they answer."""


class OwedReplies(Struct):
    """Those of a connection.

    ``passed`` are responses that answered nobody, of which no request has shown that its client had them; ``later`` are
    those of them that were there when the last request was in step. ``holes`` is where those of the server end of which
    the same is true; ``counted`` is up to where its bytes have been counted.
    """

    count: int = 0
    passed: list[Reach] = field(default_factory=list)
    later: list[Reach] = field(default_factory=list)
    holes: list[int] = field(default_factory=list)
    counted: int = UNKNOWN

    def wait(self, count: int) -> None:
        """Take so many requests of which nobody knows what answers them."""
        self.count += count

    def pass_by(self, response: Reach) -> None:
        """Take a response that answers nobody, or something that is still to come."""
        self.passed = [*self.passed, response][-_MOST_PASSED:]

    def forget(self, behind: int) -> None:
        """Take that a response that ends there has answered something."""
        if self.passed:
            self.passed = [one for one in self.passed if one.behind != behind]

    def lose(self, behind: int) -> None:
        """Take that bytes of the server are missing up to there."""
        if self.counted == UNKNOWN or distance(behind, self.counted) > 0:
            self.holes = [*self.holes, behind][-_MOST_PASSED:]

    def settle(self, had: int) -> None:
        """Take that it is known what answers a request whose client had so much (``left``)."""
        self.later = self.passed
        self.count, self.passed, self.holes, self.counted = 0, [], [], had

    def may_have_answered(self, had: int) -> bool:
        """Tell whether a response that answered nobody may have answered a request whose client had so much."""
        return any(0 < distance(one.behind, had) <= NEAR for one in (*self.passed, *self.later))

    def show_several(self, had: int) -> bool:
        """Tell whether two responses that a client had answer what their server had got at once."""
        told = [one.acknowledged for one in self.passed if is_had(one.behind, had)]
        return len(set(told)) < len(told)

    def left(self, had: int, answered: int, *, one_each: bool) -> int:
        """Return how many are left when the client has so much, of which ``answered`` is known to answer others.

        ``one_each``: each hole has one reply, else those to all.
        """
        found = [one for one in self.passed if is_had(one.behind, had)]
        self.passed = [one for one in self.passed if not is_had(one.behind, had)]
        known = latest([answered, self.counted, *(one.behind for one in found)])
        # What the client has, and nobody has seen, is missing.
        holes = sum(is_had(end, had) for end in self.holes) or int(distance(had, known) > 0)
        if holes:
            self.count = self.count - holes if one_each else 0
        self.count = max(self.count - len(found), 0)
        self.holes = [end for end in self.holes if not is_had(end, had)]
        self.counted = latest([self.counted, had])
        return self.count

    def copy(self) -> OwedReplies:
        """Return another one that is as this one is."""
        return OwedReplies(self.count, [*self.passed], [*self.later], [*self.holes], self.counted)
