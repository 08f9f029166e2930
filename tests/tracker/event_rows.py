"""Events that were told, as rows that can be compared."""

from __future__ import annotations

from typing import NamedTuple

from dissectors import address
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.event_columns import EventColumns, EventTable
from nvscope.tracker.state import TrackerState


class Event(NamedTuple):
    """One event with what its numbers stand for: numbers are given as things appear in a batch."""

    kind: str
    scope: int
    list: str
    node: str
    subindex: int
    channel: int
    since_ns: int
    time_ns: int
    frame: int
    amount: int
    peer: str
    detail: int | str


def rows_of(table: EventTable) -> list[EventTable]:
    """Return the rows of a table, with a number in each column."""
    return [EventTable(*row) for row in zip(*(column.tolist() for column in table), strict=True)]


def named(state: TrackerState, columns: EventColumns) -> list[Event]:
    keys = state.keys
    nodes = [address.text(*halves) for halves in zip(keys.nodes.high.tolist(), keys.nodes.low.tolist(), strict=True)]
    return [
        Event(**{name: value for name, value in row._asdict().items() if name in Event._fields} | {
            "kind": columns.kinds[row.kind].name,
            "list": str(keys.list_key(row.list)) if row.list >= 0 else "",
            "node": nodes[row.node] if row.node >= 0 else "",
            "peer": nodes[row.peer] if row.peer >= 0 else "",
            "detail": nodes[row.detail] if row.kind == EventKind.SEND_REJECTED else row.detail,
        })
        for row in rows_of(columns.table())
    ]  # fmt: skip
