"""Figures of WebVisu: percentiles, and whether the capture lacks so much that they are no picture of the whole.

Readings, where the rules leave a choice:

- the same body is the same decoded bytes; a poll runs from the last read with this body, whatever came between
- of who asks a page something or replies, all ends between which something came in disorder are told (NV810), whether
  they are those of a page or not
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tests.oracle.frame import Address
from tests.oracle.rules import visu_body
from tests.oracle.rules.timing import nearest_rank

if TYPE_CHECKING:
    from tests.oracle.rules.streams import Streams


FRAMES_KEPT = 10


@dataclass
class Row:
    """What became of the requests of one pair."""

    counts: Counter[str] = field(default_factory=Counter)
    variables: set[visu_body.Address] = field(default_factory=set)
    latencies: list[int] = field(default_factory=list)
    pollings: list[int] = field(default_factory=list)
    last_reads: dict[bytes, int] = field(default_factory=dict)


def percentiles(ordered: list[int]) -> dict[str, int | None]:
    return {f"p{percent}": nearest_rank(ordered, percent) if ordered else None for percent in (50, 99)}


def lacks_many(known: Mapping[Any, Any], client: Address, variable: str) -> bool:
    """Tell whether one of ten requests and replies lacks bytes, or more, on all ports together.

    ``known`` are rows by client, server and port, ``variable`` is what findings of all of a server are about.
    """
    counts: Counter[str] = Counter()
    for (asks, server, _), row in known.items():
        if asks == client and variable == f"visu/{server}":
            counts += row.counts
    return 10 * counts["lacks bytes"] >= sum(counts[name] for name in ("reads", "writes", "replies", "cut"))


def disordered(known: Mapping[Any, Any], streams: Streams) -> dict[Any, list[tuple[int, int]]]:
    """Return when, and in which frames, ends showed that they were captured in disorder, as events of findings."""
    said: Counter[Any] = Counter()
    for (client, server, _), row in known.items():
        said[client, server] += sum(row.counts[name] for name in ("reads", "writes", "replies", "cut"))
    found: dict[Any, list[tuple[int, int]]] = {}
    for pair, event in streams.held.disordered.items():
        server = streams.servers[pair]
        (client,) = pair - {server}
        if said[client[0], server[0]]:
            found.setdefault(("NV810", client[0], f"visu/{server[0]}"), []).append(event)
    return found


def findings_of(events: Mapping[Any, list[tuple[int, int]]], known: Mapping[Any, Any]) -> list[dict[str, Any]]:
    """Return findings by their events, sorted by code, client and variable; ``known`` as in ``lacks_many``."""
    return [
        {
            "code": code, "client": client, "variable": variable, "count": len(own), "first_ns": own[0][0],
            "last_ns": own[-1][0], "frames": sorted(frame for _, frame in own[:FRAMES_KEPT]),
        }
        for (code, client, variable), own in sorted(
            ((code, str(client), variable), own) for (code, client, variable), own in events.items()
            if code != "NV808" or lacks_many(known, client, variable)
        )
    ]  # fmt: skip
