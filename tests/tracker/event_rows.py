"""Events that were told, as rows that can be compared."""

from __future__ import annotations

from nvscope.tracker.event_columns import EventTable
from nvscope.tracker.state import TrackerState


def rows_of(table: EventTable) -> list[tuple[int, ...]]:
    return list(zip(*(column.tolist() for column in table), strict=True))


def named(state: TrackerState, table: EventTable) -> list[tuple[object, ...]]:
    """Return events with what their numbers stand for: numbers are given as things appear in a batch."""
    nodes = list(zip(state.keys.nodes.high.tolist(), state.keys.nodes.low.tolist(), strict=True))
    return [
        (kind, scope, str(state.keys.list_key(own_list)) if own_list >= 0 else "", nodes[node] if node >= 0 else None,
         *others)
        for kind, scope, own_list, node, *others in rows_of(table)
    ]  # fmt: skip
