"""Transactions: what became of all requests of the Parameter Manager, by who asked whom.

Source: Network Functionality in CoDeSys V2.3, document version 1.7, sections 2.3 and 2.4.1; services 1 to 4, 20 to 28
and 100. Where it is silent: a reply repeats Index, SubIndex and Counter of its request.
"""

from __future__ import annotations

from enum import IntEnum
from typing import ClassVar

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors import address
from dissectors.batch import I64, U64
from dissectors.keys import KeyTable
from dissectors.netvar import PARAMETER_ERRORS, PARAMETER_REQUESTS, Fault, Service, TelegramBatch
from nvscope.engine.events import EventBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.reading import PARAMETER_TIMEOUT_NS
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.tracker.events import EventLog, LeftOutLog
from nvscope.tracker.latency import Latencies
from nvscope.tracker.parameter.asked_ports import AskedPorts, source_ports
from nvscope.tracker.parameter.copies import Copies
from nvscope.tracker.parameter.events import USUAL, ParameterEvent, event_word, parameter_name
from nvscope.tracker.parameter.given_up import GivenUp
from nvscope.tracker.parameter.matching import (
    NO_MESSAGES,
    NOTHING_OPEN,
    Matched,
    Messages,
    Open,
    matched,
    parameter_of,
    word_of,
)
from nvscope.tracker.parameter.unseen_writes import UnseenWrites
from nvscope.tracker.parameter.values import values_in
from nvscope.tracker.parameter.writes import Writes
from nvscope.tracker.parameter.written_over import Answers

MOST_OPEN = 1 << 16
"""So many requests are waited for at the same time."""

_NEVER_NS = int(np.iinfo(np.int64).min)
_FIRST_ERROR, _LAST_ERROR = int(PARAMETER_ERRORS[0]), int(PARAMETER_ERRORS[-1])


class Beyond(IntEnum):
    """That for which there is no room: pairs of nodes, requests that wait, replies to these, findings on parameters.

    And writes, and the values over which they are written.
    """

    PAIR = 0
    OPEN = 1
    REPLY = 2
    PARAMETER = 3
    WRITE = 4
    VALUE = 5


class PairColumns(KeyedColumns):
    """One row a requester, partner and port: what became of its requests, ``errors`` as in ``PARAMETER_ERRORS``.

    ``undeliverable`` are the ICMP messages about requests, ``copies`` the messages that the capture has once more.
    """

    requests: I64
    replies: I64
    busy: I64
    timeouts: I64
    retransmissions: I64
    unexpected: I64
    undeliverable: I64
    copies: I64
    errors: I64
    COLUMNS: ClassVar = {
        **dict.fromkeys(
            ("requests", "replies", "busy", "timeouts", "retransmissions", "unexpected", "undeliverable", "copies"),
            (np.int64(0), 1),
        ),
        "errors": (np.int64(0), len(PARAMETER_ERRORS)),
    }


class Asked(Struct, frozen=True):
    """A parameter of a partner, on a port, and who asks for it."""

    requester: str
    partner: str
    port: int
    index: int
    subindex: int

    @property
    def name(self) -> str:
        """What it is called where nobody has named it."""
        return parameter_name(self.index << 16 | self.subindex)


class Became(Struct, frozen=True):
    """What is known behind a batch of requests, each in the order of the capture.

    ``asked`` are new ones. ``answers`` are the replies to those in ``answered``, in the same order; ``unexpected`` are
    replies to none. ``unanswered`` waited too long, as the packets in rows ``shown`` tell; where time has passed
    without a packet, that is the row behind the last one.
    """

    asked: Messages
    answers: Messages
    answered: Open
    unexpected: Messages
    unanswered: Open
    shown: I64


_NOTHING = np.empty(0, np.int64)
NOTHING_BECAME = Became(NO_MESSAGES, NO_MESSAGES, NOTHING_OPEN, NO_MESSAGES, NOTHING_OPEN, _NOTHING)


