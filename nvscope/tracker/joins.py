"""How the columns of a state join: which tables hold what is counted, and how windows of them become a whole.

Rows of a state are only ever added, and keep their numbers: what was known at a moment is the first rows of what is
known later.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.tracker.histograms import UNKNOWN_LEAST, UNKNOWN_MOST

if TYPE_CHECKING:
    from nvscope.tracker.state import TrackerState


class Join(Enum):
    """How the column of a whole follows from those of its windows, the last one last."""

    SUM = "added up"
    LEAST = "the least"
    MOST = "the most"
    LAST = "that of the last window"


SUM, LEAST, MOST, LAST = Join.SUM, Join.LEAST, Join.MOST, Join.LAST

_COUNTED_EVENTS = {"count": SUM, "first_ns": LAST, "last_ns": LAST, "frames": LAST}

_MAJORITIES = {"own": LAST, "strays": LAST, "shown": LAST, "since": LAST, "until": LAST}

TABLES: Mapping[str, Mapping[str, Join]] = {
    "memory.columns": {"telegrams": SUM, "first_ns": LAST, "last_ns": LAST, "signature": LAST, "heard": LAST},
    "lists.flows.counts": {
        "count": SUM, "mismatches": SUM, "chosen": SUM,
        "first_ns": LAST, "first_frame": LAST, "last_ns": LAST, "last_frame": LAST,
    },
    "lists.columns": {
        "truncated": SUM, "missing_acknowledgements": SUM, "negative_acknowledgements": SUM, "bootup_unanswered": SUM,
        "send_rejected": SUM,
    },
    "lists.errors.of_list": {"count": SUM, "error": LAST, "time_ns": LAST, "own": LAST, "frame": LAST},
    "lists.errors.of_member": {"count": SUM, "error": LAST, "time_ns": LAST, "own": LAST, "frame": LAST},
    "lists.acknowledgement.latencies.columns": {"least_ns": LEAST, "most_ns": MOST},
    "lists.acknowledgement.latencies.buckets": {"count": SUM},
    # In which scope a sender counts is told by all its steps: a window goes by what is known at its end.
    "senders.loss.streams": {
        "current": LAST, "missing": LAST, "telegrams": LAST, "begun": SUM, "counting": LAST, "moved": LAST,
        "steps": LAST, "regular": LAST, "swapped": LAST, "repeated": SUM,
        "lost": SUM, "gaps": SUM, "longest_gap": MOST, "overtaken": SUM, "restarts": SUM, "duplicates": SUM,
    },
    "senders.loss.nodes": {
        "current": LAST, "missing": LAST, "last_stream": LAST, "last_ns": LAST, "last": LAST, "gaps": LAST,
        "steps": LAST, "swapped": LAST, "regular_of_streams": LAST, "regular_telegram": LAST, "regular_send": LAST,
        "between_streams": LAST,
        "regular_between_streams": LAST, "between_lists": LAST, "regular_between_lists": LAST,
    },
    "senders.timing.columns": {
        "last_ns": LAST, "last_frame": LAST, "node_gaps": LAST, "count": SUM, "total_ns": SUM, "least_ns": LEAST,
        "most_ns": MOST, "squares": SUM, "learned": LAST, "usual_ns": LAST, "unusual": LAST,
        "first_bucket": LAST, "dense": SUM,
        "usual_kept": LAST, "usual_frames": LAST, "usual_keys": LAST,
    },
    "senders.timing.unusual.rows": _COUNTED_EVENTS,
    "buses.load.columns": {
        "frames": SUM, "exact_bits": SUM, "worst_bits": SUM, "fast_bits": SUM, "worst_fast_bits": SUM,
    },
    "buses.load.identifiers.columns": {
        "frames": SUM, "bits": SUM, "fast_bits": SUM, "first_ns": LAST, "last_ns": LAST, "first_frame": LAST,
        "lengths": LAST, "longest": LAST,
    },
    "buses.load.identifiers.left_out.rows": _COUNTED_EVENTS,
    "buses.errors.columns": {
        "off": LAST, "off_since_ns": LAST, "off_until_ns": LAST, "bus_offs": SUM, "restarts": SUM, "returns": SUM,
        "off_ns": SUM,
        "longest_off_ns": MOST, "states": SUM, "tx_errors": MOST, "rx_errors": MOST,
    },
    "buses.errors.all.rows": _COUNTED_EVENTS,
    "buses.errors.classes.rows": _COUNTED_EVENTS,
    "buses.canopen.columns": {
        "heard": LAST, "heartbeats": SUM, "strays": SUM, "boot_ups": SUM, "changes": SUM, "state": LAST,
        "since_ns": LAST, "last_ns": LAST, "emergencies": SUM, "emergency": LAST, "emergency_ns": LAST, "commands": SUM,
        "command": LAST, "command_ns": LAST, "command_frame": LAST, "beats_from": LAST, "told_from": LAST,
        "doubted_from": LAST,
    },
    "buses.canopen.sdo": _MAJORITIES,
    "buses.canopen.nmt": _MAJORITIES,
    "buses.remotes.rows": _COUNTED_EVENTS,
}  # fmt: skip
"""Each table of a ``TrackerState`` that figures are read from, by its path, and how each of its columns joins."""

KEYS = (
    "lists.errors.members", "lists.acknowledgement.latencies.keys", "senders.timing.unusual.keys", "buses.load.keys",
    "buses.load.identifiers.keys", "buses.load.identifiers.left_out.keys", "buses.errors.channels",
    "buses.errors.all.keys", "buses.errors.classes.keys", "buses.canopen.nodes", "buses.canopen.channels",
    "buses.remotes.keys",
)  # fmt: skip
"""What numbers the rows of those that streams, lists and nodes do not number."""

NUMBERS = (
    "capture.frames", "capture.telegrams", "capture.chosen", "capture.fragments",
    "buses.frames",
)  # fmt: skip
"""Numbers of a state, which add up."""


def tables_of(state: TrackerState) -> Iterator[tuple[KeyedColumns, Mapping[str, Join]]]:
    """Yield the tables of a state with how their columns join, in the same order for all states."""
    for path, joins in TABLES.items():
        yield attrgetter(path)(state), joins


def subtract(later: KeyedColumns, earlier: KeyedColumns, joins: Mapping[str, Join], *, extremes: bool) -> None:
    """Make a table of what was counted since an earlier moment; without ``extremes``, these become unknown."""
    known = len(earlier)
    for name, join in joins.items():
        column = later.column(name)
        if join is Join.SUM:
            column[:known] -= earlier.column(name)
        elif not extremes and name == "least_ns":
            column[:] = UNKNOWN_LEAST
        elif not extremes and name == "most_ns":
            column[:] = UNKNOWN_MOST


def add(later: KeyedColumns, earlier: KeyedColumns, joins: Mapping[str, Join]) -> None:
    """Make a table of what was counted in a window that of this and the window before it."""
    known = len(earlier)
    for name, join in joins.items():
        column, before = later.column(name)[:known], earlier.column(name)
        if join is Join.SUM:
            column += before
        elif join is Join.LEAST:
            np.minimum(column, before, out=column)
        elif join is Join.MOST:
            np.maximum(column, before, out=column)


class Extremes(NamedTuple):
    """The shortest and the longest interval of each stream, by number; both of shape (n,)."""

    least_ns: I64
    most_ns: I64


def extremes_of(state: TrackerState, before: Extremes | None = None) -> Extremes:
    """Return the extremes of a state's intervals, and of those that it has forgotten."""
    columns = state.senders.timing.columns
    least_ns, most_ns = columns.column("least_ns").copy(), columns.column("most_ns").copy()
    if before is not None:
        known = len(before.least_ns)
        np.minimum(least_ns[:known], before.least_ns, out=least_ns[:known])
        np.maximum(most_ns[:known], before.most_ns, out=most_ns[:known])
    return Extremes(least_ns, most_ns)


def forget_extremes(state: TrackerState) -> None:
    """Let a state keep extremes from now on only."""
    for table, joins in tables_of(state):
        for name, join in joins.items():
            if join in (Join.LEAST, Join.MOST):
                table.column(name)[:] = table.COLUMNS[name][0]
