"""Turns: whether it is sure, behind bytes that were not captured, that all requests in front of one were answered.

A client takes turns: it sends a request, or several at once, waits until all of them are answered, and sends more. With
a request of a new turn, it acknowledges more of the server's bytes than with the one before. Behind missing bytes, the
first request of a new turn is in step again; in front of one of the same turn there may be others, which nobody saw,
and whose replies come first. Of a client that was seen to send more while replies were still to come, nobody knows. Of
one that was seen to send several at once, the first of a turn may be missing: so the next turn is.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.tracker.segments import HALF
from nvscope.tracker.visu.reach import UNKNOWN, Reach, distance, distances, latest, latest_of


class Turns(Struct):
    """Those of a connection.

    ``had`` is up to where the client had the server's bytes with its last request, ``answered`` where the last response
    ends that answered one, or where the server begins. ``pair`` is the same of the last request that was answered, and
    of the response. ``is_doubtful``: nobody knows which response comes next; ``overlap``: the client was seen not to
    take turns. ``asked`` is what the client had with its last request, ``several``: it was seen to send several at
    once; ``lost``: bytes of it are missing behind its last request.
    """

    had: int = UNKNOWN
    answered: int = UNKNOWN
    pair: tuple[int, int] = (UNKNOWN, UNKNOWN)
    is_doubtful: bool = False
    overlap: bool = False
    asked: int = UNKNOWN
    several: bool = False
    lost: bool = False

    def lose(self, *, of_client: bool = False) -> None:
        """Take that bytes are missing, and with them requests or replies, so many that nobody knows."""
        self.is_doubtful = True
        self.lost |= of_client

    def miss(self, had: int) -> None:
        """Take that the client had so much in front of what is missing of it."""
        self.had = latest([self.had, had])

    def ask(self, reach: Reach) -> bool:
        """Take a request; return whether the next response that comes is known to be its own, but for what waits."""
        had, lost, self.lost = reach.acknowledged, self.lost, False
        if had == UNKNOWN:
            self.is_doubtful = False
            return True
        self.several |= had == self.asked
        if self.is_doubtful:
            known = latest([self.had, self.answered])
            is_unsure = self.overlap or (lost and self.several)
            self.is_doubtful = known != UNKNOWN and (is_unsure or distance(had, known) <= 0)
        self.asked, self.had = had, latest([self.had, had])
        return not self.is_doubtful

    def answer(self, had: int, behind: int) -> None:
        """Take that a request was answered with which the client had so much, by a response that ends there."""
        before, end = self.pair
        self.overlap |= distance(had, before) > 0 and distance(end, had) > 0
        self.pair, self.answered = (had, behind), latest([self.answered, behind])

    def _overlaps(self, had: I64, behind: I64) -> bool:
        """Tell whether a client asked one of several before it had all of what answered the one before, but more."""
        before, end = np.empty_like(had), np.empty_like(behind)
        (before[0], end[0]), before[1:], end[1:] = self.pair, had[:-1], behind[:-1]
        ahead = end - had
        if int(ahead.max()) <= 0 and int(ahead.min()) >= -HALF:
            return False  # each had all of it, as nearly all have
        late = distances(end, had) > 0
        return bool(late.any() and (late & (distances(had, before) > 0)).any())

    def answer_all(self, had: I64, behind: I64, asked: I64) -> None:
        """Take that requests were answered in their order; ``asked`` is what the client had with each of those sent.

        None of them is in doubt.
        """
        if len(had):
            self.overlap = self.overlap or self._overlaps(had, behind)
            self.pair = int(had[-1]), int(behind[-1])
            self.answered = latest_of(self.answered, behind)
        known = asked[asked != UNKNOWN]
        if len(known):
            self.several = self.several or self.asked == known[0] or bool((known[1:] == known[:-1]).any())
            self.asked, self.lost = int(known[-1]), False
        self.had = latest_of(self.had, asked)
