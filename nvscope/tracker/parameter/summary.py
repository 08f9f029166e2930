"""What became of the requests of the Parameter Manager, a row a requester, partner and port."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from msgspec import Struct, field

from dissectors import address
from dissectors.netvar import PARAMETER_ERRORS
from nvscope.tracker.latency import LatencyFigures
from nvscope.tracker.parameter.transactions import Transactions


class PairSummary(Struct, frozen=True):
    """What became of the requests of one node to another one.

    ``requests`` are those that were opened, without those that repeat one; ``replies`` ended them, ``errors`` are those
    among these that refused, by the name of their service. ``undeliverable`` are the ICMP messages that say of requests
    that they went nowhere, ``copies`` requests and replies that the capture has once more: they count nowhere else.
    ``latency`` is from the first request to its reply.
    """

    requester: str
    partner: str
    port: int
    requests: int
    replies: int
    errors: Mapping[str, int]
    busy: int
    timeouts: int
    retransmissions: int
    unexpected: int
    undeliverable: int
    copies: int
    latency: LatencyFigures = field(default_factory=LatencyFigures)


def summarize_parameters(known: Transactions) -> Sequence[PairSummary]:
    """Return all pairs that spoke of parameters, sorted by their addresses and ports."""
    if not len(known.pairs):
        return ()
    requester_hi, requester_lo, partner_hi, partner_lo, port = (word.tolist() for word in known.pairs.words)
    columns = known.columns
    figures = known.latencies.figures(np.arange(len(known.pairs)))
    found = []
    for pair in range(len(known.pairs)):
        ends = (requester_hi[pair], requester_lo[pair]), (partner_hi[pair], partner_lo[pair])
        errors = zip(PARAMETER_ERRORS, columns.errors[pair].tolist(), strict=True)
        row = PairSummary(
            address.text(*ends[0]), address.text(*ends[1]), int(port[pair]), int(columns.requests[pair]),
            int(columns.replies[pair]), MappingProxyType({service.name: count for service, count in errors if count}),
            int(columns.busy[pair]), int(columns.timeouts[pair]), int(columns.retransmissions[pair]),
            int(columns.unexpected[pair]), int(columns.undeliverable[pair]), int(columns.copies[pair]),
            figures.get(pair, LatencyFigures()),
        )  # fmt: skip
        found.append((address.order(*ends[0]), address.order(*ends[1]), int(port[pair]), row))
    return tuple(row for *_, row in sorted(found, key=lambda one: one[:3]))
