"""Writes of parameters: who wrote what over which value, and what became of it.

The value that is written over is the one known when the write was asked for: ``written_over`` says which that is.
"""

from __future__ import annotations

from bisect import bisect_left
from enum import StrEnum

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors import address
from dissectors.batch import U64
from dissectors.keys import KeyTable
from dissectors.netvar import Service
from nvscope.engine.told import Told
from nvscope.tracker.events import EventLog
from nvscope.tracker.parameter.matching import Messages, Open, parameter_of
from nvscope.tracker.parameter.values import Value, values_in
from nvscope.tracker.parameter.written_over import Answers, WrittenOver

MOST_WRITES = 10_000
"""So many writes are kept, the first ones; from there on no values are kept either.

Of so many minutes of pairs it is known behind these how often they wrote; of more, that there were.
"""

MINUTE_NS = 60 * 10**9
_WRITTEN = Service.ODWriteRequestReply


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


class Write(Struct, frozen=True):
    """A write, whose time and frame are those of the first request; it may have been repeated.

    ``old`` is the value known of the parameter at that time, None without any. ``answer_frame`` is the frame of
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


_OUTCOMES = {_WRITTEN: Outcome.CONFIRMED, Service.ODStateBusy: Outcome.BUSY}


class Writes:
    """The first ``MOST_WRITES`` writes of all nodes, in the order of their frames; a part of the transactions.

    ``pairs`` are those of the transactions: requester, partner (the halves of their addresses) and port. ``further``
    are the writes behind those that are kept, by pair and minute since 1970; of ``further_left_out`` not even that is.
    ``unseen`` are those of which nothing but the reply was captured, by pair, parameter and minute.
    """

    def __init__(self, pairs: KeyTable) -> None:
        self.kept: list[Write] = []
        self.further, self.further_left_out = EventLog(), 0
        self.unseen = EventLog(3)
        self._pairs = pairs
        self._places: dict[int, int] = {}  # By the frames of those that are open.
        self._described: dict[int, tuple[str, str, int]] = {}
        self._values = WrittenOver(pairs)

    def observe(self, told: Told, opened: Messages, found: Answers) -> tuple[Messages, Messages]:
        """Take what was asked for in a batch, and what became of requests, both in the order of the capture.

        Returns the writes for which there was no room, and the replies whose values there was none for.
        """
        asked = opened.take(opened.service == Service.ODWriteRequest)
        room = MOST_WRITES - len(self.kept)
        has_room = np.arange(len(asked)) < room
        fresh, beyond = asked.take(has_room), asked.take(~has_room)
        if len(beyond):
            self._note(self.further, beyond, told.first_frame)
        # Values that come behind the last write that is kept are those of nothing.
        stop = len(told) if len(fresh) < room else int(fresh.packet[-1]) if room else 0
        new = values_in(told, fresh.packet)
        old, untold = self._values.observe(told, fresh, new, found, stop)
        columns = fresh.time_ns, fresh.packet + told.first_frame, fresh.pair, parameter_of(fresh.word)
        for time_ns, frame, pair, parameter, before, value in zip(
            *(column.tolist() for column in columns), old, new, strict=True
        ):
            self._places[frame] = len(self.kept)
            self.kept.append(
                Write(time_ns, frame, *self.ends(pair), parameter >> 16, parameter & 0xFFFF, before, value)
            )
        self._answer(told, found.closing, found.closed)
        self._give_up(found.late)
        return beyond, untold

    def asked_in(self, frame: int) -> Write | None:
        """Return the write that was asked for first in a frame; None where that is not kept."""
        place = bisect_left(self.kept, frame, key=lambda one: one.frame)
        return self.kept[place] if place < len(self.kept) and self.kept[place].frame == frame else None

    def give_up(self, waits: Open, frame: int) -> None:
        """Take what nobody has answered in time, though no packet has shown it, in front of a frame."""
        self._values.give_up(waits, frame)
        self._give_up(waits)

    def leave(self, waits: Open, frame: int) -> None:
        """Take requests that nobody follows any more, in front of a frame: what becomes of them is not known."""
        self._values.give_up(waits, frame)

    def forget(self) -> None:
        """Let nothing be known of what parameters are: nobody listened for a while."""
        self._values.forget()

    def _give_up(self, waits: Open) -> None:
        own = waits.service == Service.ODWriteRequest
        for frame, unsure in zip(waits.frame[own].tolist(), waits.unsure[own].tolist(), strict=True):
            place = self._places.pop(frame, None)
            if place is not None and not unsure:
                self.kept[place] = replace(self.kept[place], outcome=Outcome.UNANSWERED)

    def note_unseen(self, replies: Messages, first_frame: int) -> None:
        """Take the replies to writes that nobody saw."""
        if len(replies):
            self._note(self.unseen, replies, first_frame, parameter_of(replies.word).view(np.uint64))

    def _note(self, log: EventLog, some: Messages, first_frame: int, *words: U64) -> None:
        """Take writes of which no more is kept than hours of a day ask for; ``words`` are further ones of their key."""
        words = some.pair.astype(np.uint64), *words, (some.time_ns // MINUTE_NS).view(np.uint64)
        has_room = log.keys.numbers_within(MOST_WRITES, *words) >= 0
        self.further_left_out += int(np.count_nonzero(~has_room))
        frame = some.packet[has_room] + first_frame
        log.record(some.time_ns[has_room], frame, *(word[has_room] for word in words))
        log.settle()

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
