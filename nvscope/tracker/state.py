"""TrackerState: everything that is known of the traffic so far, as a value made of integers.

``observe`` takes packets in batches; however they are cut, the state is the same. What is derived from it (means,
percentiles, the scope of a sender's Counter, findings) is computed when somebody asks (``nvscope.tracker.summary``).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dissectors.batch import I64, U64
from dissectors.netvar import (
    CHECKSUM_INVALID,
    HEADER,
    IDENTITY_ASCII,
    RESERVED_FLAGS,
    Fault,
    Service,
)
from dissectors.varieties import NO_TELEGRAM
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import FrameKind, Keys
from nvscope.engine.reading import TIMEOUT_NS
from nvscope.engine.rows import DataRows, StreamMemory
from nvscope.engine.told import Told
from nvscope.tracker.acknowledgement import Acknowledgement, Messages
from nvscope.tracker.can.state import CanState, no_steps
from nvscope.tracker.consistency import Consistency
from nvscope.tracker.counters import DiagError
from nvscope.tracker.cycles import Cycles
from nvscope.tracker.errors import ErrorEvents, Errors
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.events import EventLog
from nvscope.tracker.flows import Flows
from nvscope.tracker.loss import Loss, NodeSteps
from nvscope.tracker.recent import Recent
from nvscope.tracker.steps import Steps
from nvscope.tracker.timing import BatchIntervals, Timing

if TYPE_CHECKING:
    from nvscope.tracker.variables.values import Values

_OF_FAULT = {
    Fault.SHORT: EventKind.SHORT,
    Fault.LENGTH: EventKind.LENGTH_MISMATCH,
    Fault.SERVICE: EventKind.UNKNOWN_SERVICE,
    Fault.BYTE_SWAPPED: EventKind.LENGTH_BYTE_SWAPPED,
}

_REJECTED = {
    Service.ODStateFree: DiagError.UDPSENDATA,
    Service.ODAcknowledgement: DiagError.UDPSENDACKN,
    Service.ODBootUpRequest: DiagError.UDPSENDBOOTUPREQUEST,
}


class ListColumns(KeyedColumns):
    """One row a list: the counts that are no sums over flows."""

    truncated: I64
    missing_acknowledgements: I64
    negative_acknowledgements: I64
    bootup_unanswered: I64
    send_rejected: I64
    COLUMNS: ClassVar = {
        name: (np.int64(0), 1)
        for name in (
            "truncated", "missing_acknowledgements", "negative_acknowledgements", "bootup_unanswered", "send_rejected",
        )
    }  # fmt: skip


class TrackerState:
    """What is on the wire; what is on CAN buses besides data is in ``can``.

    ``events`` are the events that are findings as they stand, keyed by ``event_key``. Frame numbers count from 1
    across all that was observed. ``repeated`` counts telegrams that equal the one before them byte for byte.
    ``values`` are those of the variables, where their definition is known; ``chosen`` counts the telegrams chosen.

    A filter chooses telegrams: flows count these, and only these give values; everything else looks at all telegrams,
    so that no filter makes up a loss.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, timeout_ns: int = TIMEOUT_NS, *, values: Values | None = None) -> None:
        self.values = values
        self.chosen = 0
        self.frames = 0
        self.telegrams = 0
        self.data_telegrams = 0
        self.repeated = 0
        self.fragments = 0
        self.unsupported: dict[int, int] = {}
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self.last_ns: int | None = None
        self.longest_step_back_ns = 0
        self.can = CanState()
        self.flows = Flows()
        self.memory = StreamMemory()
        self.loss = Loss()
        self.timing = Timing()
        self.recent = Recent()
        self.cycles = Cycles()
        self.consistency = Consistency()
        self.acknowledgement = Acknowledgement(timeout_ns)
        self.errors = Errors()
        self.lists = ListColumns()
        self.events = EventLog()

    @property
    def keys(self) -> Keys:
        """What the numbers of lists, nodes, places, streams and flows stand for."""
        return self.flows.keys

    @property
    def choosable(self) -> int:
        """How many telegrams and CAN frames there are, of which a filter chooses."""
        return self.telegrams + self.can.frames

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self._observe_frames(told)
        self.flows.observe(told)
        self.memory = told.laid.memory
        if told.chosen is not None:
            self.chosen += int(np.count_nonzero(told.chosen))
        errors = self._observe_rejected(told)
        self.lists.resize(len(self.keys.lists))
        self._observe_headers(told)
        errors += self._observe_lists(told)
        self.errors.observe(errors, len(self.keys.lists))
        if told.can is not None:
            self.can.observe(told.can, told.first_frame)
            self._observe_pdos(told)
        self.frames += len(told)
        self.telegrams += len(told) - int(told.count[NO_TELEGRAM]) - int(told.count[told.varieties.on_can].sum())

    def _observe_frames(self, told: Told) -> None:
        time_ns, batch, first_frame = told.packets.ts_ns, told.batch, told.first_frame
        before = np.empty_like(time_ns)
        before[1:] = time_ns[:-1]
        before[0] = time_ns[0] if self.last_ns is None else self.last_ns
        back = np.flatnonzero(time_ns < before)
        if len(back):
            self.longest_step_back_ns = max(self.longest_step_back_ns, int((before[back] - time_ns[back]).max()))
            nobody = np.full(len(back), -1)
            self._log(EventKind.CLOCK_STEPPED_BACK, nobody, nobody, nobody, time_ns[back], back + first_frame)
        earliest, latest = int(time_ns.min()), int(time_ns.max())
        self.start_ns = earliest if self.start_ns is None else min(self.start_ns, earliest)
        self.end_ns = latest if self.end_ns is None else max(self.end_ns, latest)
        self.last_ns = int(time_ns[-1])
        self.fragments += batch.fragments
        if batch.unsupported is not None:
            links = batch.packets.link[batch.unsupported]
            for link, count in zip(*np.unique(links, return_counts=True), strict=True):
                self.unsupported[int(link)] = self.unsupported.get(int(link), 0) + int(count)

    def _observe_headers(self, told: Told) -> None:
        """Note what is wrong with headers, and count truncated telegrams."""
        ours, theirs, first_frame = self.keys.varieties, told.varieties, told.first_frame
        if not ours.column("odd").any():
            return
        odd = np.flatnonzero(ours.odd[told.variety])
        if not len(odd):
            return
        variety = told.variety[odd]
        kind, node, lists, subindex = ours.kind[variety], ours.node[variety], ours.list[variety], ours.subindex[variety]
        header, fault, truncated = theirs.header[variety], theirs.fault[variety], theirs.truncated[variety]
        reserved = ((header["flags"] & RESERVED_FLAGS) != 0) & (kind <= FrameKind.BOOT_UP_REQUEST)
        masks = [(event, fault == kind_of_fault) for kind_of_fault, event in _OF_FAULT.items()]
        masks.append((EventKind.RESERVED_FLAGS, reserved))
        masks.append((EventKind.ASCII_IDENTITY, header["identity"] == IDENTITY_ASCII))
        masks.append((EventKind.TRUNCATED, truncated))
        for event, mask in masks:
            row = np.flatnonzero(mask)
            if len(row):
                when, frame = told.packets.ts_ns[odd[row]], odd[row] + first_frame
                self._log(event, lists[row], node[row], subindex[row], when, frame)
        np.add.at(self.lists.truncated, lists[truncated & (lists >= 0)], 1)

    def _log(self, event: EventKind, lists: I64, node: I64, subindex: I64, time_ns: I64, frame: I64) -> None:
        self.events.record(*event_key(event, lists, node, subindex), time_ns, frame)

    def _observe_rejected(self, told: Told) -> list[ErrorEvents]:
        """Book the telegrams that ICMP messages say were not delivered."""
        errors: list[ErrorEvents] = []
        quoted, lists, node = told.laid.rejected
        if not len(quoted):
            return errors
        datagram, service = quoted.datagram, quoted.header["id"]
        frame = datagram.row + told.first_frame
        known = datagram.captured_bytes >= HEADER.offset_of("items")
        subindex = np.where(known, quoted.header["subindex"].astype(np.int64), -1)
        self._log(EventKind.SEND_REJECTED, lists, node, subindex, quoted.ts_ns, frame)
        self.lists.resize(len(self.keys.lists))
        np.add.at(self.lists.send_rejected, lists, 1)
        for kind, error in _REJECTED.items():
            row = np.flatnonzero(service == kind)
            errors.append(ErrorEvents(error, True, lists[row], node[row], quoted.ts_ns[row], frame[row]))
        return errors

    def _observe_lists(self, told: Told) -> list[ErrorEvents]:
        acknowledgements = self._messages(told, FrameKind.ACKNOWLEDGEMENT)
        requests = self._messages(told, FrameKind.BOOT_UP_REQUEST)
        rows, first_frame = told.laid.data, told.first_frame
        errors = self._observe_answers(told, rows, acknowledgements, requests)
        if len(rows):
            self.data_telegrams += len(rows)
            self.repeated += 0 if rows.repeated is None else int(np.count_nonzero(rows.repeated))
            own, nodes = self.loss.observe(told, rows, self.keys, first_frame)
            intervals = self._observe_intervals(rows, own, nodes, first_frame)
            usual_ns = self.timing.columns.usual_ns
            self.cycles.observe(rows, rows.counter, intervals.usual, usual_ns, self.keys, first_frame)
            errors.append(self._observe_consistency(rows, first_frame))
            if self.values is not None:
                self.values.observe(told, rows)
        return errors

    def _observe_intervals(self, rows: DataRows, own: Steps, nodes: NodeSteps, first_frame: int) -> BatchIntervals:
        intervals = self.timing.observe(rows, own, nodes, len(self.keys.streams), first_frame)
        if len(intervals.stream):
            self.recent.observe(intervals.stream, intervals.time_ns, intervals.interval_ns)
        return intervals

    def _log_rows(self, event: EventKind, rows: DataRows, place: I64, first_frame: int) -> None:
        """Note something of some rows, in the order of the capture."""
        if len(place):
            row = place[np.argsort(rows.packet[place])]
            lists, node, subindex = self.described(rows.stream[row])
            self._log(event, lists, node, subindex, rows.time_ns[row], rows.packet[row] + first_frame)

    def _observe_pdos(self, told: Told) -> None:
        """Take the data frames of CAN: they have a time, a length and variables, and nothing else to go by."""
        rows, first_frame = told.laid.pdos, told.first_frame
        if not len(rows):
            return
        self.loss.streams.resize(len(self.keys.streams))
        intervals = self._observe_intervals(rows, *no_steps(len(rows)), first_frame)
        usual_ns = self.timing.columns.usual_ns
        self.can.observe_cycles(rows, intervals.usual, usual_ns, self.keys, told.pdos, first_frame)
        changed = self.consistency.changed_shapes(rows, rows.changes(), self.keys)
        self._log_rows(EventKind.PDO_LENGTH_CHANGED, rows, changed, first_frame)
        if self.values is not None:
            self.values.observe(told, rows)

    def _messages(self, told: Told, kind: FrameKind) -> Messages:
        """Pick the telegrams of one kind that is not DATA."""
        varieties, flows = self.keys.varieties, self.keys.columns
        mine = varieties.column("kind") == kind
        row = np.flatnonzero(mine[told.variety]) if told.count[mine].any() else np.empty(0, np.int64)
        number = np.flatnonzero(mine)
        place, destination = varieties.place[number], flows.destination[varieties.flow[number]]
        target = np.full(len(varieties), -1)
        # Nobody's stream has the number of a broadcast's destination.
        target[number] = self.keys.streams.find(place.astype(np.uint64), destination.view(np.uint64))
        variety = told.variety[row]
        flow = varieties.flow[variety]
        return Messages(
            row, told.packets.ts_ns[row], flows.list[flow], flows.place[flow], flows.source[flow],
            flows.destination[flow], target[variety], told.varieties.header["flags"][variety],
        )  # fmt: skip

    def _observe_answers(
        self, told: Told, rows: DataRows, acknowledgements: Messages, requests: Messages
    ) -> list[ErrorEvents]:
        time_ns, first_frame = told.packets.ts_ns, told.first_frame
        answers = self.acknowledgement.observe(rows, acknowledgements, requests, time_ns, self.keys, first_frame)
        places = self.keys.places
        stream, time_ns, frame = answers.missing
        if len(stream):
            lists, sender, subindex = self.described(stream)
            self._log(EventKind.NO_ACKNOWLEDGEMENT, lists, sender, subindex, time_ns, frame)
            np.add.at(self.lists.missing_acknowledgements, lists, 1)
        negative = np.flatnonzero(acknowledgements.flags & CHECKSUM_INVALID.mask)
        for event, row, node in (
            (EventKind.NEGATIVE_ACKNOWLEDGEMENT, negative, answers.negative_node),
            (EventKind.UNEXPECTED_ACKNOWLEDGEMENT, answers.unexpected, acknowledgements.source[answers.unexpected]),
        ):
            subindex = places.low[acknowledgements.place[row]].astype(np.int64)
            frame = acknowledgements.packet[row] + first_frame
            self._log(event, acknowledgements.list[row], node, subindex, acknowledgements.time_ns[row], frame)
        np.add.at(self.lists.negative_acknowledgements, acknowledgements.list[negative], 1)
        waits = answers.unanswered
        if len(waits):
            nobody = np.full(len(waits), -1)
            subindex = places.low[waits.place].astype(np.int64)
            self._log(EventKind.BOOT_UP_UNANSWERED, waits.list, nobody, subindex, waits.deadline_ns, waits.frame)
            np.add.at(self.lists.bootup_unanswered, waits.list, 1)
        return answers.errors

    def _observe_consistency(self, rows: DataRows, first_frame: int) -> ErrorEvents:
        """Note changes of shape, checksum and flags."""
        changed, mismatch, strange = self.consistency.observe(rows, self.keys)
        for event, place in (
            (EventKind.SHAPE_CHANGED, changed),
            (EventKind.CHECKSUM_CHANGED, mismatch),
            (EventKind.FLAGS_INCONSISTENT, strange),
        ):
            self._log_rows(event, rows, place, first_frame)
        np.add.at(self.flows.counts.mismatches, self.keys.varieties.flow[rows.variety[mismatch]], 1)
        lists, node, _ = self.described(rows.stream[mismatch])
        frame = rows.packet[mismatch] + first_frame
        return ErrorEvents(DiagError.CHECKSUM, True, lists, node, rows.time_ns[mismatch], frame)

    def described(self, stream: I64) -> tuple[I64, I64, I64]:
        """Return the list number, node number and SubIndex of streams."""
        place = self.keys.place_of(stream)
        node = self.keys.node_of(stream)
        return self.keys.places.high[place].astype(np.int64), node, self.keys.places.low[place].astype(np.int64)


def event_key(event: EventKind, lists: I64, node: I64, subindex: I64) -> tuple[U64, U64]:
    """Return the key of ``TrackerState.events``: kind, numbers of list and node, and SubIndex, -1 each for none."""
    high = (np.uint64(event) << np.uint64(32)) | (lists + 1).astype(np.uint64)
    return high, ((node + 1).astype(np.uint64) << np.uint64(32)) | (subindex + 1).astype(np.uint64)


def event_parts(high: int, low: int) -> tuple[int, int, int, int]:
    """Take a key of ``TrackerState.events`` apart: kind, list, node, SubIndex, -1 each for none."""
    return high >> 32, (high & 0xFFFFFFFF) - 1, (low >> 32) - 1, (low & 0xFFFFFFFF) - 1
