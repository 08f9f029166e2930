"""Figures: what an observer can count of losses, copies, overtaken telegrams and restarts.

Counted along the true running numbers and the labels that the faults gave, not from the 16-bit Counter of the wire.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.simulate.faults import Label
from nvscope.simulate.observation import Observation
from nvscope.simulate.ordering import order_by

_CLEAR_SHARE = 0.01


class Figures(Struct, frozen=True):
    """What the counters tell, by stream; columns of shape (streams,)."""

    lost: I64
    gaps: I64
    longest_gap: I64
    duplicates: I64
    overtaken: I64
    restarts: I64


def count_figures(seen: Observation) -> Figures:
    """Return the figures of all streams.

    A loss lies between two telegrams of one sequence that are seen in order; it is booked on the stream of the later
    one. A copy counts from a stream's second counter value on, where the stream is what the sender counts.
    """
    table, streams = seen.table, len(seen.streams)
    rows = seen.in_order[order_by(table.sequence_of[seen.stream[seen.in_order]])]
    sequence = table.sequence_of[seen.stream[rows]]
    number, epoch = table.number[rows], table.epoch[rows]
    same, restart = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.bool_)
    missing = np.zeros(len(rows), np.int64)
    same[1:] = sequence[1:] == sequence[:-1]
    restart[1:] = same[1:] & (epoch[1:] != epoch[:-1])
    missing[1:] = number[1:].astype(np.int64) - number[:-1] - 1
    missing[~same | restart | (missing < 0)] = 0
    counts_itself = np.array([entry.scope == "stream" for entry in seen.streams] or [False], np.bool_)
    copies = seen.data & (table.label == Label.COPY) & ~(seen.unstarted & counts_itself[seen.stream])
    overtaken = seen.data & (table.label == Label.OVERTAKEN)

    def per_stream(rows: I64, weights: I64 | None = None) -> I64:
        counts = np.bincount(seen.stream[rows], weights, streams).astype(np.int64)
        counts[[place for place, entry in enumerate(seen.streams) if entry.scope == "unused"]] = 0
        return counts

    longest = np.zeros(streams, np.int64)
    np.maximum.at(longest, seen.stream[rows], missing)
    late = per_stream(np.flatnonzero(overtaken))
    gaps = per_stream(rows[missing > 0])
    return Figures(
        lost=per_stream(rows, missing) - late,
        gaps=gaps,
        longest_gap=np.where(gaps > 0, longest, 0),
        duplicates=per_stream(np.flatnonzero(copies)),
        overtaken=late,
        restarts=per_stream(rows[restart]),
    )


def is_recognisable(seen: Observation, node: int) -> bool:
    """Return whether an observer can find out what a node counts: most steps are regular in one way, by far."""
    numbers = seen.streams_of_node(node)
    scope = seen.streams[numbers[0]].scope if numbers else "stream"
    if seen.scenario.node[node].byte_swapped or scope == "list":
        return False
    own = np.zeros(len(seen.streams) + 1, np.bool_)
    own[numbers] = True
    rows = seen.in_order[own[seen.stream[seen.in_order]]]
    if scope == "unused" or len(rows) < 2:
        return True
    width = seen.scenario.node[node].last_value + 1
    writer = np.array([entry.writer for entry in seen.streams])[seen.stream[rows]]
    same_send = (np.diff(writer) == 0) & (np.diff(seen.stream[rows]) != 0)
    counter = seen.table.counter[rows].astype(np.int64)
    step = np.diff(counter) % width
    order = order_by(seen.stream[rows])
    own_step = (np.diff(counter[order]) % width)[np.diff(seen.stream[rows][order]) == 0]
    shares = {"stream": float((own_step == 1).mean()) if len(own_step) else 0.0}
    # Who counts beyond streams counts on from one to another.
    other_stream, other_list = np.diff(seen.stream[rows]) != 0, np.diff(writer) != 0
    if 2 * (step[other_stream] == 1).sum() > other_stream.sum():
        shares["node-telegram"] = float((step == 1).mean())
    # Equal to it or below, and then it is the other one.
    if 2 * (step[other_list] == 1).sum() > other_list.sum() and scope != "node-telegram":
        shares["node-send"] = float(((step == 1) | ((step == 0) & same_send)).mean())
    return shares.pop(scope, 0.0) > max(shares.values(), default=0.0) + _CLEAR_SHARE
