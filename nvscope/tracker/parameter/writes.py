"""Writes of parameters: who wrote what over which value, and what became of it.

Writes are rare, reads may be millions. The value that is written over is the one last known when the write was asked
for: what a reply to a read said, or an earlier write that was confirmed, of whoever. Nobody knows what the partner does
with a write that it does not confirm: it changes nothing of what is known.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from dissectors import address
from dissectors.batch import I64, U64
from dissectors.keys import KeyTable
from dissectors.netvar import Service
from nvscope.engine.told import Told
from nvscope.tracker.events import EventLog
from nvscope.tracker.parameter.matching import Messages, Open, parameter_of
from nvscope.tracker.parameter.values import LastValues, Value, values_in

MOST_WRITES = 10_000
"""So many writes are kept, the first ones; from there on no values are kept either.

Of so many minutes of pairs it is known behind these how often they wrote; of more, that there were.
"""

MINUTE_NS = 60 * 10**9
_PARTNER_BIT = np.uint64(32)
_WRITTEN, _READ = Service.ODWriteRequestReply, Service.ODReadRequestReply


class Outcome(StrEnum):
    """What became of a write; of one that is open nobody has seen it yet, or will.

    That is so, too, where a reply came while a write of another value with the same key was open: which of them it is
    about is not known.
    """

    CONFIRMED = "confirmed"
    REFUSED = "refused"
    BUSY = "busy"
    UNANSWERED = "unanswered"
    OPEN = "open"


@dataclass(frozen=True, slots=True)
class Write:
    """A write, whose time and frame are those of the first request; it may have been repeated.

    ``old`` is the value last known of the parameter at that time, None without any. ``answer_frame`` is the frame of
    the reply, None without one; ``error`` the service of one that refuses.
    """

    time_ns: int
    frame: int
    requester: str
    partner: str
    port: int
    index: int
    subindex: int
    old: Value | None
    new: Value
    outcome: Outcome = Outcome.OPEN
    error: str | None = None
    answer_frame: int | None = None


_NOT_KNOWN = Value(b"", 1, 0)

_OUTCOMES = {_WRITTEN: Outcome.CONFIRMED, Service.ODStateBusy: Outcome.BUSY}


class Writes:
    """The first ``MOST_WRITES`` writes of all nodes, in the order of their frames; a part of the transactions.

    ``pairs`` are those of the transactions: requester, partner (the halves of their addresses) and port. ``further``
    are the writes behind those that are kept, by pair and minute since 1970; of ``further_left_out`` not even that is.
    """

    def __init__(self, pairs: KeyTable) -> None:
        self.kept: list[Write] = []
        self.further, self.further_left_out = EventLog(), 0
        self._pairs = pairs
        self._places: dict[int, int] = {}  # By the frames of those that are open.
        self._described: dict[int, tuple[str, str, int]] = {}
        self._values = LastValues()
        self._partners = KeyTable()
        self._partner_of = np.empty(0, np.uint64)

    def observe(
        self, told: Told, opened: Messages, closing: Messages, closed: Open
    ) -> tuple[Messages, Messages]:  # fmt: skip
        """Take what was asked for in a batch, and the replies that end requests, both in the order of the capture.

        Returns the writes for which there was no room, and the replies whose values there was none for.
        """
        asked = opened.take(opened.service == Service.ODWriteRequest)
        room = MOST_WRITES - len(self.kept)
        has_room = np.arange(len(asked)) < room
        fresh, beyond = asked.take(has_room), asked.take(~has_room)
        if len(beyond):
            self._note(beyond, told.first_frame)
        # Values that come behind the last write that is kept are those of nothing.
        stop = len(told) if len(fresh) < room else int(fresh.packet[-1]) if room else 0
        own = ((closing.service == _READ) | (closing.service == _WRITTEN)) & (closing.packet < stop)
        # What is not known to be about a write tells by a frame of 0 that the value is not known any more.
        tells, of = closing.take(own), np.where(closed.unsure[own] == 0, closed.frame[own], 0)
        number = self._values.numbers(self._words(tells), told.max_streams)
        untold = tells.take(number < 0)
        if len(untold):
            tells, of, number = tells.take(number >= 0), of[number >= 0], number[number >= 0]
        if len(fresh):
            self._keep(told, fresh, tells, of, number)
        self._learn(told, tells, of, number)
        self._answer(told, closing, closed)
        return beyond, untold

    def asked_in(self, frame: int) -> Write | None:
        """Return the write that was asked for first in a frame; None where that is not kept."""
        place = bisect_left(self.kept, frame, key=lambda one: one.frame)
        return self.kept[place] if place < len(self.kept) and self.kept[place].frame == frame else None

    def give_up(self, waits: Open) -> None:
        """Take what nobody has answered in time."""
        own = waits.service == Service.ODWriteRequest
        for frame, unsure in zip(waits.frame[own].tolist(), waits.unsure[own].tolist(), strict=True):
            place = self._places.pop(frame, None)
            if place is not None and not unsure:
                self.kept[place] = replace(self.kept[place], outcome=Outcome.UNANSWERED)

    def _note(self, beyond: Messages, first_frame: int) -> None:
        """Take writes for which there is no room, as closely as hours of a day ask for it."""
        words = beyond.pair.astype(np.uint64), (beyond.time_ns // MINUTE_NS).view(np.uint64)
        has_room = self.further.keys.numbers_within(MOST_WRITES, *words) >= 0
        self.further_left_out += int(np.count_nonzero(~has_room))
        frame = beyond.packet[has_room] + first_frame
        self.further.record(beyond.time_ns[has_room], frame, *(word[has_room] for word in words))
        self.further.settle()

    def _keep(self, told: Told, fresh: Messages, tells: Messages, of: I64, number: I64) -> None:
        """Keep writes, each with the value that was last told before it."""
        place = self._values.find(self._words(fresh))
        order = np.argsort(number, kind="stable")
        span = len(told) + 1
        before = np.searchsorted(number[order] * span + tells.packet[order], place * span + fresh.packet) - 1
        latest = np.where(before >= 0, np.append(order, -1)[before], -1)
        latest = np.where((latest >= 0) & (np.append(number, -1)[latest] == place), latest, -1)
        told_by_read = latest[(latest >= 0) & (np.append(tells.service, 0)[latest] == _READ)]
        was_read = dict(zip(told_by_read.tolist(), values_in(told, tells.packet[told_by_read]), strict=True))
        columns = fresh.time_ns, fresh.packet + told.first_frame, fresh.pair, parameter_of(fresh.word), place, latest
        rows = zip(*(column.tolist() for column in columns), values_in(told, fresh.packet), strict=True)
        for time_ns, frame, pair, parameter, known_as, told_by, new in rows:
            if told_by < 0:
                old = self._values.of(known_as)
            elif told_by in was_read:
                old = was_read[told_by]
            elif not of[told_by]:
                old = None
            else:
                old = self.kept[self._places[int(of[told_by])]].new
            self._places[frame] = len(self.kept)
            self.kept.append(
                Write(
                    time_ns, frame, *self.ends(pair), parameter >> 16, parameter & 0xFFFF,
                    old if old and old.is_known else None, new,
                )
            )  # fmt: skip

    def _learn(self, told: Told, tells: Messages, of: I64, number: I64) -> None:
        """Keep what parameters are by the last that is told of each."""
        last = self._values.last_of(number)
        is_read = tells.service[last] == _READ
        read, written = last[is_read], last[~is_read]
        self._values.put_from(told, number[read], tells.packet[read])
        for row in written.tolist():
            self._values.put(int(number[row]), self.kept[self._places[int(of[row])]].new if of[row] else _NOT_KNOWN)

    def _answer(self, told: Told, closing: Messages, closed: Open) -> None:
        """Take what replies say of writes that are kept."""
        if not self._places:
            return
        own = (closed.service == Service.ODWriteRequest) & (closed.frame <= self.kept[-1].frame)
        frames = closing.packet[own] + told.first_frame
        columns = closed.frame[own], frames, closing.service[own], closed.unsure[own]
        for asked, frame, service, unsure in zip(*(column.tolist() for column in columns), strict=True):
            outcome = Outcome.OPEN if unsure else _OUTCOMES.get(service, Outcome.REFUSED)
            place = self._places.pop(asked)
            self.kept[place] = replace(
                self.kept[place], outcome=outcome, answer_frame=frame,
                error=Service(service).name if outcome is Outcome.REFUSED else None,
            )  # fmt: skip

    def ends(self, pair: int) -> tuple[str, str, int]:
        """Return requester and partner of a pair as texts, and the port."""
        if pair not in self._described:
            requester_hi, requester_lo, partner_hi, partner_lo, port = (int(word[pair]) for word in self._pairs.words)
            ends = address.text(requester_hi, requester_lo), address.text(partner_hi, partner_lo)
            self._described[pair] = *ends, port
        return self._described[pair]

    def _words(self, messages: Messages) -> U64:
        """Return which parameter of which partner, whatever its port, messages are about."""
        known = len(self._partner_of)
        if known < len(self._pairs):
            _, _, high, low, _ = self._pairs.words
            fresh = self._partners.numbers(high[known:], low[known:])
            self._partner_of = np.append(self._partner_of, fresh.astype(np.uint64))
        partner = self._partner_of[messages.pair]
        words: U64 = partner << _PARTNER_BIT | parameter_of(messages.word).astype(np.uint64)
        return words
