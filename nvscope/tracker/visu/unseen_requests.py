"""Unseen requests: those of which no more is known than that bytes of their client are missing, and what answers them.

A hole in what the client sends may have a request in it, or most of one. A response that is parted as those of pages
are, while no request waits, and with which its server has bytes of the hole, is the reply to such a one.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from msgspec import Struct

from nvscope.tracker.visu.reach import UNKNOWN, distance


class Answered(NamedTuple):
    """A response while no request waits: whether it is one of a page, and how far its server had the client's bytes."""

    is_reply: bool
    acknowledged: int


class UnseenRequests(Struct):
    """Those of one connection: where the last hole lies, and whether what it hides may still be answered."""

    begin: int = UNKNOWN
    behind: int = UNKNOWN
    waits: bool = False

    def miss(self, behind: int, size: int) -> None:
        """Take that so many bytes of the client are missing in front of a sequence number, ``UNKNOWN`` where it is."""
        self.behind = behind
        self.begin = UNKNOWN if behind == UNKNOWN else behind - size

    def lose(self, early: Iterable[Answered]) -> int:
        """Take that nobody knows what lies around the hole; return how many requests in it were answered before."""
        found = sum(
            one.is_reply
            and distance(one.acknowledged, self.begin) > 0
            and UNKNOWN not in (one.acknowledged, self.behind)
            and distance(one.acknowledged, self.behind) <= 0
            for one in early
        )
        self.waits = not found
        return found

    def take(self, one: Answered) -> bool:
        """Tell whether a response answers what the hole hides."""
        is_answer = self.waits and one.is_reply and distance(one.acknowledged, self.begin) > 0
        self.waits = self.waits and not is_answer
        return is_answer
