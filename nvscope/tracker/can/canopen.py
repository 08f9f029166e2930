"""CanOpen: the CANopen nodes of each channel, by their heartbeats and emergencies, and what the NMT master told them.

Frames are taken by identifier and length, and many a bus has such frames without any CANopen. A node is told only with
evidence: a heartbeat or boot-up of its own, an NMT command, or SDO requests and answers (CiA 301, 7.2.4 and 7.2.8).
Heartbeats are none any more from the frame on with which, from the first of them on, half of the frames of their COB-ID
are no heartbeats: a counter of another protocol meets the states now and then.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, U8, U16, U32, U64, Bool
from dissectors.can.canopen import MAX_COB_ID, MAX_NODES, NMT_COMMANDS, NODE_STATES, PREDEFINED, Service, use_of
from dissectors.can.frame import CanBatch
from dissectors.keys import KeyTable
from dissectors.layout import gather_bytes
from nvscope.engine.events import EventBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.tracker.event_kinds import EventKind

_SERVICES = {service.name: service for service in PREDEFINED}
_NMT, _EMCY, _HEARTBEAT = (_SERVICES[name] for name in ("NMT", "EMCY", "heartbeat"))
_ASKED, _ANSWERED = (_SERVICES[name] for name in ("SDO request", "SDO answer"))
_OTHER, _IS_NMT, _IS_EMCY, _IS_HEARTBEAT, _IS_ASKED, _IS_ANSWERED = range(6)
_BYTES = {_IS_NMT: 2, _IS_EMCY: 8, _IS_HEARTBEAT: 1, _IS_ASKED: 8, _IS_ANSWERED: 8}
_NO_STATE = -1
NEVER = int(np.iinfo(np.int64).max)
"""In place of a frame number that there is not yet."""
_STATE_BITS = 0x7F
_AFTER_COMMAND = {1: 5, 2: 4, 128: 127, 129: 0, 130: 0}
"""The state that a node has after an NMT command, by the command's code."""


def _kinds() -> U8:
    kind = np.zeros(MAX_COB_ID + 1, np.uint8)
    for code, service in (
        (_IS_NMT, _NMT), (_IS_EMCY, _EMCY), (_IS_HEARTBEAT, _HEARTBEAT), (_IS_ASKED, _ASKED),
        (_IS_ANSWERED, _ANSWERED),
    ):  # fmt: skip
        kind[service.first : service.last + 1] = code
    return kind


_KIND = _kinds()


class _NodeColumns(KeyedColumns):
    """One row a channel and node; node 0 has the commands to all. Frame numbers are 0, states -1 where there are none.

    ``emergency`` are the eight bytes of the last one, as a number, the first byte lowest. ``strays`` are the frames
    behind the first heartbeat, of its COB-ID, that are none. The last five are the frames in which a heartbeat, a
    command, an SDO request and an answer came first, and with which heartbeats ceased to be evidence; else ``NEVER``.
    """

    heartbeats: I64
    strays: I64
    boot_ups: I64
    changes: I64
    state: I64
    since_ns: I64
    last_ns: I64
    emergencies: I64
    emergency: U64
    emergency_ns: I64
    commands: I64
    command: I64
    command_ns: I64
    command_frame: I64
    beats_from: I64
    told_from: I64
    asked_from: I64
    answered_from: I64
    doubted_from: I64
    COLUMNS: ClassVar = {
        "heartbeats": (np.int64(0), 1),
        "strays": (np.int64(0), 1),
        "boot_ups": (np.int64(0), 1),
        "changes": (np.int64(0), 1),
        "state": (np.int64(_NO_STATE), 1),
        "since_ns": (np.int64(0), 1),
        "last_ns": (np.int64(0), 1),
        "emergencies": (np.int64(0), 1),
        "emergency": (np.uint64(0), 1),
        "emergency_ns": (np.int64(0), 1),
        "commands": (np.int64(0), 1),
        "command": (np.int64(0), 1),
        "command_ns": (np.int64(0), 1),
        "command_frame": (np.int64(0), 1),
        "beats_from": (np.int64(NEVER), 1),
        "told_from": (np.int64(NEVER), 1),
        "asked_from": (np.int64(NEVER), 1),
        "answered_from": (np.int64(NEVER), 1),
        "doubted_from": (np.int64(NEVER), 1),
    }


