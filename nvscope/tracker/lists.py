"""ListState: what the telegrams of each list show, whoever sends or reads it."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dissectors.batch import I64
from dissectors.netvar import (
    CHECKSUM_INVALID,
    HEADER,
    IDENTITY_ASCII,
    RESERVED_FLAGS,
    Fault,
    Service,
)
from nvscope.engine.dealing import Share, SplitBy
from nvscope.engine.events import NOWHERE, EventBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import CHECKSUM_SHIFT, FLAGS_SHIFT, SHAPE_MASK, FrameKind, Keys
from nvscope.engine.rows import DataRows
from nvscope.engine.told import Told
from nvscope.tracker.acknowledgement import Acknowledgement
from nvscope.tracker.consistency import Consistency
from nvscope.tracker.counter_takeovers import CounterTakeovers
from nvscope.tracker.diagnosis import DiagError
from nvscope.tracker.errors import ErrorEvents, Errors
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.flows import Flows
from nvscope.tracker.length_fields import LengthFields
from nvscope.tracker.list_log import ListLog
from nvscope.tracker.several_senders import SeveralSenders
from nvscope.tracker.waits import BootUpWaits, Messages, Waits

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


_NO_SHIFT, _BYTE = np.uint64(0), np.uint64(0xFF)
_PART_OF_SIGNATURE = {
    EventKind.SHAPE_CHANGED: (_NO_SHIFT, SHAPE_MASK),
    EventKind.PDO_LENGTH_CHANGED: (_NO_SHIFT, SHAPE_MASK),
    EventKind.CHECKSUM_CHANGED: (CHECKSUM_SHIFT, _BYTE),
    EventKind.FLAGS_INCONSISTENT: (FLAGS_SHIFT, _BYTE),
}
"""What is told of a telegram's signature, by what is wrong with it."""


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


