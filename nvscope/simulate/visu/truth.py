"""The truth about pages: what was put in, in the words of a report."""

from __future__ import annotations

import ipaddress
from collections import Counter
from typing import Any

from dissectors.webvisu import Place
from nvscope.simulate.frames import IPAddress, address_order
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.visu.talk import talk_of

COUNTS = (
    "connections", "reads", "writes", "entries", "replies", "refused", "unanswered", "cut", "gap_bytes", "miscounted",
)  # fmt: skip

_Pair = tuple[IPAddress, IPAddress, int]


def visu_truth(scenario: Scenario) -> list[dict[str, Any]]:
    """Return a row a client, server and port, by their addresses, with those of ``visu`` in a report that are known."""
    counts: dict[_Pair, Counter[str]] = {}
    variables: dict[_Pair, set[Place]] = {}
    for position, page in enumerate(scenario.page):
        found = talk_of(scenario, position).counts
        if not found["connections"]:
            continue
        client, server = (
            ipaddress.ip_address(scenario.node[scenario.node_numbers[name]].address) for name in (page.node, page.to)
        )
        pair = client, server, page.port
        counts.setdefault(pair, Counter()).update(found)
        variables.setdefault(pair, set()).update(page.variables.values())
    return [
        {
            "client": str(pair[0]),
            "server": str(pair[1]),
            "port": pair[2],
            **{name: counts[pair][name] for name in COUNTS},
            "variables": len(variables[pair]),
        }
        for pair in sorted(counts, key=lambda pair: (address_order(pair[0]), address_order(pair[1]), pair[2]))
    ]
