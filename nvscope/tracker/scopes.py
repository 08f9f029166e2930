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
        of_node, node_steps = loss.nodes, int(loss.nodes.steps[node])
        best, share = Scope.STREAM, (own_regular, own_steps or 1)
        # Who counts beyond one stream counts on from one to another: a fast stream beside rare ones shows nothing.
        by_telegram = streams >= 2 and 2 * of_node.regular_between_streams[node] > of_node.between_streams[node]
        by_send = len(lists[node]) >= 2 and 2 * of_node.regular_between_lists[node] > of_node.between_lists[node]
        for scope, considered, regular_steps in (
            (Scope.NODE_TELEGRAM, by_telegram, int(of_node.regular_telegram[node])),
            (Scope.NODE_SEND, by_send, int(of_node.regular_send[node])),
        ):
            candidate = (regular_steps, node_steps or 1)
            if considered and candidate[0] * share[1] > share[0] * candidate[1]:
                best, share = scope, candidate
        scopes[node] = best
    return scopes
