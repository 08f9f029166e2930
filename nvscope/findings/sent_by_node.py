"""What each node sent: telegrams of lists, and requests of the Parameter Manager."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nvscope.engine.keys import NOBODY, FrameKind

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts

_OF_LISTS = (FrameKind.DATA, FrameKind.ACKNOWLEDGEMENT, FrameKind.BOOT_UP_REQUEST)


class SentByNode(NamedTuple):
    """Well-formed telegrams of lists, of which some were ``broadcast``, and requests of the Parameter Manager.

    Times and frame are those of the telegrams, None without any.
    """

    telegrams: int = 0
    broadcast: int = 0
    requests: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    frame: int | None = None


def sent_by_node(facts: Facts) -> dict[int, SentByNode]:
    """Return what each node sent that sent any, by number, rising."""
    flows = facts.state.lists.flows
    rows = np.flatnonzero(np.isin(flows.column("kind"), _OF_LISTS) & (flows.column("count") > 0))
    names = ("source", "count", "destination", "first_ns", "last_ns", "first_frame")
    found: dict[int, SentByNode] = defaultdict(SentByNode)
    for node, number, to, first_ns, last_ns, frame in zip(
        *(flows.column(name)[rows].tolist() for name in names), strict=True
    ):
        known = found[node]
        found[node] = SentByNode(
            known.telegrams + number, known.broadcast + (number if to == NOBODY else 0), 0,
            first_ns if known.first_ns is None else min(known.first_ns, first_ns),
            last_ns if known.last_ns is None else max(known.last_ns, last_ns),
            frame if known.frame is None else min(known.frame, frame),
        )  # fmt: skip
    for pair in facts.summary.parameters:
        node = facts.node_numbers.get(pair.requester)
        if pair.requests and node is not None:
            found[node] = found[node]._replace(requests=found[node].requests + pair.requests)
    return dict(sorted(found.items()))


def receivers(facts: Facts) -> set[int]:
    """Return the nodes to which data of lists is sent, and those that read any."""
    flows = facts.state.lists.flows
    to = flows.column("destination")[flows.column("kind") == FrameKind.DATA]
    return {*to[to >= 0].tolist(), *(node for entry in facts.summary.lists for node in entry.readers)}
