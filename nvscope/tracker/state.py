"""TrackerState: everything that is known of the traffic so far, as a value made of integers.

``observe`` takes packets in batches; however they are cut, the state is the same. What is derived from it (means,
percentiles, the scope of a sender's Counter, findings) is computed when somebody asks (``nvscope.tracker.summary``).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dissectors.batch import I64, U64, Bool, PacketBatch
from dissectors.can.pdo import PdoRules
from dissectors.netvar import (
    CHECKSUM_INVALID,
    HEADER,
    IDENTITY_ASCII,
    RESERVED_FLAGS,
    Fault,
    PortRules,
    Service,
    TelegramBatch,
)
from dissectors.varieties import NO_TELEGRAM, Choose, SortedPackets, Sorter
from nvscope.engine.flows import Flows, Kind
from nvscope.engine.keyed_columns import Columns
from nvscope.engine.rows import DataRows, StreamMemory
from nvscope.tracker.acknowledgement import TIMEOUT_NS, Acknowledgement, Messages
from nvscope.tracker.can.state import CanState, no_steps
from nvscope.tracker.consistency import Consistency
from nvscope.tracker.counters import DiagError
from nvscope.tracker.cycles import Cycles
from nvscope.tracker.errors import ErrorEvents, Errors
from nvscope.tracker.events import EventLog
from nvscope.tracker.loss import Loss, NodeSteps
from nvscope.tracker.recent import Recent
from nvscope.tracker.sequence import Steps
from nvscope.tracker.timing import Intervals, Timing

if TYPE_CHECKING:
    from nvscope.tracker.variables.values import Values

MAX_BATCH = 1 << 17

FAULT_CODES = {
    Fault.SHORT: 101,
    Fault.LENGTH: 102,
    Fault.SERVICE: 103,
    Fault.BYTE_SWAPPED: 105,
}
RESERVED_FLAGS_CODE, ASCII_CODE, TRUNCATED_CODE = 104, 106, 107
NO_ACKNOWLEDGEMENT_CODE, NEGATIVE_CODE, UNEXPECTED_CODE, BOOT_UP_CODE, REJECTED_CODE = 301, 302, 303, 304, 305
SHAPE_CODE, CHECKSUM_CODE, FLAGS_CODE = 402, 403, 404
PDO_LENGTH_CODE = 603
CLOCK_STEP_CODE = 902

_REJECTED = {
    Service.ODStateFree: DiagError.UDPSENDATA,
    Service.ODAcknowledgement: DiagError.UDPSENDACKN,
    Service.ODBootUpRequest: DiagError.UDPSENDBOOTUPREQUEST,
}


class ListColumns(Columns):
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

    ``events`` are the events that are findings as they stand, keyed by ``finding_key``. Frame numbers count from 1
    across all that was observed. ``repeated`` counts telegrams that equal the one before them byte for byte.
    ``values`` are those of the variables, where their definition is known; ``chosen`` counts the telegrams chosen.

    ``choose`` is a filter: it is asked of each batch which packets hold telegrams that it chooses. Flows count these,
    and only these give values; everything else looks at all telegrams, so that no filter makes up a loss.
    """

    def __init__(
        self,
        timeout_ns: int = TIMEOUT_NS,
        ports: PortRules | None = None,
        *,
        values: Values | None = None,
        choose: Choose | None = None,
        pdos: PdoRules | None = None,
    ) -> None:
        self._pdos = pdos or PdoRules()
        self._sorter = Sorter(ports, self._pdos)
        self.values = values
        self.choose = choose
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
        self.flows = Flows(self._pdos)
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
    def choosable(self) -> int:
        """How many telegrams and CAN frames there are, of which a filter chooses."""
        return self.telegrams + self.can.frames

    def observe(self, packets: PacketBatch) -> None:
        """Take the packets that follow those observed so far."""
        for start in range(0, len(packets), MAX_BATCH):
            self._observe(self._sorter.sort(packets[start : start + MAX_BATCH]))

    def _observe(self, batch: SortedPackets) -> None:
        first_frame = self.frames + 1
        self._observe_frames(batch, first_frame)
        count = self.flows.observe(batch, first_frame)
        chosen = None
        if self.choose is not None:
            chosen = self.choose(batch)
            self.chosen += int(np.count_nonzero(chosen))
            self.flows.choose(batch, chosen)
        errors = self._observe_quoted(batch.quoted, first_frame)
        self.lists.resize(len(self.flows.lists))
        self._observe_headers(batch, first_frame)
        errors += self._observe_lists(batch, count, first_frame, chosen)
        self.errors.observe(errors, len(self.flows.lists))
        if batch.can is not None:
            self.can.observe(batch.can, first_frame)
            self._observe_pdos(batch, count, first_frame, chosen)
        self.frames += len(batch)
        self.telegrams += len(batch) - int(count[NO_TELEGRAM]) - int(count[batch.varieties.on_can].sum())

    def _observe_frames(self, batch: SortedPackets, first_frame: int) -> None:
        time_ns = batch.packets.ts_ns
        before = np.empty_like(time_ns)
        before[1:] = time_ns[:-1]
        before[0] = time_ns[0] if self.last_ns is None else self.last_ns
        back = np.flatnonzero(time_ns < before)
        if len(back):
            self.longest_step_back_ns = max(self.longest_step_back_ns, int((before[back] - time_ns[back]).max()))
            nobody = np.full(len(back), -1)
            self._log(CLOCK_STEP_CODE, nobody, nobody, nobody, time_ns[back], back + first_frame)
        earliest, latest = int(time_ns.min()), int(time_ns.max())
        self.start_ns = earliest if self.start_ns is None else min(self.start_ns, earliest)
        self.end_ns = latest if self.end_ns is None else max(self.end_ns, latest)
        self.last_ns = int(time_ns[-1])
        self.fragments += batch.fragments
        if batch.unsupported is not None:
            links = batch.packets.link[batch.unsupported]
            for link, count in zip(*np.unique(links, return_counts=True), strict=True):
                self.unsupported[int(link)] = self.unsupported.get(int(link), 0) + int(count)

    def _observe_headers(self, batch: SortedPackets, first_frame: int) -> None:
        """Note what is wrong with headers, and count truncated telegrams."""
        ours, theirs = self.flows.varieties, batch.varieties
        if not ours.column("odd").any():
            return
        odd = np.flatnonzero(ours.odd[batch.variety])
        if not len(odd):
            return
        variety = batch.variety[odd]
        kind, node, lists, subindex = ours.kind[variety], ours.node[variety], ours.list[variety], ours.subindex[variety]
        header, fault, truncated = theirs.header[variety], theirs.fault[variety], theirs.truncated[variety]
        reserved = ((header["flags"] & RESERVED_FLAGS) != 0) & (kind <= Kind.BOOT_UP_REQUEST)
        masks = [(code, fault == kind_of_fault) for kind_of_fault, code in FAULT_CODES.items()]
        masks.append((RESERVED_FLAGS_CODE, reserved))
        masks.append((ASCII_CODE, header["identity"] == IDENTITY_ASCII))
        masks.append((TRUNCATED_CODE, truncated))
        for code, mask in masks:
            row = np.flatnonzero(mask)
            if len(row):
                when, frame = batch.packets.ts_ns[odd[row]], odd[row] + first_frame
                self._log(code, lists[row], node[row], subindex[row], when, frame)
        np.add.at(self.lists.truncated, lists[truncated & (lists >= 0)], 1)

    def _log(self, code: int, lists: I64, node: I64, subindex: I64, time_ns: I64, frame: I64) -> None:
        self.events.record(*finding_key(code, lists, node, subindex), time_ns, frame)

    def _observe_quoted(self, quoted: TelegramBatch, first_frame: int) -> list[ErrorEvents]:
        """Book the telegrams that ICMP messages say were not delivered."""
        errors: list[ErrorEvents] = []
        if not len(quoted):
            return errors
        service = quoted.header["id"]
        mine = np.isin(service, [s.value for s in _REJECTED])
        quoted, service = quoted.take(mine), service[mine]
        datagram = quoted.datagram
        frame = datagram.row + first_frame
        lists = self.flows.lists.numbers(
            datagram.destination_port.astype(np.uint64), quoted.header["index"].astype(np.uint64)
        )
        node = self.flows.nodes.numbers(datagram.source_hi, datagram.source_lo)
        told = datagram.captured_bytes >= HEADER.offset_of("items")
        subindex = np.where(told, quoted.header["subindex"].astype(np.int64), -1)
        self._log(REJECTED_CODE, lists, node, subindex, quoted.ts_ns, frame)
        self.lists.resize(len(self.flows.lists))
        np.add.at(self.lists.send_rejected, lists, 1)
        for kind, error in _REJECTED.items():
            row = np.flatnonzero(service == kind)
            errors.append(ErrorEvents(error, True, lists[row], node[row], quoted.ts_ns[row], frame[row]))
        return errors

    def _observe_lists(
        self, batch: SortedPackets, count: I64, first_frame: int, chosen: Bool | None
    ) -> list[ErrorEvents]:
        acknowledgements = self._messages(batch, count, Kind.ACKNOWLEDGEMENT)
        requests = self._messages(batch, count, Kind.BOOT_UP_REQUEST)
        rows = self.memory.rows(batch, count, self.flows)
        errors = self._observe_answers(batch, rows, acknowledgements, requests, first_frame)
        if len(rows):
            self.data_telegrams += len(rows)
            self.repeated += 0 if rows.repeated is None else int(np.count_nonzero(rows.repeated))
            own, nodes = self.loss.observe(batch, rows, self.flows, first_frame)
            intervals = self._observe_intervals(rows, own, nodes, first_frame)
            usual_ns = self.timing.columns.usual_ns
            self.cycles.observe(rows, rows.counter, intervals.usual, usual_ns, self.flows, first_frame)
            errors.append(self._observe_consistency(rows, first_frame))
            if self.values is not None:
                self.values.observe(batch, rows, self.flows, first_frame, chosen)
        return errors

    def _observe_intervals(self, rows: DataRows, own: Steps, nodes: NodeSteps, first_frame: int) -> Intervals:
        intervals = self.timing.observe(rows, own, nodes, len(self.flows.streams), first_frame)
        if len(intervals.stream):
            self.recent.observe(intervals.stream, intervals.time_ns, intervals.interval_ns)
        return intervals

    def _log_rows(self, code: int, rows: DataRows, place: I64, first_frame: int) -> None:
        """Note something of some rows, in the order of the capture."""
        if len(place):
            row = place[np.argsort(rows.packet[place])]
            lists, node, subindex = self.described(rows.stream[row])
            self._log(code, lists, node, subindex, rows.time_ns[row], rows.packet[row] + first_frame)

    def _observe_pdos(self, batch: SortedPackets, count: I64, first_frame: int, chosen: Bool | None) -> None:
        """Take the data frames of CAN: they have a time, a length and variables, and nothing else to go by."""
        rows = self.memory.rows(batch, count, self.flows, Kind.PDO)
        if not len(rows):
            return
        self.loss.streams.resize(len(self.flows.streams))
        intervals = self._observe_intervals(rows, *no_steps(len(rows)), first_frame)
        usual_ns = self.timing.columns.usual_ns
        self.can.observe_cycles(rows, intervals.usual, usual_ns, self.flows, self._pdos, first_frame)
        changed = self.consistency.changed_shapes(rows, rows.changes(), self.flows)
        self._log_rows(PDO_LENGTH_CODE, rows, changed, first_frame)
        if self.values is not None:
            self.values.observe(batch, rows, self.flows, first_frame, chosen)

    def _messages(self, batch: SortedPackets, count: I64, kind: Kind) -> Messages:
        """Pick the telegrams of one kind that is not DATA."""
        varieties, flows = self.flows.varieties, self.flows.columns
        mine = varieties.column("kind") == kind
        row = np.flatnonzero(mine[batch.variety]) if count[mine].any() else np.empty(0, np.int64)
        number = np.flatnonzero(mine)
        place, destination = varieties.place[number], flows.destination[varieties.flow[number]]
        target = np.full(len(varieties), -1)
        # Nobody's stream has the number of a broadcast's destination.
        target[number] = self.flows.streams.find(place.astype(np.uint64), destination.view(np.uint64))
        variety = batch.variety[row]
        flow = varieties.flow[variety]
        return Messages(
            row, batch.packets.ts_ns[row], flows.list[flow], flows.place[flow], flows.source[flow],
            flows.destination[flow], target[variety], batch.varieties.header["flags"][variety],
        )  # fmt: skip

    def _observe_answers(
        self, batch: SortedPackets, rows: DataRows, acknowledgements: Messages, requests: Messages, first_frame: int
    ) -> list[ErrorEvents]:
        time_ns = batch.packets.ts_ns
        answers = self.acknowledgement.observe(rows, acknowledgements, requests, time_ns, self.flows, first_frame)
        places = self.flows.places
        stream, time_ns, frame = answers.missing
        if len(stream):
            lists, sender, subindex = self.described(stream)
            self._log(NO_ACKNOWLEDGEMENT_CODE, lists, sender, subindex, time_ns, frame)
            np.add.at(self.lists.missing_acknowledgements, lists, 1)
        negative = np.flatnonzero(acknowledgements.flags & CHECKSUM_INVALID.mask)
        for code, row, node in (
            (NEGATIVE_CODE, negative, answers.negative_node),
            (UNEXPECTED_CODE, answers.unexpected, acknowledgements.source[answers.unexpected]),
        ):
            subindex = places.low[acknowledgements.place[row]].astype(np.int64)
            frame = acknowledgements.packet[row] + first_frame
            self._log(code, acknowledgements.list[row], node, subindex, acknowledgements.time_ns[row], frame)
        np.add.at(self.lists.negative_acknowledgements, acknowledgements.list[negative], 1)
        waits = answers.unanswered
        if len(waits):
            nobody = np.full(len(waits), -1)
            subindex = places.low[waits.place].astype(np.int64)
            self._log(BOOT_UP_CODE, waits.list, nobody, subindex, waits.deadline_ns, waits.frame)
            np.add.at(self.lists.bootup_unanswered, waits.list, 1)
        return answers.errors

    def _observe_consistency(self, rows: DataRows, first_frame: int) -> ErrorEvents:
        """Note changes of shape, checksum and flags."""
        changed, mismatch, strange = self.consistency.observe(rows, self.flows)
        for code, place in ((SHAPE_CODE, changed), (CHECKSUM_CODE, mismatch), (FLAGS_CODE, strange)):
            self._log_rows(code, rows, place, first_frame)
        np.add.at(self.flows.columns.mismatches, self.flows.varieties.flow[rows.variety[mismatch]], 1)
        lists, node, _ = self.described(rows.stream[mismatch])
        frame = rows.packet[mismatch] + first_frame
        return ErrorEvents(DiagError.CHECKSUM, True, lists, node, rows.time_ns[mismatch], frame)

    def described(self, stream: I64) -> tuple[I64, I64, I64]:
        """Return the list number, node number and SubIndex of streams."""
        place = self.flows.place_of(stream)
        node = self.flows.node_of(stream)
        return self.flows.places.high[place].astype(np.int64), node, self.flows.places.low[place].astype(np.int64)


def finding_key(code: int, lists: I64, node: I64, subindex: I64) -> tuple[U64, U64]:
    """Return the key of ``TrackerState.events``: numbers of list and node, and SubIndex, -1 each for none."""
    high = (np.uint64(code) << np.uint64(32)) | (lists + 1).astype(np.uint64)
    return high, ((node + 1).astype(np.uint64) << np.uint64(32)) | (subindex + 1).astype(np.uint64)


def finding_parts(high: int, low: int) -> tuple[int, int, int, int]:
    """Take a key of ``TrackerState.events`` apart: code, list, node, SubIndex, -1 each for none."""
    return high >> 32, (high & 0xFFFFFFFF) - 1, (low >> 32) - 1, (low & 0xFFFFFFFF) - 1
