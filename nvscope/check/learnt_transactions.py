"""Rules about requests that captures taught: how fast replies are, and how many requests come to nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from msgspec import Struct

from nvscope.check.deciding import Decided
from nvscope.check.learnt_limits import THIN, how_sure, share_with_room, time_with_room
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.who_asks import SDO, VISU
from nvscope.duration import format_duration
from nvscope.tracker.summary import Summary
from nvscope.units import count_of, duration

SLOWEST, ERRORS = "slowest reply", "errors"
"""The ids of the rules that nothing breaks, by which worst values are known."""

_ROOM = 3
_NANOSECONDS = 10**9


def loosest_transactions() -> Iterator[dict[str, Any]]:
    """Yield rules that nothing breaks."""
    yield {"id": SLOWEST, "check": "transaction", "max_latency": "366d", "percentile": 100}
    yield {"id": ERRORS, "check": "transaction", "max_errors": "100%"}


class LearntPair(Struct):
    """What was seen of the requests of a node to another one, on all ports."""

    protocol: str
    client: str
    server: str
    slowest_s: float | None = None
    bad: int = 0
    requests: int = 0

    @property
    def id(self) -> str:
        """What a rule about it is called."""
        return f"{self.protocol}-{self.client}-{self.server}"

    @property
    def is_thin(self) -> bool:
        """Whether too little was seen to break a build by it."""
        return self.requests < THIN

    @property
    def keys(self) -> dict[str, str | int]:
        """The keys of a rule about it."""
        keys: dict[str, str | int] = {"protocol": self.protocol, "requester": self.client, "partner": self.server}
        if self.slowest_s is not None:
            most_ns = time_with_room(round(self.slowest_s * _NANOSECONDS), _ROOM)
            keys |= {"max_latency": format_duration(most_ns), "percentile": 100}
        share = share_with_room(self.bad, self.requests) if self.bad else 0
        return {**keys, "max_errors": f"{share:g}%"}

    @property
    def told(self) -> str:
        """What was seen, and how sure that makes it."""
        slowest = "" if self.slowest_s is None else f"slowest: {duration(round(self.slowest_s * _NANOSECONDS))}; "
        if self.bad:
            return f"{slowest}{self.bad} of {count_of(self.requests, 'request')} were refused or unanswered"
        return f"{slowest}refused or unanswered: {how_sure(self.requests, 'request')}"


def learnt_pairs(decided: Mapping[str, Decided], summary: Summary) -> list[LearntPair]:
    """Return what was seen of all pairs of which somebody knows what came of their requests, as they were judged."""
    asked = _asked(summary)
    found: dict[tuple[str, str, str], LearntPair] = {}
    for rule in (SLOWEST, ERRORS):
        for one in decided[rule].subjects:
            if one.verdict is Verdict.PASS and one.protocol and one.node and one.partner:
                key = one.protocol, one.node, one.partner
                _learn(found.setdefault(key, LearntPair(*key)), one, asked)
    return [one for one in found.values() if one.requests]


def _asked(summary: Summary) -> Mapping[tuple[str, str, str, int], int]:
    """Return how many requests there were by protocol, who asked whom, and port."""
    found = {(SDO, one.requester, one.partner, one.port): one.requests for one in summary.parameters}
    for one in summary.others.get(VISU, ()):
        found[VISU, one.client, one.server, one.port] = one.reads + one.writes
    return found


def _learn(pair: LearntPair, judged: Judged, asked: Mapping[tuple[str, str, str, int], int]) -> None:
    assert judged.worst is not None
    assert judged.port is not None
    if judged.unit == "s":
        pair.slowest_s = max(judged.worst, pair.slowest_s or 0.0)
        return
    pair.bad += judged.count
    # What had no reply when the capture ended is none of those that are judged.
    of_all = asked.get((pair.protocol, pair.client, pair.server, judged.port), 0)
    pair.requests += round(judged.count / judged.worst) if judged.worst else of_all