class ListState:
    """All lists: their flows, what is wrong with headers, who did not answer, where senders disagree, and values.

    ``events`` are those that are findings as they stand. ``values`` are those of the variables, where their definition
    is known.
    """

    SPLIT_BY: ClassVar = SplitBy.LIST

    def __init__(self, values: Values | None = None) -> None:
        self.values = values
        self.flows = Flows()
        self.columns = ListColumns()
        self.several_senders = SeveralSenders()
        self.consistency = Consistency()
        self.counter_takeovers = CounterTakeovers()
        self.acknowledgement = Acknowledgement()
        self.errors = Errors()
        self.events = ListLog()
        self.length_fields = LengthFields()

    @property
    def keys(self) -> Keys:
        """What the numbers of lists, nodes, places, streams and flows stand for."""
        return self.flows.keys

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        errors: list[ErrorEvents] = []
        self.acknowledgement.timeout_ns = told.timeout_ns
        self.acknowledgement.hears_answers = told.hears_answers
        if len(told):
            self.several_senders.observe(told, self.flows)
            self.flows.observe(told)
            errors += self._observe_rejected(told)
            self.columns.resize(len(self.keys.lists))
            self._observe_headers(told)
            errors += self._observe_data(told)
        if told.until_ns is not None:
            errors += self._expire(told)
        for unheard in told.unheard:
            next_frame = told.first_frame + len(told)
            self.several_senders.resume(unheard, self.flows, told.laid.memory, next_frame)
            self.acknowledgement.resume(unheard)
            self.consistency.resume(unheard)
            self.counter_takeovers.resume(unheard)
            if self.values is not None:
                self.values.resume(unheard)
        self.errors.observe(errors, len(self.keys.lists))
        self.events.settle()

    def take(self, part: ListState, share: Share) -> None:
        """Take over what a part has counted of its share of the lists."""
        self.flows.keys = share.keys
        self.flows.counts.take(part.flows.counts, share.flows)
        self.columns.take(part.columns, share.lists)
        self.several_senders.take(part.several_senders, share)
        self.consistency.take(part.consistency, share)
        self.counter_takeovers.take(part.counter_takeovers, share)
        self.acknowledgement.take(part.acknowledgement, share)
        self.errors.take(part.errors, share)
        self.events.take(part.events)
        self.length_fields.take(part.length_fields, share)
        if self.values is not None and part.values is not None:
            self.values.take(part.values, share)

    def _observe_data(self, told: Told) -> list[ErrorEvents]:
        rows = told.laid.data
        errors = self._observe_answers(told, rows)
        if len(rows):
            errors.append(self._observe_consistency(told, rows))
            self.counter_takeovers.observe(rows, self.keys, told.first_frame)
            if self.values is not None:
                self.values.observe(told, rows)
        frames = told.laid.pdos
        if len(frames):
            changed = self.consistency.changed_shapes(frames, frames.changes(), self.keys)
            self._log_rows(told, EventKind.PDO_LENGTH_CHANGED, frames, changed)
            if self.values is not None:
                self.values.observe(told, frames)
        return errors

    def _observe_headers(self, told: Told) -> None:
        """Note what is wrong with headers, and count truncated telegrams."""
        ours, theirs = self.keys.varieties, told.varieties.telegrams
        strange = ours.column("odd")
        if not strange.any():
            return
        in_data = strange & (ours.column("kind") == FrameKind.DATA)
        if told.count[in_data].any():
            odd = np.flatnonzero(strange[told.variety])
        else:
            others = told.laid.data.others
            odd = others[strange[told.variety[others]]]
        if not len(odd):
            return
        variety = told.variety[odd]
        kind, node, lists, subindex = ours.kind[variety], ours.node[variety], ours.list[variety], ours.subindex[variety]
        part = told.varieties.part[variety]
        header, fault, truncated = theirs.header[part], theirs.fault[part], theirs.truncated[part]
        reserved = ((header["flags"] & RESERVED_FLAGS) != 0) & (kind <= FrameKind.BOOT_UP_REQUEST)
        masks = [(event, fault == kind_of_fault) for kind_of_fault, event in _OF_FAULT.items()]
        masks.append((EventKind.RESERVED_FLAGS, reserved))
        masks.append((EventKind.ASCII_IDENTITY, header["identity"] == IDENTITY_ASCII))
        masks.append((EventKind.TRUNCATED, truncated))
        for event, mask in masks:
            row = np.flatnonzero(mask)
            if len(row):
                events = EventBatch.of(
                    event, told.packets.ts_ns[odd[row]], odd[row] + told.first_frame, lists=lists[row],
                    node=node[row], subindex=subindex[row],
                )  # fmt: skip
                self._log(told, events)
        misfits = np.flatnonzero((fault == Fault.LENGTH) | (fault == Fault.BYTE_SWAPPED))
        if len(misfits):
            self.length_fields.observe(told, odd[misfits], lists[misfits], node[misfits])
        np.add.at(self.columns.truncated, lists[truncated & (lists >= 0)], 1)

    def _log(self, told: Told, events: EventBatch) -> None:
        """Note events that are findings as they stand, and tell them."""
        if len(events):
            self.events.hear(events)
            told.tell(events)

    def _observe_rejected(self, told: Told) -> list[ErrorEvents]:
        """Book the telegrams that ICMP messages say were not delivered."""
        errors: list[ErrorEvents] = []
        quoted, lists, node, receiver, by, code = told.laid.rejected
        if not len(quoted) or not told.hears_answers:
            return errors
        datagram, service = quoted.datagram, quoted.header["id"]
        frame = datagram.row + told.first_frame
        known = datagram.captured_bytes >= HEADER.offset_of("items")
        subindex = np.where(known, quoted.header["subindex"].astype(np.int64), -1)
        rejected = EventBatch.of(
            EventKind.SEND_REJECTED, quoted.ts_ns, frame, lists=lists, node=node, subindex=subindex, peer=receiver,
            amount=code, detail=by,
        )  # fmt: skip
        self._log(told, rejected)
        self.columns.resize(len(self.keys.lists))
        np.add.at(self.columns.send_rejected, lists, 1)
        for kind, error in _REJECTED.items():
            row = np.flatnonzero(service == kind)
            errors.append(ErrorEvents(error, True, lists[row], node[row], quoted.ts_ns[row], frame[row]))
        return errors

    def _log_rows(self, told: Told, kind: EventKind, rows: DataRows, place: I64) -> None:
        """Note something of some rows, in the order of the capture."""
        if len(place):
            row = place[np.argsort(rows.packet[place])]
            lists, node, subindex = self.keys.described(rows.stream[row])
            shift, mask = _PART_OF_SIGNATURE[kind]
            detail = (self.keys.varieties.signature[rows.variety[row]] >> shift & mask).astype(np.int64)
            events = EventBatch.of(
                kind, rows.time_ns[row], rows.packet[row] + told.first_frame, lists=lists, node=node,
                subindex=subindex, detail=detail,
            )  # fmt: skip
            self._log(told, events)

    def _messages(self, told: Told, kind: FrameKind) -> Messages:
        """Pick the telegrams of one kind that is not DATA."""
        varieties, flows = self.keys.varieties, self.keys.columns
        mine = varieties.column("kind") == kind
        others = told.laid.data.others
        row = others[mine[told.variety[others]]]
        if kind is FrameKind.ACKNOWLEDGEMENT and not told.hears_answers:
            row = row[:0]
        number = np.flatnonzero(mine)
        place, destination = varieties.place[number], flows.destination[varieties.flow[number]]
        target = np.full(len(varieties), -1)
        # Nobody's stream has the number of a broadcast's destination.
        target[number] = self.keys.streams.find(place.astype(np.uint64), destination.view(np.uint64))
        variety = told.variety[row]
        flow, part = varieties.flow[variety], told.varieties.part[variety]
        flags = told.varieties.telegrams.header["flags"][part]
        return Messages(
            row, told.packets.ts_ns[row], flows.list[flow], flows.place[flow], flows.source[flow],
            flows.destination[flow], target[variety], flags,
        )  # fmt: skip

    def _observe_answers(self, told: Told, rows: DataRows) -> list[ErrorEvents]:
        acknowledgements = self._messages(told, FrameKind.ACKNOWLEDGEMENT)
        requests = self._messages(told, FrameKind.BOOT_UP_REQUEST)
        first_frame = told.first_frame
        answers = self.acknowledgement.observe(
            rows, acknowledgements, requests, told.clock, self.keys, first_frame, heard=told.is_heard
        )
        places = self.keys.places
        self._log_missing(told, answers.missing)
        if told.is_heard:
            told.tell(self._waits(EventKind.ACKNOWLEDGED, answers.answered))
            self._tell_obtained(told, answers.obtained, answers.data)
        negative = np.flatnonzero(acknowledgements.flags & CHECKSUM_INVALID.mask)
        source, destination, unexpected = acknowledgements.source, acknowledgements.destination, answers.unexpected
        for kind, row, node, peer in (
            (EventKind.NEGATIVE_ACKNOWLEDGEMENT, negative, answers.negative_node, source[negative]),
            (EventKind.UNEXPECTED_ACKNOWLEDGEMENT, unexpected, source[unexpected], destination[unexpected]),
        ):
            subindex = places.low[acknowledgements.place[row]].astype(np.int64)
            time_ns, frame = acknowledgements.time_ns[row], acknowledgements.packet[row] + first_frame
            lists = acknowledgements.list[row]
            self._log(
                told, EventBatch.of(kind, time_ns, frame, lists=lists, node=node, subindex=subindex, peer=peer)
            )  # fmt: skip
        np.add.at(self.columns.negative_acknowledgements, acknowledgements.list[negative], 1)
        self._log_unanswered(told, answers.unanswered)
        return answers.errors

    def _log_missing(self, told: Told, waits: Waits) -> None:
        """Note data telegrams that were not acknowledged."""
        if len(waits):
            events = self._waits(EventKind.NO_ACKNOWLEDGEMENT, waits)
            self._log(told, events)
            np.add.at(self.columns.missing_acknowledgements, events.list, 1)

    def _waits(self, kind: EventKind, waits: Waits) -> EventBatch:
        lists, sender, subindex = self.keys.described(waits.stream)
        return EventBatch.of(
            kind, waits.end_ns, waits.frame, lists=lists, node=sender, subindex=subindex, since_ns=waits.since_ns,
            peer=waits.peer,
        )  # fmt: skip

    def _log_unanswered(self, told: Told, waits: BootUpWaits) -> None:
        """Note boot-up requests that brought nothing."""
        if len(waits):
            subindex = self.keys.places.low[waits.place].astype(np.int64)
            events = EventBatch.of(
                EventKind.BOOT_UP_UNANSWERED, waits.deadline_ns, waits.frame, lists=waits.list, subindex=subindex,
                since_ns=waits.deadline_ns - self.acknowledgement.timeout_ns, peer=waits.node,
            )  # fmt: skip
            self._log(told, events)
            np.add.at(self.columns.bootup_unanswered, waits.list, 1)

    def _tell_obtained(self, told: Told, asked: BootUpWaits, packet: I64) -> None:
        """Tell of boot-up requests that brought data, in the order of these."""
        if len(asked):
            order = np.argsort(packet, kind="stable")
            asked, packet = asked.take(order), packet[order]
            told.tell(
                EventBatch.of(
                    EventKind.BOOT_UP_ANSWERED, told.packets.ts_ns[packet], packet + told.first_frame, lists=asked.list,
                    subindex=self.keys.places.low[asked.place].astype(np.int64),
                    since_ns=asked.deadline_ns - self.acknowledgement.timeout_ns, peer=asked.node,
                )
            )  # fmt: skip

    def _expire(self, told: Told) -> list[ErrorEvents]:
        """End the waits whose deadline has passed without a frame that would have shown it."""
        assert told.until_ns is not None
        over = self.acknowledgement.expire(told.until_ns)
        self._log_missing(told, over.waits)
        self._log_unanswered(told, over.requests)
        lists, sender, _ = self.keys.described(over.waits.stream)
        requests, nobody = over.requests, np.full(len(over.requests), NOWHERE)
        # No frame has shown it: the next one would have.
        seen, seen_requests = (np.full(len(one), told.first_frame + len(told)) for one in (over.waits, requests))
        return [
            ErrorEvents(DiagError.NOACKNOWLEDGEMENT, False, lists, sender, over.waits.end_ns, seen),
            ErrorEvents(
                DiagError.UDPANSWERBOOTUPREQUEST, False, requests.list, nobody, requests.deadline_ns, seen_requests
            ),
        ]

    def _observe_consistency(self, told: Told, rows: DataRows) -> ErrorEvents:
        """Note changes of shape, checksum and flags."""
        changed, mismatch, strange = self.consistency.observe(rows, self.keys)
        for event, place in (
            (EventKind.SHAPE_CHANGED, changed),
            (EventKind.CHECKSUM_CHANGED, mismatch),
            (EventKind.FLAGS_INCONSISTENT, strange),
        ):
            self._log_rows(told, event, rows, place)
        np.add.at(self.flows.counts.mismatches, self.keys.varieties.flow[rows.variety[mismatch]], 1)
        lists, node, _ = self.keys.described(rows.stream[mismatch])
        frame = rows.packet[mismatch] + told.first_frame
        return ErrorEvents(DiagError.CHECKSUM, True, lists, node, rows.time_ns[mismatch], frame)
