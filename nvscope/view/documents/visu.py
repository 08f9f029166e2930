"""Web visualization as data: what ``nvscope.report/2`` says of which client asked which server for variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from nvscope.tracker.visu.summary import OtherSpoken, VisuSummary
from nvscope.tracker.visu.unchanging import NeverChanged

MOST_NAMED = 10
"""So many variables of a kind are named."""


def visu_other_rows(
    spoken: Sequence[OtherSpoken], node_names: Mapping[str, str] = MappingProxyType({})
) -> list[dict[str, Any]]:  # fmt: skip
    """Return a row for what is spoken beside WebVisu by each client, server, port and protocol."""
    return [
        {
            **_ends(one, node_names),
            "protocol": one.protocol.name.lower().replace("_", "-"),
            "count": one.count,
            "first_frame": one.first_frame,
        }
        for one in spoken
    ]


def visu_rows(
    pairs: Sequence[VisuSummary], node_names: Mapping[str, str] = MappingProxyType({})
) -> list[dict[str, Any]]:  # fmt: skip
    """Return a row a client, server and port, by their addresses; ``node_names`` are what people call these."""
    return [
        {
            **_ends(one, node_names),
            "connections": one.connections,
            "reads": one.reads,
            "writes": one.writes,
            "entries": one.entries,
            "variables": one.variables,
            "replies": one.replies,
            "refused": one.refused,
            "unanswered": one.unanswered,
            "cut": one.cut,
            "gap_bytes": one.gap_bytes,
            "miscounted": one.miscounted,
            "ambiguous": one.ambiguous,
            "other_bytes": one.other_bytes,
            "latency_ns": {
                "count": one.latency.count,
                "p50": one.latency.p50,
                "p99": one.latency.p99,
                "max": one.latency.maximum,
            },
            "polling_ns": {"p50": one.polling.p50, "p99": one.polling.p99},
        }
        for one in pairs
    ]


def unchanging_rows(
    found: Sequence[NeverChanged], node_names: Mapping[str, str] = MappingProxyType({})
) -> list[dict[str, Any]]:  # fmt: skip
    """Return a row a controller: which variables pages asked for that never changed, or could never be read."""
    return [
        {
            "server": one.server,
            "server_name": node_names.get(one.server),
            "variables": one.variables,
            "unchanged": list(one.unchanged[:MOST_NAMED]),
            "unchanged_cut": max(len(one.unchanged) - MOST_NAMED, 0),
            "unreadable": list(one.unreadable[:MOST_NAMED]),
            "unreadable_cut": max(len(one.unreadable) - MOST_NAMED, 0),
        }
        for one in found
    ]


def _ends(one: OtherSpoken | VisuSummary, node_names: Mapping[str, str]) -> dict[str, Any]:
    return {
        "client": one.client,
        "client_name": node_names.get(one.client),
        "server": one.server,
        "server_name": node_names.get(one.server),
        "port": one.port,
    }
