"""Loss, duplicates, overtaken telegrams and restarts, in every scope that a sender's Counter may have.

The counters of a stream, and those of a node across all its streams, are walked side by side. In both node scopes the
current counter moves alike, since telegrams with the current counter again leave it where it is: one walk serves both,
and they differ only in what such a telegram means.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U16, U64, Bool
from nvscope.engine.dealing import Share
from nvscope.engine.events import EventBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import Keys
from nvscope.engine.rows import DataRows
from nvscope.engine.runs import order_by, runs_of_lengths
from nvscope.engine.told import Told
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.events import EventRows
from nvscope.tracker.node_steps import NodeOrder, NodeSteps
from nvscope.tracker.sequence import walk
from nvscope.tracker.steps import Step, Steps

_LOGGED = (
    *((step, scope) for step in (Step.GAP, Step.OVERTAKEN, Step.RESTART) for scope in list(Scope)[:2]),
    *((Step.LATE, scope) for scope in Scope),
)

_TOLD = {
    Step.GAP: EventKind.GAP,
    Step.OVERTAKEN: EventKind.OVERTAKEN,
    Step.RESTART: EventKind.RESTART,
    Step.LATE: EventKind.DUPLICATE,
}

WALKS = 2
"""The stream's own sequence, and the node's."""


class StreamSequences(KeyedColumns):
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


class NodeSequences(KeyedColumns):
    """One row a node: the sequence of all its telegrams, and the gaps in it.

    ``last_stream`` is that of its last telegram, -1 before; ``last_ns`` is when that came.
    """

    current: U16
    missing: U64
    last_stream: I64
    last_ns: I64
    gaps: I64
    steps: I64
    regular_telegram: I64
    regular_send: I64
    COLUMNS: ClassVar = {
        "current": (np.uint16(0), 1),
        "missing": (np.uint64(0), 1),
        "last_stream": (np.int64(-1), 1),
        "last_ns": (np.int64(0), 1),
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
        self._events = {key: EventRows() for key in _LOGGED}

    def observe(self, told: Told, rows: DataRows) -> tuple[Steps, NodeSteps]:
        """Walk the counters of a batch; return the streams' own steps, and the nodes' steps, row by row."""
        keys = told.keys
        self.streams.resize(len(keys.streams))
        self.nodes.resize(len(keys.nodes))
        for log in self._events.values():
            log.resize(len(keys.streams))
        own = self._walk_streams(rows, rows.counter)
        nodes = self._walk_nodes(told, rows, keys)
        self._book(told, rows, own, Scope.STREAM)
        self._book(told, rows, nodes, Scope.NODE_TELEGRAM)
        repeated = np.empty(0, np.int64) if rows.repeated is None else np.flatnonzero(rows.repeated)
        late, again = own.at(Step.LATE), repeated[own.step[repeated] == Step.SAME]
        self._book_duplicates(told, rows, own, late, again, Scope.STREAM)
        late, again = nodes.at(Step.LATE), repeated[nodes.step[repeated] == Step.SAME]
        self._book_duplicates(told, rows, nodes, late, again, Scope.NODE_TELEGRAM)
        again = again[~nodes.together(again)]
        self._book_duplicates(told, rows, nodes, late, again, Scope.NODE_SEND)
        return own, nodes

    def take(self, part: Loss, share: Share) -> None:
        """Take over the sequences of a part's share of the senders."""
        self.streams.take(part.streams, share.streams)
        self.nodes.take(part.nodes, share.nodes)
        for key, log in self._events.items():
            log.take(part._events[key], share.streams)

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

    def _walk_nodes(self, told: Told, rows: DataRows, keys: Keys) -> NodeSteps:
        """Walk the nodes' sequences.

        A telegram with the node's current counter is sent together with the node's telegram before, if that was of the
        same list and another SubIndex.
        """
        nodes = self.nodes
        length = np.zeros(len(keys.nodes), np.int64)
        np.add.at(length, keys.node_of(rows.run_stream), rows.stop - rows.start)
        node = np.where(keys.varieties.column("stream") >= 0, keys.varieties.column("node"), len(length))
        packet = order_by(node, told.variety, len(length))[: len(rows)]
        run, start, stop = runs_of_lengths(length)
        length = stop - start
        fresh = nodes.last_stream[run] < 0
        steps = walk(told.counter.take(packet), start, nodes.current[run], nodes.missing[run], fresh)
        run_of_stream = np.searchsorted(run, keys.node_of(np.arange(len(keys.streams))))
        time_ns = told.packets.ts_ns
        before_ns = np.where(fresh, time_ns[packet[start]], nodes.last_ns[run])
        order = NodeOrder(packet, start, rows, run_of_stream, time_ns, before_ns)
        together = self._sent_together(told, packet, start, run, steps, keys)
        bounds = np.append(start, len(packet))
        regular = length - np.diff(np.searchsorted(steps.irregular, bounds))
        nodes.steps[run] += length - fresh
        nodes.regular_telegram[run] += regular
        nodes.regular_send[run] += regular + np.diff(np.searchsorted(together, bounds))
        nodes.current[run], nodes.missing[run] = steps.current, steps.missing
        nodes.last_stream[run] = keys.varieties.stream[told.variety[packet[stop - 1]]]
        nodes.last_ns[run] = time_ns[packet[stop - 1]]
        gaps = steps.at(Step.GAP)
        before = np.searchsorted(gaps, bounds)
        counted = nodes.gaps[run] - before[:-1]
        nodes.gaps[run] += np.diff(before)
        return NodeSteps(steps, order, together, gaps, counted)

    def _sent_together(self, told: Told, packet: I64, start: I64, run: I64, steps: Steps, keys: Keys) -> I64:
        """Return the places, in the nodes' order, of telegrams that were sent together with the one before."""
        same = steps.at(Step.SAME)
        if not len(same):
            return same
        stream = keys.varieties.stream
        now, earlier = (stream[told.variety[packet[place]]] for place in (same, same - 1))
        first = np.searchsorted(same, start)
        begins = np.append(same, -1)[first] == start
        earlier[first[begins]] = self.nodes.last_stream[run[begins]]
        lists = keys.places.high[keys.place_of(np.arange(len(keys.streams)))]
        sent: I64 = same[(lists[now] == lists[earlier]) & (now != earlier)]
        return sent

    def _book(self, told: Told, rows: DataRows, steps: Steps | NodeSteps, scope: Scope) -> None:
        streams, first_frame = self.streams, told.first_frame
        for kind in (Step.GAP, Step.OVERTAKEN, Step.RESTART):
            place = steps.at(kind)
            if not len(place):
                continue
            stream, start, stop = _runs(place, rows)
            count = stop - start
            lost = None
            if kind == Step.GAP:
                lost = steps.distance_at(place).astype(np.int64) - 1
                streams.gaps[stream, scope] += count
                streams.lost[stream, scope] += np.add.reduceat(lost, start)
                longest = np.maximum.reduceat(lost, start)
                streams.longest_gap[stream, scope] = np.maximum(streams.longest_gap[stream, scope], longest)
            elif kind == Step.OVERTAKEN:
                streams.overtaken[stream, scope] += count
                streams.lost[stream, scope] -= count
            else:
                streams.restarts[stream, scope] += count
            self._events[kind, scope].add(stream, start, stop, rows.time_ns, rows.packet, place, first_frame)
            self._tell(told, kind, scope, rows, steps, place, lost)

    def _book_duplicates(
        self, told: Told, rows: DataRows, steps: Steps | NodeSteps, late: I64, again: I64, scope: Scope
    ) -> None:  # fmt: skip
        """Book late counters, and the rows that are a duplicate ``again``."""
        place = np.sort(np.concatenate([late, again])) if len(again) else late
        if len(place):
            stream, start, stop = _runs(place, rows)
            self.streams.duplicates[stream, scope] += stop - start
            self._events[Step.LATE, scope].add(stream, start, stop, rows.time_ns, rows.packet, place, told.first_frame)
            self._tell(told, Step.LATE, scope, rows, steps, place)

    def _tell(
        self, told: Told, step: Step, scope: Scope, rows: DataRows, steps: Steps | NodeSteps, place: I64,
        lost: I64 | None = None,
    ) -> None:  # fmt: skip
        """Tell of the steps at some places, in the order of the capture."""
        if not told.is_heard:
            return
        order = np.argsort(rows.packet[place], kind="stable")
        place = place[order]
        before = steps if isinstance(steps, NodeSteps) else rows
        lists, node, subindex = told.keys.described(rows.stream[place])
        told.tell(
            EventBatch.of(
                _TOLD[step], rows.time_ns[place], rows.packet[place] + told.first_frame, lists=lists, node=node,
                subindex=subindex, since_ns=before.times_before(place),
                amount=None if lost is None else lost[order], scope=scope,
            )
        )  # fmt: skip

    def events_of(self, step: Step, scope: Scope) -> EventRows:
        """Return the events of a step in a scope, by stream; those of duplicates are of the step LATE."""
        if step != Step.LATE:
            scope = min(scope, Scope.NODE_TELEGRAM)  # both node scopes take the same steps
        return self._events[step, scope]


def _runs(place: I64, rows: DataRows) -> tuple[I64, I64, I64]:
    """Part rising places into runs of one stream; return the streams and the bounds of the runs in ``place``."""
    bounds = np.searchsorted(place, np.append(rows.start, len(rows)))
    run = np.flatnonzero(bounds[1:] > bounds[:-1])
    return rows.run_stream[run], bounds[run], bounds[run + 1]