class Transactions:
    """The requests of all nodes, and what became of them; an accumulator.

    ``pairs`` number requester, partner (the halves of their addresses) and port; ``parameters`` pair, Index and
    SubIndex. ``latencies`` are of pairs, from the first request to the reply. ``events`` are keyed by
    ``ParameterEvent`` with, for error replies, their service (``event_word``), and by parameter. ``writes`` are what
    was written by whom. ``left_out`` is that for which there was no room, keyed by ``Beyond``. While requests may be
    open that have been left out, a reply that ends none may be to one of these: it is left out, too.
    """

    def __init__(self) -> None:
        self.pairs = KeyTable(5)
        self.columns = PairColumns()
        self.latencies = Latencies()
        self.parameters = KeyTable()
        self.events = EventLog()
        self.left_out = LeftOutLog()
        self.writes = Writes(self.pairs)
        self.timeout_ns = PARAMETER_TIMEOUT_NS
        self._open = NOTHING_OPEN
        self._ports, self._copies, self._quotes = AskedPorts(), Copies(), Copies()
        self._unseen, self._given_up = UnseenWrites(), GivenUp()
        self._forgot_until_ns = _NEVER_NS

    def observe(self, told: Told) -> Became:
        """Take a batch, which follows those observed so far; return what is known of requests by it."""
        self.timeout_ns = told.parameter_timeout_ns
        became = NOTHING_BECAME
        if len(told) and (len(told.laid.parameters) or len(self._open)):
            became = self._observe(told)
        if len(told.batch.quoted):
            self._count_undeliverable(told)
        if told.until_ns is not None and len(self._open):
            late = self._open.last_ns + self.timeout_ns < told.until_ns
            waits = self._sorted(self._open.take(late))
            self._give_up(told, waits)
            self._given_up.since(waits, np.zeros(len(waits), np.int64), NO_MESSAGES, NO_MESSAGES)
            self.writes.give_up(waits, told.first_frame + len(told))
            self._open = self._open.take(~late)
            shown = np.append(became.shown, np.full(len(waits), len(told)))
            became = replace(became, unanswered=Open.stacked([became.unanswered, waits]), shown=shown)
        for unheard in told.unheard:
            self._resume(unheard, told.first_frame + len(told))
        self.events.settle()
        self.left_out.settle()
        return became

    def overdue_events(self, at_ns: int) -> EventLog:
        """Return timeouts of requests whose deadline is before a time, and that no frame has shown to be late."""
        log = EventLog()
        waits = self._sorted(self._open.take(self._open.last_ns + self.timeout_ns < at_ns))
        number = self.parameters.find(waits.pair.view(np.uint64), parameter_of(waits.word).view(np.uint64))
        known = np.flatnonzero(number >= 0)
        words = event_word(ParameterEvent.TIMEOUT, waits.service)[known], number[known].view(np.uint64)
        log.record(waits.last_ns[known] + self.timeout_ns, waits.frame[known], *words)
        log.settle()
        return log

    def described(self, number: int) -> Asked:
        """Return which parameter of which node a number stands for, and who asks."""
        pair, word = int(self.parameters.high[number]), int(self.parameters.low[number])
        requester_hi, requester_lo, partner_hi, partner_lo, port = (int(one[pair]) for one in self.pairs.words)
        ends = address.text(requester_hi, requester_lo), address.text(partner_hi, partner_lo)
        return Asked(*ends, port, word >> 16, word & 0xFFFF)

    def _sorted(self, waits: Open) -> Open:
        return waits.take(np.lexsort((waits.frame, waits.last_ns)))

    def _observe(self, told: Told) -> Became:
        messages = self._messages(told)
        if not len(messages) and not len(self._open):
            self.writes.observe(told, messages, Answers(messages, NOTHING_OPEN, messages, NOTHING_OPEN, _NOTHING))
            return NOTHING_BECAME
        found = matched(self._open, messages, told.clock, told.first_frame, self.timeout_ns)
        columns = self.columns
        opened = messages.take(found.opened)
        # In the order of the capture, so that the first ones have a number however it is cut; of what nobody answers,
        # too.
        tell = found.opened
        if told.hears_answers and len(found.unexpected):
            tell = np.sort(np.concatenate([tell, found.unexpected]))
        pair, parameter = messages.pair[tell], parameter_of(messages.word[tell])
        self.parameters.numbers_within(told.max_streams, pair.view(np.uint64), parameter.view(np.uint64))
        np.add.at(columns.requests, opened.pair, 1)
        np.add.at(columns.retransmissions, messages.pair[found.repeated], 1)
        if not told.hears_answers:
            nothing = found.closing[:0]
            found = found._replace(
                closing=nothing, closed=NOTHING_OPEN, open=NOTHING_OPEN, unexpected=nothing, expired=NOTHING_OPEN,
                shown=nothing,
            )  # fmt: skip
        self._open = found.open
        if told.is_heard:
            asked = opened.take(opened.service == Service.ODWriteRequest)
            self._tell(told, ParameterEvent.WRITE_ASKED, asked, asked.time_ns)
        closing = messages.take(found.closing)
        unexpected = messages.take(found.unexpected)
        confirms = unexpected.take(unexpected.service == Service.ODWriteRequestReply)
        unseen = self._unseen.of(opened.take(opened.service == Service.ODWriteRequest), confirms)
        self.writes.note_unseen(unseen, told.first_frame)
        self._tell(told, ParameterEvent.WRITE_UNSEEN, unseen, unseen.time_ns)
        answers = Answers(closing, found.closed, unexpected, found.expired, found.shown)
        untold = self.writes.observe(told, opened, answers)
        for what, left_out in zip((Beyond.WRITE, Beyond.VALUE), untold, strict=True):
            self._leave_out(what, left_out.time_ns, left_out.packet + told.first_frame)
        if told.hears_answers:
            self._count_replies(told, messages, found)
            self._give_up(told, found.expired)
        if len(self._open) > MOST_OPEN:
            by_frame = np.argsort(self._open.frame, kind="stable")
            beyond = self._open.take(by_frame[MOST_OPEN:])
            self._leave_out(Beyond.OPEN, beyond.since_ns, beyond.frame)
            self._forgot_until_ns = max(self._forgot_until_ns, int(beyond.last_ns.max()) + self.timeout_ns)
            self._open = self._open.take(np.sort(by_frame[:MOST_OPEN]))
            self.writes.leave(beyond, told.first_frame + len(told))
        return Became(opened, closing, found.closed, unexpected, found.expired, found.shown)

    def _count_undeliverable(self, told: Told) -> None:
        """Count requests of which ICMP messages say that they went nowhere."""
        back = _undeliverable(told)
        if not len(back):
            return
        pair, datagram = self.pairs.numbers_within(told.max_streams, *_pair_words(back)), back.datagram
        self.columns.resize(len(self.pairs))
        self.latencies.columns.resize(len(self.pairs))
        # What is quoted is told by its identification, as if it came itself.
        index, service = (back.header[name].astype(np.int64) for name in ("index", "id"))
        time_ns = told.packets.ts_ns[datagram.row]
        copies = self._quotes.of(told.packets.data, datagram.payload, datagram, index, service, time_ns)
        np.add.at(self.columns.undeliverable, pair[(pair >= 0) & ~copies], 1)

    def _count_replies(self, told: Told, messages: Messages, found: Matched) -> None:
        columns, closing, closed = self.columns, messages.take(found.closing), found.closed
        is_busy = closing.service == Service.ODStateBusy
        is_error = (closing.service >= _FIRST_ERROR) & (closing.service <= _LAST_ERROR)
        np.add.at(columns.busy, closing.pair[is_busy], 1)
        np.add.at(columns.replies, closing.pair[~is_busy], 1)
        np.add.at(columns.errors, (closing.pair[is_error], closing.service[is_error] - _FIRST_ERROR), 1)
        latency_ns = closing.time_ns - closed.since_ns
        self.latencies.observe(closing.pair[~is_busy], latency_ns[~is_busy], len(self.pairs))
        is_slow = ~is_busy & (2 * latency_ns > self.timeout_ns)
        for event, own in (
            (ParameterEvent.REPLIED, ~is_busy & ~is_error), (ParameterEvent.ERROR_REPLY, is_error),
            (ParameterEvent.BUSY, is_busy), (ParameterEvent.SLOW, is_slow),
        ):  # fmt: skip
            self._tell(told, event, closing.take(own), closed.since_ns[own])
        unexpected = messages.take(found.unexpected)
        since_ns = self._given_up.since(found.expired, found.shown, closing, unexpected)
        unsure = unexpected.time_ns <= self._forgot_until_ns
        if unsure.any():
            own = unexpected.take(unsure)
            self._leave_out(Beyond.REPLY, own.time_ns, own.packet + told.first_frame)
            unexpected, since_ns = unexpected.take(~unsure), since_ns[~unsure]
        np.add.at(columns.unexpected, unexpected.pair, 1)
        self._tell(told, ParameterEvent.UNEXPECTED_REPLY, unexpected, since_ns)

    def _tell(self, told: Told, event: ParameterEvent, messages: Messages, since_ns: I64) -> None:
        """Tell of some requests or replies, and log what is a finding."""
        if len(messages):
            frame = messages.packet + told.first_frame
            self._note(told, event, messages, messages.time_ns, frame, since_ns)

    def _give_up(self, told: Told, waits: Open) -> None:
        """Count requests that nobody answered in time."""
        if len(waits):
            np.add.at(self.columns.timeouts, waits.pair, 1)
            time_ns = waits.last_ns + self.timeout_ns
            self._note(told, ParameterEvent.TIMEOUT, waits, time_ns, waits.frame, waits.since_ns)

    def _note(
        self, told: Told, event: ParameterEvent, of: Messages | Open, time_ns: I64, frame: I64, since_ns: I64
    ) -> None:  # fmt: skip
        if event not in USUAL:
            words = of.pair.view(np.uint64), parameter_of(of.word).view(np.uint64)
            number = self.parameters.numbers_within(told.max_streams, *words)
            known = number >= 0
            apart = since_ns != time_ns if event is ParameterEvent.UNEXPECTED_REPLY else of.service
            words = event_word(event, apart.astype(np.int64))[known], number[known].view(np.uint64)
            self.events.record(time_ns[known], frame[known], *words)
            self._leave_out(Beyond.PARAMETER, time_ns[~known], frame[~known])
        if told.is_heard:
            told.tell(
                EventBatch.of(
                    event, time_ns, frame, node=of.node, peer=of.peer, since_ns=since_ns, amount=of.service,
                    detail=parameter_of(of.word), pair=of.pair,
                )
            )  # fmt: skip

    def _messages(self, told: Told) -> Messages:
        """Return the well-formed requests and replies of a batch."""
        rows, varieties = told.laid.parameters, told.varieties
        telegrams = varieties.telegrams
        part = varieties.part[rows.variety]
        whole = telegrams.fault[part] == Fault.NONE
        if not whole.all():
            part = part[whole]
        variety, packet = rows.variety[whole], rows.packet[whole]
        datagram, header = telegrams.datagram.take(part), telegrams.header[part]
        service = header["id"].astype(np.int64)
        asks = np.isin(service, PARAMETER_REQUESTS)
        at = told.packets.offset[packet] + datagram.payload
        source = source_ports(told.packets.data, at)
        ends = (
            (datagram.source_hi, datagram.destination_hi), (datagram.source_lo, datagram.destination_lo),
            (datagram.destination_hi, datagram.source_hi), (datagram.destination_lo, datagram.source_lo),
        )  # fmt: skip
        words = [np.where(asks, *halves) for halves in ends]
        port = self._ports.ports(told.max_streams, words, asks, source, datagram.destination_port.astype(np.int64))
        pair = self._pairs_of(told, packet, *words, port.view(np.uint64))
        carried = varieties.carried
        word = word_of(carried.identifier[variety], carried.subindex[variety], rows.counter[whole].astype(np.int64))
        sender, receiver = rows.sender[whole], rows.receiver[whole]
        ends_by_number = np.where(asks, sender, receiver), np.where(asks, receiver, sender)
        value, writes = np.zeros(len(packet), np.int64), np.flatnonzero(service == Service.ODWriteRequest)
        value[writes] = list(map(hash, values_in(told, packet[writes])))
        messages = Messages(packet, rows.time_ns[whole], pair, word, service, *ends_by_number, value)
        own = pair >= 0
        copies = self._copies.of(told.packets.data, at, datagram, word, service, messages.time_ns)
        if not own.all():
            beyond = messages.take(~own)
            self._leave_out(Beyond.PAIR, beyond.time_ns, beyond.packet + told.first_frame)
        self.columns.resize(len(self.pairs))
        self.latencies.columns.resize(len(self.pairs))
        np.add.at(self.columns.copies, pair[own & copies], 1)
        return messages.take(own & ~copies)

    def _pairs_of(self, told: Told, packet: I64, *words: U64) -> I64:
        """Return the numbers of pairs, those that are new in the order of the capture, also of requests that came back.

        So the first ones have a number however it is cut.
        """
        back = _undeliverable(told)
        if not len(back):
            return self.pairs.numbers_within(told.max_streams, *words)
        order = np.argsort(np.concatenate([packet, back.datagram.row]), kind="stable")
        together = (np.concatenate(both)[order] for both in zip(words, _pair_words(back), strict=True))
        number = np.empty(len(order), np.int64)
        number[order] = self.pairs.numbers_within(told.max_streams, *together)
        return number[: len(packet)]

    def _leave_out(self, what: Beyond, time_ns: I64, frame: I64) -> None:
        if len(time_ns):
            self.left_out.record(time_ns, frame, np.full(len(time_ns), int(what), np.uint64))

    def _resume(self, unheard: Unheard, frame: int) -> None:
        """Forget the requests of what nobody listens to any more, in front of a frame."""
        if unheard.everything:
            self._open = NOTHING_OPEN
            self.writes.forget()
        elif len(self._open):
            gone = np.isin(self._open.node, unheard.nodes) | np.isin(self._open.peer, unheard.nodes)
            self.writes.leave(self._open.take(gone), frame)
            self._open = self._open.take(~gone)


def _undeliverable(told: Told) -> TelegramBatch:
    """Return the requests that came back, as far as ICMP messages quote them; none where no answers are heard."""
    quoted = told.batch.quoted
    return quoted.take(np.isin(quoted.header["id"], PARAMETER_REQUESTS) & told.hears_answers)


def _pair_words(back: TelegramBatch) -> tuple[U64, ...]:
    """Return who asked whom, on which port, as words of keys."""
    datagram = back.datagram
    ends = datagram.source_hi, datagram.source_lo, datagram.destination_hi, datagram.destination_lo
    return *ends, datagram.destination_port.astype(np.uint64)
