"""Loss, duplicates, overtaken telegrams and restarts, in every scope that a sender's Counter may have.

The counters of a stream, and those of a node across all its streams, are walked side by side. In both node scopes the
current counter moves alike, since telegrams with the current counter again leave it where it is: one walk serves both,
and they differ only in what such a telegram means.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U8, U16, U64, Bool
from nvscope.tracker.columns import Columns, runs_of, stable_order
from nvscope.tracker.counters import Scope
from nvscope.tracker.events import EventLog
from nvscope.tracker.flows import Flows
from nvscope.tracker.rows import DataRows
from nvscope.tracker.sequence import Step, Steps, walk

_LOGGED = (
    *((step, scope) for step in (Step.GAP, Step.OVERTAKEN, Step.RESTART) for scope in list(Scope)[:2]),
    *((Step.LATE, scope) for scope in Scope),
)

WALKS = 2
"""The stream's own sequence, and the node's."""


class StreamSequences(Columns):
    """One row a stream: its own sequence, and the figures booked on it.

    Figures of width 2 are those of the stream's walk and of the node's; ``duplicates`` has one for each scope.
    ``counting`` is set from the second counter value on.
    """

    current: U16
    missing: U64
    counting: Bool
    steps: I64
    regular: I64
    lost: I64
    gaps: I64
    longest_gap: I64
    overtaken: I64
    restarts: I64
    duplicates: I64
    COLUMNS: ClassVar = {
        "current": (np.uint16(0), 1),
        "missing": (np.uint64(0), 1),
        "counting": (np.False_, 1),
        "steps": (np.int64(0), 1),
        "regular": (np.int64(0), 1),
        "lost": (np.int64(0), WALKS),
        "gaps": (np.int64(0), WALKS),
        "longest_gap": (np.int64(0), WALKS),
        "overtaken": (np.int64(0), WALKS),
        "restarts": (np.int64(0), WALKS),
        "duplicates": (np.int64(0), len(Scope)),
    }


class NodeSequences(Columns):
    """One row a node: the sequence of all its telegrams, and the gaps in it.

    ``last_stream`` is that of its last telegram, -1 before.
    """

    current: U16
    missing: U64
    last_stream: I64
    gaps: I64
    steps: I64
    regular_telegram: I64
    regular_send: I64
    COLUMNS: ClassVar = {
        "current": (np.uint16(0), 1),
        "missing": (np.uint64(0), 1),
        "last_stream": (np.int64(-1), 1),
        "gaps": (np.int64(0), 1),
        "steps": (np.int64(0), 1),
        "regular_telegram": (np.int64(0), 1),
        "regular_send": (np.int64(0), 1),
    }


class Loss:
    """The sequences of all streams and nodes, and the events of their steps by stream (``events_of``)."""

    def __init__(self) -> None:
        self.streams = StreamSequences()
        self.nodes = NodeSequences()
        self._events = {key: EventLog() for key in _LOGGED}

    def observe(self, rows: DataRows, flows: Flows, first_frame: int) -> tuple[U8, I64]:
        """Walk the counters of a batch.

        Returns, row by row, the streams' own steps, and how many gaps the node's counters have had up to there.
        """
        self.streams.resize(len(flows.streams))
        self.nodes.resize(len(flows.nodes))
        frame = rows.packet + first_frame
        counter = rows.counter
        own = self._walk_streams(rows, counter)
        step, distance, sent_together, node_gaps = self._walk_nodes(rows, counter, flows)
        self._book(rows, frame, own.step, own.distance, Scope.STREAM)
        self._book(rows, frame, step, distance, Scope.NODE_TELEGRAM)
        self._book_duplicates(rows, frame, own.step, None, Scope.STREAM)
        self._book_duplicates(rows, frame, step, None, Scope.NODE_TELEGRAM)
        self._book_duplicates(rows, frame, step, sent_together, Scope.NODE_SEND)
        return own.step, node_gaps

    def _walk_streams(self, rows: DataRows, counter: U16) -> Steps:
        streams, run = self.streams, rows.run_stream
        steps = walk(counter, rows.start, streams.current[run], streams.missing[run], rows.fresh)
        streams.current[run], streams.missing[run] = steps.current, steps.missing
        length = rows.stop - rows.start
        idle = np.zeros(len(run), np.int64)  # rows that take no step
        waiting = ~streams.counting[run]
        if waiting.any():
            moves = np.flatnonzero((steps.step != Step.SAME) & (steps.step != Step.NONE))
            first = np.append(moves, len(counter))[np.searchsorted(moves, rows.start)]
            begins = np.where(waiting, np.minimum(first, rows.stop), rows.start)
            idle = begins - rows.start
            streams.counting[run] |= begins < rows.stop
            steps.step[np.arange(len(counter)) < np.repeat(begins, length)] = Step.NONE
            steps.irregular = np.flatnonzero(steps.step != Step.REGULAR)
        irregular = np.diff(np.searchsorted(steps.irregular, np.append(rows.start, len(counter))))
        streams.steps[run] += length - idle
        streams.regular[run] += length - irregular
        return steps

    def _walk_nodes(self, rows: DataRows, counter: U16, flows: Flows) -> tuple[U8, U16, Bool | None, I64]:
        """Walk the nodes' sequences.

        Returns, by rows, step and distance, where a telegram with the node's current counter belongs to the same send
        as the node's telegram before (same list, another SubIndex; None where none does), and the node's gaps so far.
        """
        node_of_stream = flows.streams.low.astype(np.int64)
        row_of = np.empty_like(rows.order)  # by position as captured
        row_of[rows.order] = np.arange(len(rows))
        node = node_of_stream[rows.stream]
        row = row_of[stable_order(rows.as_captured(node), len(flows.nodes))]
        node, stream = node[row], rows.stream[row]
        start, stop = runs_of(node)
        run = node[start]
        nodes = self.nodes
        fresh = nodes.last_stream[run] < 0
        steps = walk(counter[row], start, nodes.current[run], nodes.missing[run], fresh)
        same = np.flatnonzero(steps.step == Step.SAME)
        together = np.zeros(len(node), np.bool_)
        if len(same):
            before = np.empty_like(stream)
            before[1:] = stream[:-1]
            before[start] = nodes.last_stream[run]
            list_of_stream = flows.places.high[flows.streams.high.astype(np.int64)]
            now, earlier = stream[same], before[same]
            together[same] = (list_of_stream[now] == list_of_stream[earlier]) & (now != earlier)
        bounds = np.append(start, len(node))
        irregular = np.diff(np.searchsorted(steps.irregular, bounds))
        nodes.steps[run] += stop - start - fresh
        nodes.regular_telegram[run] += stop - start - irregular
        sends = np.add.reduceat(together, start, dtype=np.int64)
        nodes.regular_send[run] += stop - start - irregular + sends
        nodes.current[run], nodes.missing[run] = steps.current, steps.missing
        gaps = np.cumsum(steps.step == Step.GAP, dtype=np.int64)
        gaps += np.repeat(nodes.gaps[run] - np.where(start > 0, gaps[start - 1], 0), stop - start)
        nodes.gaps[run] = gaps[stop - 1]
        nodes.last_stream[run] = stream[stop - 1]
        return (
            _by_row(steps.step, row),
            _by_row(steps.distance, row),
            _by_row(together, row) if len(same) else None,
            _by_row(gaps, row),
        )

    def _book(self, rows: DataRows, frame: I64, step: U8, distance: U16, scope: Scope) -> None:
        streams = self.streams
        for kind in (Step.GAP, Step.OVERTAKEN, Step.RESTART):
            place = np.flatnonzero(step == kind)
            if not len(place):
                continue
            stream, start, stop = _runs(place, rows)
            count = stop - start
            if kind == Step.GAP:
                lost = distance[place].astype(np.int64) - 1
                streams.gaps[stream, scope] += count
                streams.lost[stream, scope] += np.add.reduceat(lost, start)
                longest = np.maximum.reduceat(lost, start)
                streams.longest_gap[stream, scope] = np.maximum(streams.longest_gap[stream, scope], longest)
            elif kind == Step.OVERTAKEN:
                streams.overtaken[stream, scope] += count
                streams.lost[stream, scope] -= count
            else:
                streams.restarts[stream, scope] += count
            self._log(kind, scope, stream, start, stop, rows.time_ns[place], frame[place])

    def _book_duplicates(self, rows: DataRows, frame: I64, step: U8, sent_together: Bool | None, scope: Scope) -> None:
        duplicate = step == Step.LATE
        if rows.repeated is not None:
            again = (step == Step.SAME) & rows.repeated
            duplicate |= again if sent_together is None else again & ~sent_together
        place = np.flatnonzero(duplicate)
        if len(place):
            stream, start, stop = _runs(place, rows)
            self.streams.duplicates[stream, scope] += stop - start
            self._log(Step.LATE, scope, stream, start, stop, rows.time_ns[place], frame[place])

    def _log(self, step: Step, scope: Scope, stream: I64, start: I64, stop: I64, time_ns: I64, frame: I64) -> None:
        low = stream.astype(np.uint64)
        self._events[step, scope].record_groups(np.zeros_like(low), low, start, stop, time_ns, frame)

    def events_of(self, step: Step, scope: Scope) -> EventLog:
        """Return the events of a step in a scope, keyed by (0, stream); those of duplicates are of the step LATE."""
        if step != Step.LATE:
            scope = min(scope, Scope.NODE_TELEGRAM)  # both node scopes take the same steps
        return self._events[step, scope]


def _runs(place: I64, rows: DataRows) -> tuple[I64, I64, I64]:
    """Part rising places into runs of one stream; return the streams and the bounds of the runs in ``place``."""
    start, stop = runs_of(rows.stream[place])
    return rows.stream[place[start]], start, stop


def _by_row(column: np.ndarray, row: I64) -> np.ndarray:
    """Return a column whose entries belong to the given rows, by row."""
    ordered = np.empty_like(column)
    ordered[row] = column
    return ordered
