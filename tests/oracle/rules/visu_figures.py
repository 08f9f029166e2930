"""Figures of WebVisu: percentiles, and whether the capture lacks so much that they are no picture of the whole."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from tests.oracle.frame import Address
from tests.oracle.rules.timing import nearest_rank


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
    return 10 * counts["cut"] >= sum(counts[name] for name in ("reads", "writes", "replies", "cut"))