@dataclass(frozen=True, slots=True)
class Evidence:
    """Of which nodes of a channel there is evidence that they are CANopen's; 0: the NMT master spoke to all."""

    nodes: frozenset[int] = frozenset()

    def of_node(self, node: int) -> bool:
        """Tell whether there is evidence of a node."""
        return node in self.nodes or 0 in self.nodes

    def of_cob_id(self, cob_id: int) -> bool:
        """Tell whether frames of a COB-ID are CANopen's; those of no one node are, where there is any evidence."""
        service, node = use_of(cob_id)
        return bool(service and self.nodes) and (not node or self.of_node(node))


NO_EVIDENCE = Evidence()


@dataclass(frozen=True, slots=True)
class Emergency:
    """An emergency: its error code, the error register, and when it was sent."""

    code: int
    register: int
    time_ns: int


@dataclass(frozen=True, slots=True)
class CanOpenNode:
    """A node that sent heartbeats, or emergencies.

    ``state`` is one of ``NODE_STATES``, since ``since_ns``: what its heartbeats tell, or where it sends none, what it
    was commanded to (``commanded``). ``last_ns`` is when it sent a heartbeat or emergency last. ``changes`` counts
    those of its state, ``boot_ups`` the boot-up messages.
    """

    node: int
    state: int | None
    since_ns: int | None
    commanded: bool
    last_ns: int
    heartbeats: int
    changes: int
    boot_ups: int
    emergencies: int
    emergency: Emergency | None


class Since(NamedTuple):
    """Of nodes, the frames from which on there is evidence of them; ``NEVER`` where there is none.

    ``lasting`` is evidence that stays; heartbeats are some from ``beats`` on, until ``doubted``.
    """

    lasting: I64
    beats: I64
    doubted: I64

    def at(self, frame: int) -> Bool:
        """Return of which nodes there is evidence by all that came up to a frame, with itself."""
        return (self.lasting <= frame) | ((self.beats <= frame) & (frame < self.doubted))


