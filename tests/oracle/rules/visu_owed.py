"""How many requests of a connection are known to wait around missing bytes, though nobody knows what answers them.

Readings, where the rules leave a choice:

- where a direction loses step by missing bytes, those that waited count; each hole of the client behind one that was in
  step counts as one more, unless what it broke off had been answered; and so does each request that is in doubt
- a response that answers nobody counts one of them off, the first time that a request is in doubt whose client had it
- so do holes of the server, of those that the client had all, whether its segments show them or the client says so: if
  it was seen to send several requests at once, each counts off one, else all
- who was seen three times to wait for all replies to several, before it asked for more, is none of whom this counts
- no request is in step while some of them are left
- two responses that answer nobody, and acknowledge the same, show that their client sent several at once, and that what
  is missing of it may be several, too; so does a request behind missing bytes of the client, with no more of the
  server's than was known in front of them
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

OFTEN, MOST_PASSED, NEAR = 3, 8, 2**20


def ahead(one: int | None, other: int | None) -> int | None:
    """Return how far a sequence number is behind another one, None where nobody knows."""
    return None if one is None or other is None else (one - other + 2**31) % 2**32 - 2**31


def has(client: int | None, end: int | None) -> bool:
    """Tell whether a client that has so much has all up to an end."""
    distance = ahead(end, client)
    return distance is not None and distance <= 0


@dataclass
class Owed:
    """What is known to wait since nobody knows what answers it."""

    requests: int = 0
    passed: list[tuple[int | None, int | None]] = field(default_factory=list)
    """Where responses end that answered nobody, and what they acknowledge."""
    later: list[int | None] = field(default_factory=list)
    """Where those end that were not had when the last request was in step."""
    holes: list[int] = field(default_factory=list)
    """Where bytes of the server end that are missing."""
    counted: int | None = None
    """What the client had with the last request in doubt."""

    def pass_by(self, end: int | None, told: int | None) -> None:
        self.passed = [*self.passed, (end, told)][-MOST_PASSED:]

    def lose(self, end: int) -> None:
        if not has(self.counted, end):
            self.holes = [*self.holes, end][-MOST_PASSED:]

    def may_have_answered(self, client: int | None) -> bool:
        """Tell whether a response that answers nobody may have answered what was asked by a client that had so much."""
        return any(0 < (ahead(end, client) or 0) <= NEAR for end in (*(end for end, _ in self.passed), *self.later))

    def answered_at_once(self, client: int) -> bool:
        told = [told for end, told in self.passed if has(client, end)]
        return any(told.count(one) > 1 for one in told)

    def any_left(self, client: int, answered: int | None, *, hole_has_all: bool) -> bool:
        """Count off what a client had that asks for more; ``answered`` ends what is known to answer others."""
        seen = [end for end, _ in self.passed if has(client, end)]
        self.passed = [(end, told) for end, told in self.passed if not has(client, end)]
        unseen = [ahead(client, end) for end in (answered, self.counted, *seen)]
        known = [distance for distance in unseen if distance is not None]
        holes = sum(has(client, end) for end in self.holes)
        if not holes and known and min(known) > 0:
            holes = 1
        if holes:
            self.requests = 0 if hole_has_all else self.requests - holes
        self.requests = max(self.requests - len(seen), 0)
        self.holes = [end for end in self.holes if not has(client, end)]
        if self.counted is None or not has(self.counted, client):
            self.counted = client
        return self.requests > 0


def waited_for_several(answers: Sequence[tuple[int | None, int | None]]) -> int:
    """Return how often a client asked for more with exactly all that answered what it had asked for at once."""
    return sum(
        first is not None and first == second and had is not None and had == end
        for (first, _), (second, end), (had, _) in zip(answers, answers[1:], answers[2:], strict=False)
    )
