"""The Parameter Manager as data: what ``nvscope.report/2`` says of who asked whom."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nvscope.tracker.parameter.summary import PairSummary


def sdo_rows(pairs: Sequence[PairSummary]) -> list[dict[str, Any]]:
    """Return a row a requester, partner and port, by their addresses."""
    return [
        {
            "requester": one.requester,
            "partner": one.partner,
            "port": one.port,
            "requests": one.requests,
            "replies": one.replies,
            "errors": dict(one.errors),
            "busy": one.busy,
            "timeouts": one.timeouts,
            "retransmissions": one.retransmissions,
            "unexpected": one.unexpected,
            "latency_ns": {
                "count": one.latency.count,
                "p50": one.latency.p50,
                "p99": one.latency.p99,
                "max": one.latency.maximum,
            },
        }
        for one in pairs
    ]
