"""Scopes in force: what the Counter of each sender counts, as far as its telegrams have shown."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

from nvscope.engine.keys import NOBODY_KEY
from nvscope.tracker.counters import Scope

if TYPE_CHECKING:
    from nvscope.tracker.state import TrackerState


def scopes_in_force(state: TrackerState) -> dict[int, Scope]:
    """Return, by node with streams, the scope in which most steps of its Counter are regular."""
    keys, loss = state.keys, state.senders.loss
    places, nodes = keys.streams.high.tolist(), keys.streams.low.tolist()
    list_of_place = keys.places.high.tolist()
    steps, regular = loss.streams.column("steps").tolist(), loss.streams.column("regular").tolist()
    own: dict[int, list[int]] = defaultdict(lambda: [0, 0, 0])
    lists: dict[int, set[int]] = defaultdict(set)
    for stream, node in enumerate(nodes):
        if node == NOBODY_KEY:
            continue
        tally = own[node]
        tally[0] += regular[stream]
        tally[1] += steps[stream]
        tally[2] += 1
        lists[node].add(list_of_place[places[stream]])
    scopes = {}
    for node, (own_regular, own_steps, streams) in own.items():
        node_steps = int(loss.nodes.steps[node])
        best, share = Scope.STREAM, (own_regular, own_steps or 1)
        for scope, considered, regular_steps in (
            (Scope.NODE_TELEGRAM, streams >= 2, int(loss.nodes.regular_telegram[node])),
            (Scope.NODE_SEND, len(lists[node]) >= 2, int(loss.nodes.regular_send[node])),
        ):
            candidate = (regular_steps, node_steps or 1)
            if considered and candidate[0] * share[1] > share[0] * candidate[1]:
                best, share = scope, candidate
        scopes[node] = best
    return scopes