class CanOpen:
    """The CANopen nodes that were seen; ``nodes`` number the rows of ``columns``."""

    def __init__(self) -> None:
        self.nodes = KeyTable()
        self.columns = _NodeColumns()

    def observe(self, told: Told, batch: CanBatch) -> None:
        """Take the CAN frames of what is told."""
        kind = _KIND.take(batch.identifier, mode="clip")
        row = np.flatnonzero(kind)
        if not len(row):
            return
        other = batch.extended[row] | batch.error[row] | batch.remote[row] | (batch.fault[row] != 0)
        beats = row[(kind[row] == _IS_HEARTBEAT) & ~other]
        if len(beats):
            self._observe_heartbeats(told, batch, beats)
        other |= batch.fd[row]
        kind, length = kind[row], batch.length[row]
        for code, observe in (
            (_IS_EMCY, self._observe_emergencies),
            (_IS_NMT, self._observe_commands), (_IS_ASKED, self._observe_requests),
            (_IS_ANSWERED, self._observe_answers),
        ):  # fmt: skip
            own = row[(kind == code) & (length == _BYTES[code]) & ~other]
            if len(own):
                observe(told, batch, own)

    def take(self, part: CanOpen) -> None:
        """Take over the nodes of other channels."""
        self.columns.take_keyed(self.nodes, part.columns, part.nodes.words)

    def _numbers(self, channel: U16, node: U32 | U8) -> I64:
        number = self.nodes.numbers(channel.astype(np.uint64), node.astype(np.uint64))
        self.columns.resize(len(self.nodes))
        return number

    def _tell(self, told: Told, kind: EventKind, batch: CanBatch, row: I64, number: I64, amount: I64) -> None:
        """Tell of some frames, of the nodes that are numbered so."""
        node = self.nodes.low[number].astype(np.int64)
        channel, frame = batch.channel[row].astype(np.int64), batch.row[row] + told.first_frame
        told.tell(EventBatch.of(kind, batch.ts_ns[row], frame, channel=channel, amount=amount, detail=node))

    def _observe_heartbeats(self, told: Told, batch: CanBatch, row: I64) -> None:
        state = (batch.data[batch.at[row]] & np.uint8(_STATE_BITS)).astype(np.int64)  # node guarding toggles bit 7
        known = np.isin(state, list(NODE_STATES)) & (batch.length[row] == _BYTES[_IS_HEARTBEAT]) & ~batch.fd[row]
        number = self._numbers(batch.channel[row], _node_of(batch, row, _HEARTBEAT))
        order = stable_order(number, len(self.nodes))
        number, state, row, known = number[order], state[order], row[order], known[order]
        self._observe_strays(number, known, batch.row[row] + told.first_frame)
        number, state, row = number[known], state[known], row[known]
        if not len(row):
            return
        time_ns = batch.ts_ns[row]
        start, stop = runs_of(number)
        run, last, columns = number[start], stop - 1, self.columns
        before = np.empty_like(state)
        before[1:] = state[:-1]
        before[start] = columns.state[run]
        changed = state != before
        since = np.maximum.accumulate(np.where(changed, np.arange(len(state)), -1))[last]
        fresh = since >= start
        columns.since_ns[run[fresh]] = time_ns[since[fresh]]
        columns.state[run] = state[last]
        columns.last_ns[run] = time_ns[last]
        columns.heartbeats[run] += stop - start
        np.minimum.at(columns.beats_from, number, batch.row[row] + told.first_frame)
        np.add.at(columns.boot_ups, number[state == 0], 1)
        np.add.at(columns.changes, number[changed & (before != _NO_STATE)], 1)
        if told.is_heard:
            trusted = batch.row[row] + told.first_frame < columns.doubted_from[number]
            new = np.flatnonzero((changed | (state == 0)) & trusted)
            self._tell(told, EventKind.NODE_STATE, batch, row[new], number[new], state[new])

    def _observe_strays(self, number: I64, is_beat: Bool, frame: I64) -> None:
        """Take all frames of the COB-IDs of heartbeats, those of each node together; those before are counted."""
        start, stop = runs_of(number)
        run, count, columns = number[start], stop - start, self.columns

        def so_far(which: Bool, before: I64) -> I64:
            total = np.cumsum(which)
            return total - np.repeat(total[start] - which[start] - before[run], count)

        beats = so_far(is_beat, columns.heartbeats)
        is_stray = ~is_beat & (beats > 0)
        strays = so_far(is_stray, columns.strays)
        doubted = np.flatnonzero(is_stray & (strays >= beats))
        np.minimum.at(columns.doubted_from, number[doubted], frame[doubted])
        columns.strays[run] = strays[stop - 1]

    def _observe_emergencies(self, told: Told, batch: CanBatch, row: I64) -> None:
        number = self._numbers(batch.channel[row], _node_of(batch, row, _EMCY))
        order = stable_order(number, len(self.nodes))
        number, row = number[order], row[order]
        start, stop = runs_of(number)
        run, last, columns = number[start], row[stop - 1], self.columns
        columns.emergencies[run] += stop - start
        columns.emergency[run] = gather_bytes(batch.data, batch.at[last], 8).view("<u8").reshape(-1)
        columns.emergency_ns[run] = batch.ts_ns[last]
        if told.is_heard:
            code = gather_bytes(batch.data, batch.at[row], 2).view("<u2").reshape(-1).astype(np.int64)
            self._tell(told, EventKind.EMERGENCY, batch, row, number, code)

    def _observe_commands(self, told: Told, batch: CanBatch, row: I64) -> None:
        command, node = batch.data[batch.at[row]], batch.data[batch.at[row] + 1]
        known = np.isin(command, list(NMT_COMMANDS)) & (node <= MAX_NODES)
        row, command, node = row[known], command[known], node[known]
        number = self._numbers(batch.channel[row], node)
        order = stable_order(number, len(self.nodes))
        number, row, command = number[order], row[order], command[order]
        start, stop = runs_of(number)
        run, last, columns = number[start], stop - 1, self.columns
        columns.commands[run] += stop - start
        columns.command[run] = command[last]
        columns.command_ns[run] = batch.ts_ns[row[last]]
        columns.command_frame[run] = batch.row[row[last]] + told.first_frame
        np.minimum.at(columns.told_from, number, batch.row[row] + told.first_frame)
        if told.is_heard:
            self._tell(told, EventKind.NODE_COMMAND, batch, row, number, command.astype(np.int64))

    def _observe_requests(self, told: Told, batch: CanBatch, row: I64) -> None:
        number = self._numbers(batch.channel[row], _node_of(batch, row, _ASKED))
        np.minimum.at(self.columns.asked_from, number, batch.row[row] + told.first_frame)

    def _observe_answers(self, told: Told, batch: CanBatch, row: I64) -> None:
        number = self._numbers(batch.channel[row], _node_of(batch, row, _ANSWERED))
        np.minimum.at(self.columns.answered_from, number, batch.row[row] + told.first_frame)

    def since(self, lists: Collection[int] = ()) -> Since:
        """Return of each of ``nodes`` the frames from which on there is evidence of it.

        The COB-IDs of ``lists`` are not CANopen's.
        """
        count, columns = len(self.nodes), self.columns
        node, taken = self.nodes.low.astype(np.int64), np.array(sorted(lists), np.int64)

        def first(frame: I64, service: Service) -> I64:
            cob_id = node + (service.first - 1) if service.by_node else np.full(count, service.first)
            return np.where(np.isin(cob_id, taken), NEVER, frame[:count])

        talks = np.maximum(first(columns.asked_from, _ASKED), first(columns.answered_from, _ANSWERED))
        lasting = np.minimum(talks, first(columns.told_from, _NMT))
        return Since(lasting, first(columns.beats_from, _HEARTBEAT), columns.doubted_from[:count].copy())

    def evidence(self, lists: Collection[int] = ()) -> dict[int, Evidence]:
        """Return by channel of which nodes there is evidence; the COB-IDs of ``lists`` are not CANopen's."""
        found: dict[int, set[int]] = defaultdict(set)
        evident = np.flatnonzero(self.since(lists).at(NEVER - 1))
        for channel, node in zip(self.nodes.high[evident].tolist(), self.nodes.low[evident].tolist(), strict=True):
            found[channel].add(node)
        return {channel: Evidence(frozenset(nodes)) for channel, nodes in found.items()}

    def by_channel(self, lists: Collection[int] = ()) -> dict[int, list[CanOpenNode]]:
        """Return the nodes of each channel that has some with evidence; COB-IDs of ``lists`` are not CANopen's."""
        evidence = self.evidence(lists)
        rows: dict[int, dict[int, int]] = defaultdict(dict)
        for row, (channel, node) in enumerate(zip(self.nodes.high.tolist(), self.nodes.low.tolist(), strict=True)):
            rows[channel][node] = row
        found = {}
        for channel, row_of in rows.items():
            nodes = (self._node(node, row_of[node], row_of.get(0), lists) for node in sorted(row_of) if node)
            seen = evidence.get(channel, NO_EVIDENCE)
            found[channel] = [
                node for node in nodes if seen.of_node(node.node) and (node.heartbeats or node.emergencies)
            ]
        return found

    def _node(self, node: int, row: int, everybody: int | None, lists: Collection[int]) -> CanOpenNode:
        columns = self.columns
        is_known = _cob_id(_HEARTBEAT, node) not in lists and columns.doubted_from[row] == NEVER
        heartbeats = int(columns.heartbeats[row]) if is_known else 0
        emergencies = 0 if _cob_id(_EMCY, node) in lists else int(columns.emergencies[row])
        state = since_ns = None
        if heartbeats:
            state, since_ns = int(columns.state[row]), int(columns.since_ns[row])
        elif _NMT.first not in lists:
            told = max(
                (place for place in (row, everybody) if place is not None),
                key=lambda place: int(columns.command_frame[place]),
            )
            if columns.commands[told]:
                state, since_ns = _AFTER_COMMAND[int(columns.command[told])], int(columns.command_ns[told])
        emergency = None
        if emergencies:
            raw = int(columns.emergency[row])
            emergency = Emergency(raw & 0xFFFF, raw >> 16 & 0xFF, int(columns.emergency_ns[row]))
        last_ns = max(int(columns.last_ns[row]) if heartbeats else 0, emergency.time_ns if emergency else 0)
        return CanOpenNode(
            node, state, since_ns, state is not None and not heartbeats, last_ns, heartbeats,
            int(columns.changes[row]) if heartbeats else 0, int(columns.boot_ups[row]) if heartbeats else 0,
            emergencies, emergency,
        )  # fmt: skip


def _node_of(batch: CanBatch, row: I64, service: Service) -> U32:
    node: U32 = batch.identifier[row] - np.uint32(service.first - 1)
    return node


def _cob_id(service: Service, node: int) -> int:
    return service.first + node - 1
