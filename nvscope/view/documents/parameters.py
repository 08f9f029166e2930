"""The Parameter Manager as data: what ``nvscope.report/2`` says of who asked whom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from nvscope.tracker.parameter.summary import PairSummary


def sdo_rows(
    pairs: Sequence[PairSummary], node_names: Mapping[str, str] = MappingProxyType({})
) -> list[dict[str, Any]]:  # fmt: skip
    """Return a row a requester, partner and port, by their addresses; ``node_names`` are what people call these."""
    return [
        {
            "requester": one.requester,
            "requester_name": node_names.get(one.requester),
            "partner": one.partner,
            "partner_name": node_names.get(one.partner),
            "port": one.port,
            "requests": one.requests,
            "replies": one.replies,
            "errors": dict(one.errors),
            "busy": one.busy,
            "timeouts": one.timeouts,
            "retransmissions": one.retransmissions,
            "unexpected": one.unexpected,
            "undeliverable": one.undeliverable,
            "copies": one.copies,
            "latency_ns": {
                "count": one.latency.count,
                "p50": one.latency.p50,
                "p99": one.latency.p99,
                "max": one.latency.maximum,
            },
        }
        for one in pairs
    ]
