"""What became of the requests of web visualization pages, a row a client, server and port."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from msgspec import Struct, field

from dissectors import address
from dissectors.web_protocols import WebProtocol
from nvscope.tracker.latency import LatencyFigures
from nvscope.tracker.visu.pair_columns import PairColumns
from nvscope.tracker.visu.state import VisuCounts


class VisuSummary(Struct, frozen=True):
    """What one client asked one server for.

    ``reads``, ``writes`` and ``entries`` are of requests that were seen whole, ``replies`` are those to them, and
    ``latency`` is how long these took. ``refused`` are the writes that were not done. ``cut`` are requests and replies
    of which bytes are missing, ``gap_bytes`` all that are missing of their connections, ``other_bytes`` those that came
    again as other ones. ``polling`` is how long it is
    from one read to the next one of the same.
    """

    client: str
    server: str
    port: int
    connections: int
    reads: int
    writes: int
    entries: int
    variables: int
    replies: int
    refused: int
    unanswered: int
    cut: int
    gap_bytes: int
    miscounted: int
    ambiguous: int
    other_bytes: int
    latency: LatencyFigures = field(default_factory=LatencyFigures)
    polling: LatencyFigures = field(default_factory=LatencyFigures)


class OtherSpoken(Struct, frozen=True):
    """What one client said to one server in a protocol that is not WebVisu.

    ``count`` are requests, or, of what is no HTTP/1, connections; ``first_frame`` is that of the first one.
    """

    client: str
    server: str
    port: int
    protocol: WebProtocol
    count: int
    first_frame: int


def summarize_others(counts: VisuCounts) -> Sequence[OtherSpoken]:
    """Return what is spoken beside, sorted by addresses, ports and protocols."""
    found = []
    for (pair, protocol), spoken in counts.others.items():
        *ends, port = (int(word[pair]) for word in counts.pairs.words)
        client, server = (ends[0], ends[1]), (ends[2], ends[3])
        row = OtherSpoken(
            address.text(*client), address.text(*server), port, WebProtocol(protocol), spoken.times,
            spoken.first_frame,
        )  # fmt: skip
        found.append((address.order(*client), address.order(*server), port, protocol, row))
    return tuple(row for *_, row in sorted(found, key=lambda one: one[:4]))


def summarize_visu(counts: VisuCounts) -> Sequence[VisuSummary]:
    """Return all pairs with requests, sorted by their addresses and ports."""
    every = np.arange(len(counts.pairs))
    latencies, pollings = counts.latencies.figures(every), counts.pollings.figures(every)
    words = zip(*(word.tolist() for word in counts.pairs.words), strict=True)
    columns = zip(*(counts.columns.column(name).tolist() for name in PairColumns.COLUMNS), strict=True)
    found = []
    since = Counter(one.pair for one in counts.leaving.given_up())
    for pair, ((client_hi, client_lo, server_hi, server_lo, port), row) in enumerate(zip(words, columns, strict=True)):
        counted = dict(zip(PairColumns.COLUMNS, row, strict=True))
        if not (counted["connections"] or counted["other_bytes"]):
            continue
        counted["unanswered"] += since[pair]
        ends = (client_hi, client_lo), (server_hi, server_lo)
        told = VisuSummary(
            client=address.text(*ends[0]), server=address.text(*ends[1]), port=port,
            latency=latencies.get(pair, LatencyFigures()), polling=pollings.get(pair, LatencyFigures()), **counted,
        )  # fmt: skip
        found.append((address.order(*ends[0]), address.order(*ends[1]), port, told))
    return tuple(told for *_, told in sorted(found, key=lambda one: one[:3]))
