"""CanOpen: the CANopen nodes of each channel, by their heartbeats and emergencies, and what the NMT master told them.

Frames are taken by identifier and length, and many a bus has such frames without any CANopen. A node is told only with
evidence: a heartbeat or boot-up of its own, an NMT command, or an SDO request with its answer (CiA 301, 7.2.4 and
7.2.8). Each is some only while most frames of its COB-IDs are such: a counter of another protocol meets the states and
commands now and then. Heartbeats are none any more from the frame on with which half of the frames from the first of
them on are no heartbeats; of NMT commands and SDOs, all frames count (``nvscope.tracker.can.majority``).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, U16, U32, Bool
from dissectors.can.canopen import MAX_COB_ID, MAX_NODES, NMT_COMMANDS, NODE_STATES, PREDEFINED, Service, use_of
from dissectors.can.frame import CanBatch
from dissectors.keys import KeyTable
from dissectors.layout import gather_bytes
from nvscope.engine.events import EventBatch
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.tracker.can.canopen_columns import NO_STATE, NodeColumns
from nvscope.tracker.can.majority import NEVER, Majorities
from nvscope.tracker.can.sdo import LastSdo, weighed
from nvscope.tracker.event_kinds import EventKind

_SERVICES = {service.name: service for service in PREDEFINED}
_NMT, _EMCY, _HEARTBEAT = (_SERVICES[name] for name in ("NMT", "EMCY", "heartbeat"))
_ASKED, _ANSWERED = (_SERVICES[name] for name in ("SDO request", "SDO answer"))
_OTHER, _IS_NMT, _IS_EMCY, _IS_HEARTBEAT, _IS_ASKED, _IS_ANSWERED = range(6)
_NMT_BYTES, _EMCY_BYTES, _HEARTBEAT_BYTES, _SDO_BYTES = 2, 8, 1, 8
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


class Evidence(Struct, frozen=True):
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


class Emergency(Struct, frozen=True):
    """An emergency: its error code, the error register, and when it was sent."""

    code: int
    register: int
    time_ns: int


class CanOpenNode(Struct, frozen=True):
    """A node that sent heartbeats, or emergencies.

    ``state`` is one of ``NODE_STATES``, since ``since_ns``: what its heartbeats tell, or where it sends none, what it
    was commanded to (``commanded``). ``last_ns`` is when it sent a heartbeat or emergency last. ``changes`` counts
    those of its state, ``boot_ups`` the boot-up messages. Behind a time in which nobody listened, a state is known from
    its first heartbeat or command on, and is no change.
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
    """Of nodes, the frames from which on there is evidence of them, and up to which, by what it is.

    Each has the frames of heartbeats, NMT commands and SDOs; ``NEVER`` where there are none.
    """

    since: tuple[I64, ...]
    until: tuple[I64, ...]

    def at(self, frame: int) -> Bool:
        """Return of which nodes there is evidence by all that came up to a frame, with itself."""
        shown = [(one <= frame) & (frame < end) for one, end in zip(self.since, self.until, strict=True)]
        any_of: Bool = np.logical_or.reduce(shown)
        return any_of


