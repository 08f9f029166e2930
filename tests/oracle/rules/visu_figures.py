"""Figures of WebVisu: percentiles, and whether the capture lacks so much that they are no picture of the whole.

Readings, where the rules leave a choice:

- the same body is the same decoded bytes; a poll runs from the last read with this body, whatever came between
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tests.oracle.frame import Address
from tests.oracle.rules import visu_body
from tests.oracle.rules.timing import nearest_rank


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
