"""Loss, duplicates, overtaken telegrams and restarts, in every scope that a sender's Counter may have.

The counters of a stream, and those of a node across all its streams, are walked side by side. In both node scopes the
current counter moves alike, since telegrams with the current counter again leave it where it is: one walk serves both,
and they differ only in whether such a telegram is regular. A repeated telegram takes no step in any of them: it is a
duplicate, however late it comes.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U16, U64, Bool
from nvscope.engine.dealing import Share
from nvscope.engine.events import EventBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import COUNTER_SHIFT, Keys
from nvscope.engine.rows import DataRows
from nvscope.engine.runs import order_by, runs_of_lengths, spans
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.events import EventRows
from nvscope.tracker.node_steps import NodeOrder, NodeSteps
from nvscope.tracker.rare import rare_ones
from nvscope.tracker.repeated import Repeated
from nvscope.tracker.sender_changes import Changes
from nvscope.tracker.steps import Step, Steps
from nvscope.tracker.swapped_counters import byte_swapped, swapped_steps

_TOLD = {
    Step.GAP: EventKind.GAP,
    Step.OVERTAKEN: EventKind.OVERTAKEN,
    Step.RESTART: EventKind.RESTART,
    Step.LATE: EventKind.DUPLICATE,
}

_COUNTED = {
    Step.GAP: "gaps",
    Step.OVERTAKEN: "overtaken",
    Step.RESTART: "restarts",
    Step.LATE: "duplicates",
}

_RARE = 4
"""A step of a kind is rare of which there is one in so many telegrams: who loses more cannot be told when."""

_CLEARLY = 256
"""By so many regular steps a scope has to be ahead, that steps of the other one need not be told."""

NO_STREAM = -1

WALKS = 2
"""The stream's own sequence, and the node's."""


class StreamSequences(KeyedColumns):
    """One row a stream: its own sequence, and the figures booked on it.

    Figures of width 2 are those of the stream's walk and of the node's. ``begun`` counts the telegrams that are
    compared with none before. ``counting`` is set from the second counter value on, ``moved`` from the second one of a
    recording (``nvscope.capture.recordings``). ``swapped`` are the steps that are not regular, but would be +1 if the
    Counter's two bytes were swapped. ``repeated`` are the telegrams that equal the one before, byte for byte.
    """

    current: U16
    missing: U64
    telegrams: I64
    begun: I64
    counting: Bool
    moved: Bool
    steps: I64
    regular: I64
    swapped: I64
    repeated: I64
    lost: I64
    gaps: I64
    longest_gap: I64
    overtaken: I64
    restarts: I64
    duplicates: I64
    COLUMNS: ClassVar = {
        "current": (np.uint16(0), 1),
        "missing": (np.uint64(0), 1),
        "telegrams": (np.int64(0), 1),
        "begun": (np.int64(0), 1),
        "counting": (np.False_, 1),
        "moved": (np.False_, 1),
        "steps": (np.int64(0), 1),
        "regular": (np.int64(0), 1),
        "swapped": (np.int64(0), 1),
        "repeated": (np.int64(0), 1),
        "lost": (np.int64(0), WALKS),
        "gaps": (np.int64(0), WALKS),
        "longest_gap": (np.int64(0), WALKS),
        "overtaken": (np.int64(0), WALKS),
        "restarts": (np.int64(0), WALKS),
        "duplicates": (np.int64(0), WALKS),
    }


class NodeSequences(KeyedColumns):
    """One row a node: the sequence of all its telegrams, and the gaps in it.

    ``last_stream`` is that of its last telegram that was not repeated, ``NO_STREAM`` before, and while it is unheard;
    ``last_ns`` is when its last one came, ``last`` its Counter. ``swapped`` is as for streams, of the steps that are
    not regular for the stream either; ``regular_of_streams`` are the regular steps of its streams, ``regular_telegram``
    and ``regular_send`` its own. Of its steps, ``between_streams`` are those from one stream to another,
    ``between_lists`` those from one list to another; of which so many are ``regular``.
    """

    current: U16
    missing: U64
    last_stream: I64
    last_ns: I64
    last: U16
    gaps: I64
    steps: I64
    swapped: I64
    regular_of_streams: I64
    regular_telegram: I64
    regular_send: I64
    between_streams: I64
    regular_between_streams: I64
    between_lists: I64
    regular_between_lists: I64
    COLUMNS: ClassVar = {
        "current": (np.uint16(0), 1), "missing": (np.uint64(0), 1), "last_stream": (np.int64(NO_STREAM), 1),
        "last_ns": (np.int64(0), 1), "last": (np.uint16(0), 1), "gaps": (np.int64(0), 1), "steps": (np.int64(0), 1),
        "swapped": (np.int64(0), 1), "regular_of_streams": (np.int64(0), 1), "regular_telegram": (np.int64(0), 1),
        "regular_send": (np.int64(0), 1), "between_streams": (np.int64(0), 1),
        "regular_between_streams": (np.int64(0), 1), "between_lists": (np.int64(0), 1),
        "regular_between_lists": (np.int64(0), 1),
    }  # fmt: skip

    def counts_on(self, between: str) -> Bool:
        """Tell which nodes count on from one of their ``streams``, or ``lists``, to another in most of these steps.

        Who counts beyond one stream does: a fast stream beside rare ones shows nothing.
        """
        told: Bool = 2 * self.column(f"regular_between_{between}") > self.column(f"between_{between}")
        return told


class Loss:
    """The sequences of all streams and nodes, and the events of their steps by stream (``events_of``)."""

    def __init__(self) -> None:
        self.streams = StreamSequences()
        self.nodes = NodeSequences()
        self._events = {(step, walk): EventRows() for step in _TOLD for walk in range(WALKS)}

    def observe(self, told: Told, rows: DataRows) -> tuple[Steps, NodeSteps]:
        """Walk the counters of a batch; return the streams' own steps, and the nodes' steps, row by row."""
        keys = told.keys
        self.streams.resize(len(keys.streams))
        self.nodes.resize(len(keys.nodes))
        for log in self._events.values():
            log.resize(len(keys.streams))
        own = self._walk_streams(rows, keys)
        nodes = self._walk_nodes(told, rows, own, keys)
        self._book(told, rows, own, Scope.STREAM)
        self._book(told, rows, nodes, Scope.NODE_TELEGRAM)
        return own, nodes

    def resume(self, unheard: Unheard) -> None:
        """Let the sequences of the unheard begin anew."""
        streams, nodes = self.streams.own_rows(unheard.streams), self.nodes.own_rows(unheard.nodes)
        self.streams.missing[streams] = 0
        self.nodes.missing[nodes] = 0
        self.nodes.last_stream[nodes] = NO_STREAM
        if unheard.everything:
            self.streams.moved[:] = False

    def take(self, part: Loss, share: Share) -> None:
        """Take over the sequences of a part's share of the senders."""
        self.streams.take(part.streams, share.streams)
        self.nodes.take(part.nodes, share.nodes)
        for key, log in self._events.items():
            log.take(part._events[key], share.streams)

    def _walk_streams(self, rows: DataRows, keys: Keys) -> Steps:
        streams, run = self.streams, rows.run_stream
        again = Repeated(_places(rows.repeated), rows.start)
        counter = rows.counter
        if len(again):
            counter = counter.copy()
            streams.repeated[run] += np.bincount(again.sequence, minlength=len(run))
        steps = again.walk(counter, streams.current[run], streams.missing[run], rows.fresh)
        streams.current[run], streams.missing[run] = steps.current, steps.missing
        streams.telegrams[run] += rows.stop - rows.start
        streams.begun[run] += rows.fresh
        resting, waiting = ~streams.moved[run], ~streams.counting[run]
        # Rows that take no step: the first of a sequence, those in front of the second value, and repeated ones.
        idle = (rows.fresh & ~waiting).astype(np.int64)
        if resting.any():  # as all are that wait
            moved = (steps.step != Step.SAME) & (steps.step != Step.NONE)
            moved[again.place] = False
            moves = np.flatnonzero(moved)
            first = np.append(moves, len(rows))[np.searchsorted(moves, rows.start)]
            has_moved = first < rows.stop
            streams.moved[run] |= has_moved
            streams.counting[run] |= has_moved
            begins = np.where(waiting, np.minimum(first, rows.stop), rows.start)
            idle += begins - rows.start
            steps.step[np.arange(len(rows)) < np.repeat(begins, rows.stop - rows.start)] = Step.NONE
            steps.irregular = np.flatnonzero(steps.step != Step.REGULAR)
        late = again.place[steps.step[again.place] == Step.LATE]
        idle += np.bincount(np.searchsorted(rows.start, late, "right") - 1, minlength=len(run))
        irregular = np.diff(np.searchsorted(steps.irregular, np.append(rows.start, len(rows))))
        streams.steps[run] += rows.stop - rows.start - idle
        streams.regular[run] += rows.stop - rows.start - irregular
        np.add.at(self.nodes.regular_of_streams, keys.node_of(run), rows.stop - rows.start - irregular)
        last = (rows.signature_before >> COUNTER_SHIFT).astype(np.uint16)
        swapped = swapped_steps(steps, steps.irregular, rows.start, last, lambda place: rows.counter[place])
        np.add.at(streams.swapped, run[swapped], 1)
        return steps

    def _walk_nodes(self, told: Told, rows: DataRows, own: Steps, keys: Keys) -> NodeSteps:
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
        repeated = None if rows.repeated is None else _are_among(packet, rows.packet[rows.repeated], len(told))
        again = Repeated(_places(repeated), start)
        fresh = nodes.last_stream[run] == NO_STREAM
        steps = again.walk(told.counter.take(packet), nodes.current[run], nodes.missing[run], fresh)
        node_of_stream = keys.node_of(np.arange(len(keys.streams)))
        run_of_stream = np.searchsorted(run, node_of_stream)
        time_ns = told.packets.ts_ns
        before_ns = np.where(fresh, time_ns[packet[start]], nodes.last_ns[run])
        order = NodeOrder(packet, start, rows, run_of_stream, time_ns, before_ns)
        bounds = np.append(start, len(packet))
        length = stop - start
        regular = length - np.diff(np.searchsorted(steps.irregular, bounds))
        nodes.steps[run] += length - fresh - np.bincount(again.sequence, minlength=len(run))
        nodes.regular_telegram[run] += regular
        nodes.regular_send[run] += regular
        last = keys.varieties.stream[told.variety[packet[stop - 1]]]
        if (np.bincount(node_of_stream[node_of_stream >= 0])[run] > 1).any():
            changes = Changes(told, keys, packet, start, nodes.last_stream[run], again)
            nodes.regular_send[run] += changes.within_sends(steps)
            nodes.between_streams[run] += changes.between_streams
            nodes.between_lists[run] += changes.between_lists
            of_streams, of_lists = changes.regular(steps)
            nodes.regular_between_streams[run] += of_streams
            nodes.regular_between_lists[run] += of_lists
            last = changes.last_stream
        if len(own.irregular):
            # What is regular within its stream counts in the right byte order, whatever came from the node in between.
            places = np.sort(order.place[own.irregular])
            swapped = swapped_steps(steps, places, start, nodes.last[run], lambda place: told.counter[packet[place]])
            np.add.at(nodes.swapped, run[swapped], 1)
        nodes.current[run], nodes.missing[run] = steps.current, steps.missing
        nodes.last_stream[run] = last
        nodes.last_ns[run], nodes.last[run] = time_ns[packet[stop - 1]], told.counter[packet[stop - 1]]
        gaps = steps.at(Step.GAP)
        before = np.searchsorted(gaps, bounds)
        counted = nodes.gaps[run] - before[:-1]
        nodes.gaps[run] += np.diff(before)
        return NodeSteps(steps, order, gaps, counted)

    def _book(self, told: Told, rows: DataRows, steps: Steps | NodeSteps, scope: Scope) -> None:
        streams, first_frame = self.streams, told.first_frame
        for kind in _TOLD:
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
            elif kind == Step.RESTART:
                streams.restarts[stream, scope] += count
            else:
                streams.duplicates[stream, scope] += count
            self._events[kind, scope].add(stream, start, stop, rows.time_ns, rows.packet, place, first_frame)
            if told.is_heard:
                known = getattr(streams, _COUNTED[kind])[stream, scope] - count
                self._tell(told, kind, scope, rows, steps, (stream, start, stop), known, place, lost)

    def _tell(
        self, told: Told, step: Step, scope: Scope, rows: DataRows, steps: Steps | NodeSteps,
        runs: tuple[I64, I64, I64], known: I64, place: I64, lost: I64 | None,
    ) -> None:  # fmt: skip
        """Tell of the steps at some places, in the order of the capture, as far as they are rare.

        ``runs`` are those of one stream each among the places, ``known`` how many such steps each stream had before.
        """
        stream, start, stop = runs
        asked = np.flatnonzero(self._is_in_question(told.keys.node_of(stream), scope))
        if not len(asked):
            return
        stream, known, count = stream[asked], known[asked], (stop - start)[asked]
        chosen = spans(start[asked], count)
        of_rows = np.searchsorted(rows.run_stream, stream)
        begins = rows.start[of_rows]
        length = rows.stop[of_rows] - begins
        stop = np.cumsum(count)
        rare = rare_ones(
            _RARE, known, self.streams.telegrams[stream] - length, begins, length, stop - count, stop, place[chosen]
        )  # fmt: skip
        if rare is not None:
            chosen = chosen[rare]
        order = chosen[np.argsort(rows.packet[place[chosen]], kind="stable")]
        if not len(order):
            return
        place = place[order]
        before = steps if isinstance(steps, NodeSteps) else rows
        lists, node, subindex = told.keys.described(rows.stream[place])
        behind = -steps.distance_at(place).astype(np.int64) & 0xFFFF if step == Step.OVERTAKEN else None
        told.tell(
            EventBatch.of(
                _TOLD[step], rows.time_ns[place], rows.packet[place] + told.first_frame, lists=lists, node=node,
                subindex=subindex, since_ns=before.times_before(place),
                amount=None if lost is None else lost[order], detail=behind, scope=scope,
            )
        )  # fmt: skip

    def _is_in_question(self, node: I64, scope: Scope) -> Bool:
        """Tell of which nodes Counter may count in a scope: in no other one are clearly more of its steps regular."""
        nodes = self.nodes
        of_streams, of_telegrams = nodes.regular_of_streams[node], nodes.regular_telegram[node]
        if scope != Scope.STREAM:
            ahead = of_streams - np.maximum(of_telegrams, nodes.regular_send[node])
        else:
            # Telegrams of one sending look regular in a node that counts by stream, too: what it counts from one stream
            # to another decides (``nvscope.tracker.scopes``).
            of_telegrams = np.where(nodes.counts_on("streams")[node], of_telegrams, 0)
            of_sendings = np.where(nodes.counts_on("lists")[node], nodes.regular_send[node], 0)
            ahead = np.maximum(of_telegrams, of_sendings) - of_streams
        told: Bool = ahead <= _CLEARLY
        return told

    def byte_swapped(self, keys: Keys) -> Bool:
        """Tell which streams have a Counter that is written byte-swapped: their own, or that of all of their node."""
        own, nodes = self.streams, self.nodes
        node = keys.node_of(np.arange(len(own)))  # of those on CAN -1, which is the last one below
        of_stream = byte_swapped(own.column("steps"), own.column("regular"), own.column("swapped"))
        regular = np.maximum(nodes.column("regular_telegram"), nodes.column("regular_send"))
        of_node = np.append(byte_swapped(nodes.column("steps"), regular, nodes.column("swapped")), False)
        told: Bool = of_stream | of_node[node]
        return told

    def events_of(self, step: Step, scope: Scope) -> EventRows:
        """Return the events of a step in a scope, by stream; those of duplicates are of the step LATE."""
        return self._events[step, min(scope, Scope.NODE_TELEGRAM)]  # both node scopes take the same steps


def _places(chosen: Bool | None) -> I64:
    """Return the places where a mask is set; None has none."""
    return np.empty(0, np.int64) if chosen is None else np.flatnonzero(chosen)


def _are_among(packet: I64, some: I64, packets: int) -> Bool:
    """Tell which packets are among some others, all of them less than ``packets``."""
    among = np.zeros(packets, np.bool_)
    among[some] = True
    return among.take(packet)


def _runs(place: I64, rows: DataRows) -> tuple[I64, I64, I64]:
    """Part rising places into runs of one stream; return the streams and the bounds of the runs in ``place``."""
    bounds = np.searchsorted(place, np.append(rows.start, len(rows)))
    run = np.flatnonzero(bounds[1:] > bounds[:-1])
    return rows.run_stream[run], bounds[run], bounds[run + 1]