class CanOpen:
    """CANopen nodes: ``nodes`` number the rows of ``columns`` and ``sdo``, ``channels`` those of ``nmt``."""

    def __init__(self) -> None:
        self.nodes, self.channels = KeyTable(), KeyTable(1)
        self.columns = NodeColumns()
        self.sdo, self.nmt = Majorities(), Majorities()
        self._last_sdo = LastSdo()

    def observe(self, told: Told, batch: CanBatch) -> None:
        """Take the CAN frames of what is told."""
        kind = _KIND.take(batch.identifier, mode="clip")
        row = np.flatnonzero(kind)
        if not len(row):
            return
        other = batch.extended[row] | batch.error[row] | batch.remote[row] | (batch.fault[row] != 0)
        row = row[~other]
        kind = kind[row]
        for codes, observe in (
            ((_IS_HEARTBEAT, _IS_HEARTBEAT), self._observe_heartbeats),
            ((_IS_EMCY, _IS_EMCY), self._observe_emergencies), ((_IS_NMT, _IS_NMT), self._observe_commands),
            ((_IS_ASKED, _IS_ANSWERED), self._observe_sdos),
        ):  # fmt: skip
            own = row[(kind >= codes[0]) & (kind <= codes[1])]
            if len(own):
                observe(told, batch, own)

    def resume(self, unheard: Unheard) -> None:
        """Let what follows on unheard channels begin anew: nobody knows what was said and commanded meanwhile."""
        node = np.flatnonzero(np.isin(self.nodes.high, unheard.channels.astype(np.uint64)))
        self.columns.heard[node] = False
        self.columns.command_frame[node] = 0
        self._last_sdo.forget(node)

    def take(self, part: CanOpen) -> None:
        """Take over the nodes of other channels."""
        row = self.columns.take_keyed(self.nodes, part.columns, part.nodes.words)
        self._resize()
        self.sdo.put(row, part.sdo)
        self._last_sdo.put(row, part._last_sdo)
        self.nmt.take_keyed(self.channels, part.nmt, part.channels.words)

    def _numbers(self, channel: U16, node: U32 | U8) -> I64:
        number = self.nodes.numbers(channel.astype(np.uint64), node.astype(np.uint64))
        self._resize()
        return number

    def _resize(self) -> None:
        for table in (self.columns, self.sdo, self._last_sdo):
            table.resize(len(self.nodes))

    def _tell(self, told: Told, kind: EventKind, batch: CanBatch, row: I64, number: I64, amount: I64) -> None:
        """Tell of some frames, of the nodes that are numbered so."""
        node = self.nodes.low[number].astype(np.int64)
        channel, frame = batch.channel[row].astype(np.int64), batch.row[row] + told.first_frame
        told.tell(EventBatch.of(kind, batch.ts_ns[row], frame, channel=channel, amount=amount, detail=node))

    def _observe_heartbeats(self, told: Told, batch: CanBatch, row: I64) -> None:
        state = (batch.data[batch.at[row]] & np.uint8(_STATE_BITS)).astype(np.int64)  # node guarding toggles bit 7
        known = np.isin(state, list(NODE_STATES)) & (batch.length[row] == _HEARTBEAT_BYTES) & ~batch.fd[row]
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
        before[start] = np.where(columns.heard[run], columns.state[run], NO_STATE)
        columns.heard[run] = True
        changed = state != before
        since = np.maximum.accumulate(np.where(changed, np.arange(len(state)), -1))[last]
        fresh = since >= start
        columns.since_ns[run[fresh]] = time_ns[since[fresh]]
        columns.state[run] = state[last]
        columns.last_ns[run] = time_ns[last]
        columns.heartbeats[run] += stop - start
        np.minimum.at(columns.beats_from, number, batch.row[row] + told.first_frame)
        np.add.at(columns.boot_ups, number[state == 0], 1)
        np.add.at(columns.changes, number[changed & (before != NO_STATE)], 1)
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
        row = row[_has_bytes(batch, row, _EMCY_BYTES)]
        if not len(row):
            return
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
        channel = self.channels.numbers(batch.channel[row].astype(np.uint64))
        self.nmt.resize(len(self.channels))
        order = stable_order(channel, len(self.channels))
        channel, row = channel[order], row[order]
        known = _has_bytes(batch, row, _NMT_BYTES)
        command, node = batch.data[batch.at[row] * known], batch.data[(batch.at[row] + 1) * known]
        known &= np.isin(command, list(NMT_COMMANDS)) & (node <= MAX_NODES)
        own = known.astype(np.int64)
        self.nmt.weigh(channel, batch.row[row] + told.first_frame, own, 1 - own, known)
        channel, row, command, node = channel[known], row[known], command[known], node[known]
        if not len(row):
            return
        number = self._numbers(batch.channel[row], node)
        order = stable_order(number, len(self.nodes))
        number, row, command, channel = number[order], row[order], command[order], channel[order]
        start, stop = runs_of(number)
        run, last, columns = number[start], stop - 1, self.columns
        columns.commands[run] += stop - start
        columns.command[run] = command[last]
        columns.command_ns[run] = batch.ts_ns[row[last]]
        columns.command_frame[run] = batch.row[row[last]] + told.first_frame
        np.minimum.at(columns.told_from, number, batch.row[row] + told.first_frame)
        if told.is_heard:
            trusted = self.nmt.has_shown(channel, batch.row[row] + told.first_frame)
            row, number, command = row[trusted], number[trusted], command[trusted]
            self._tell(told, EventKind.NODE_COMMAND, batch, row, number, command.astype(np.int64))

    def _observe_sdos(self, told: Told, batch: CanBatch, row: I64) -> None:
        asks = _KIND[batch.identifier[row]] == _IS_ASKED
        node = batch.identifier[row] - np.where(asks, _ASKED.first - 1, _ANSWERED.first - 1).astype(np.uint32)
        number = self._numbers(batch.channel[row], node)
        order = stable_order(number, len(self.nodes))
        number, row, asks = number[order], row[order], asks[order]
        fits = _has_bytes(batch, row, _SDO_BYTES)
        word = np.zeros(len(row), np.int64)
        word[fits] = gather_bytes(batch.data, batch.at[row[fits]], 4).view("<u4").reshape(-1)
        weights = weighed(self._last_sdo, number, batch.ts_ns[row], word, asks, fits)
        self.sdo.weigh(number, batch.row[row] + told.first_frame, *weights)

    def since(self, lists: Collection[int] = ()) -> Since:
        """Return of each of ``nodes`` the frames from which on there is evidence of it.

        The COB-IDs of ``lists`` are not CANopen's.
        """
        count, columns, sdo = len(self.nodes), self.columns, self.sdo
        node, taken = self.nodes.low.astype(np.int64), np.array(sorted(lists), np.int64)
        row_of = self._rows_of_channels()
        channel = np.array([row_of.get(one, -1) for one in self.nodes.high.tolist()], np.int64)

        def of_channel(frame: I64) -> I64:
            return np.append(frame, NEVER)[channel]  # -1: nothing of NMT was seen there

        def first(frame: I64, *services: Service) -> I64:
            for service in services:
                cob_id = node + (service.first - 1) if service.by_node else np.full(count, service.first)
                frame = np.where(np.isin(cob_id, taken), NEVER, frame)
            return frame

        told_from = np.maximum(columns.column("told_from"), of_channel(self.nmt.column("since")))
        return Since(
            (
                first(columns.column("beats_from"), _HEARTBEAT), first(told_from, _NMT),
                first(sdo.column("since"), _ASKED, _ANSWERED),
            ),
            (columns.column("doubted_from").copy(), of_channel(self.nmt.column("until")), sdo.column("until").copy()),
        )  # fmt: skip

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
            commanded = _NMT.first not in lists and self._is_commanded(channel)
            nodes = (
                self._node(node, row_of[node], (row_of[node], row_of.get(0)) if commanded else (), lists)
                for node in sorted(row_of) if node
            )  # fmt: skip
            seen = evidence.get(channel, NO_EVIDENCE)
            found[channel] = [
                node for node in nodes if seen.of_node(node.node) and (node.heartbeats or node.emergencies)
            ]
        return found

    def _rows_of_channels(self) -> dict[int, int]:
        """Return the row of each channel; of a copy, the table finds what came later too."""
        return {channel: row for row, channel in enumerate(self.channels.words[0].tolist())}

    def _is_commanded(self, channel: int) -> bool:
        """Tell whether most frames on a channel with the COB-ID of NMT are commands."""
        row = self._rows_of_channels().get(channel)
        return row is not None and bool(self.nmt.has_shown(np.array([row]), np.array([NEVER - 1]))[0])

    def _node(
        self, node: int, row: int, commands: tuple[int | None, ...], lists: Collection[int]
    ) -> CanOpenNode:  # fmt: skip
        """Return a node; ``commands`` are the rows of what it was commanded."""
        columns = self.columns
        is_known = _cob_id(_HEARTBEAT, node) not in lists and columns.doubted_from[row] == NEVER
        heartbeats = int(columns.heartbeats[row]) if is_known else 0
        emergencies = 0 if _cob_id(_EMCY, node) in lists else int(columns.emergencies[row])
        state = since_ns = None
        if heartbeats:
            state, since_ns = int(columns.state[row]), int(columns.since_ns[row])
        elif commands:
            told = max(
                (place for place in commands if place is not None),
                key=lambda place: int(columns.command_frame[place]),
            )
            if columns.command_frame[told]:
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


def _has_bytes(batch: CanBatch, row: I64, length: int) -> Bool:
    """Tell which frames are classic ones of so many bytes."""
    has: Bool = (batch.length[row] == length) & ~batch.fd[row]
    return has


def _cob_id(service: Service, node: int) -> int:
    return service.first + node - 1
