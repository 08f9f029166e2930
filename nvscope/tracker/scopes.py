"""Scopes in force: what the Counter of each sender counts, as far as its telegrams have shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.batch import Bool
from nvscope.engine.keys import NOBODY_KEY
from nvscope.engine.runs import distinct
from nvscope.tracker.counters import Scope
from nvscope.tracker.loss import NodeSequences

if TYPE_CHECKING:
    from nvscope.tracker.state import TrackerState


def scopes_in_force(state: TrackerState) -> dict[int, Scope]:
    """Return, by node with streams, the scope in which most steps of its Counter are regular.

    Nodes of which the limit has left out streams are not there: what those have counted, nobody knows.
    """
    keys, loss = state.keys, state.senders.loss
    stream = np.flatnonzero(keys.streams.low != np.uint64(NOBODY_KEY))
    if not len(stream):
        return {}
    node, lists = keys.node_of(stream), keys.list_of_place(keys.place_of(stream))
    nodes = len(keys.nodes)
    streams = np.bincount(node, minlength=nodes)
    members = distinct(node * len(keys.lists) + lists)
    several_lists = np.bincount(members // len(keys.lists), minlength=nodes) >= 2
    best = np.full(nodes, Scope.STREAM)
    regular, steps = np.zeros(nodes, np.int64), np.zeros(nodes, np.int64)
    np.add.at(regular, node, loss.streams.column("regular")[stream])
    np.add.at(steps, node, loss.streams.column("steps")[stream])
    steps = np.maximum(steps, 1)
    of_nodes = loss.nodes
    for scope, considered, own in (
        (
            Scope.NODE_TELEGRAM,
            (streams >= 2) & _mostly(of_nodes, "streams", nodes),
            of_nodes.column("regular_telegram"),
        ),
        (Scope.NODE_SEND, several_lists & _mostly(of_nodes, "lists", nodes), of_nodes.column("regular_send")),
    ):
        of_node = np.maximum(of_nodes.column("steps"), 1)
        # Compared exactly: no capture has so many telegrams that a product of two numbers of them is too large.
        seen = np.flatnonzero(considered[: len(own)])
        seen = seen[own[seen] * steps[seen] > regular[seen] * of_node[seen]]
        best[seen], regular[seen], steps[seen] = scope, own[seen], of_node[seen]
    first = np.full(nodes, len(keys.streams))
    np.minimum.at(first, node, stream)
    known = np.flatnonzero(streams)
    known = known[np.argsort(first[known])]
    scopes = dict(zip(known.tolist(), map(_SCOPES.__getitem__, best[known].tolist()), strict=True))
    for doubtful in keys.left_out.senders & scopes.keys():
        del scopes[doubtful]
    return scopes


_SCOPES = tuple(Scope)


def _mostly(of_nodes: NodeSequences, between: str, nodes: int) -> Bool:
    """Tell which of so many nodes count on from one of their streams, or lists, to another."""
    told: Bool = np.zeros(nodes, np.bool_)
    own = of_nodes.counts_on(between)[:nodes]
    told[: len(own)] = own
    return told
