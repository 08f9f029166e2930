"""What parameters are, as far as anybody knows it: the values over which writes are written.

A reply to a read tells it, however late; so does a write that is confirmed, of whoever. What may have been written, and
nobody knows it, makes it unknown until something tells it again: a write that is not answered in time, one with which
the partner's time ran out, one that was open together with another one, one whose request nobody saw. A write that is
refused, or answered by busy, changes nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, U64, Bool
from dissectors.columns import Columns
from dissectors.keys import KeyTable
from dissectors.netvar import Service
from nvscope.engine.told import Told
from nvscope.tracker.parameter.malformed_writes import malformed_writes
from nvscope.tracker.parameter.matching import Messages, Open, parameter_of
from nvscope.tracker.parameter.values import LastValues, Value, values_in

MOST_LATE = 16
"""So many reads of one parameter that nobody answered in time are remembered: what a late reply says may be old."""

MOST_PARTNERS = 4
"""So many times as many partners as there are pairs are numbered: malformed requests make no pairs."""

_PARTNER_BIT = np.uint64(32)
_READ_REPLY, _WRITE_REPLY = Service.ODReadRequestReply, Service.ODWriteRequestReply
_Key = tuple[int, int]
"""Pair and word of a request."""


class _Happened(IntEnum):
    """What happens to a parameter; what one packet tells of several ones is taken in this order."""

    LATE = 0
    ASKED = 1
    READ = 2
    ANSWERED = 3
    STRAY_READ = 4
    STRAY_WRITE = 5
    UNSEEN = 6


_TELLS = (_Happened.READ, _Happened.STRAY_READ)
_WRITES = (_Happened.ASKED, _Happened.STRAY_WRITE, _Happened.UNSEEN)


class _Last(IntEnum):
    """What is known of the last write: a late reply may still confirm it, it is confirmed, or neither."""

    MAY_BE = 0
    CONFIRMED = 1
    REFUSED = 2


def _whole(value: Value | None) -> Value | None:
    """Return a value, None where not all of it was captured that would be kept."""
    return value if value is not None and value.is_known else None


class _Parameter(Struct):
    """A parameter that somebody wrote, or may have written.

    ``open`` are its writes that wait, by frame, each with its value and whether it is not alone: others were open
    meanwhile, or one with its key may still be answered. ``changed`` is the last frame up to which something may have
    been written, 0 without any. ``key``, ``last_frame``, ``last_value`` and ``last`` are of the last write,
    ``is_alone`` whether its value is what its key stands for. ``unanswered`` are reads that nobody answered in time:
    the frames of their requests.
    """

    value: Value | None
    open: dict[int, tuple[Value, bool]] = field(default_factory=dict)
    changed: int = 0
    key: _Key | None = None
    last_frame: int = 0
    last_value: Value | None = None
    last: _Last = _Last.REFUSED
    is_alone: bool = True
    unanswered: dict[_Key, int] = field(default_factory=dict)

    def ask(self, frame: int, key: _Key, value: Value) -> Value | None:
        """Take a write that is asked for, and return what it is written over."""
        old = None if self.open else self.value
        with_others = bool(self.open) or (
            key == self.key and self.last is _Last.MAY_BE and value != self.last_value
        )  # fmt: skip
        self._share()
        self.open[frame] = value, with_others
        self.key, self.last_frame, self.last_value, self.last = key, frame, value, _Last.MAY_BE
        self.is_alone = not with_others
        return old

    def answer(self, asked: int, service: int, *, unsure: bool, frame: int) -> None:
        """Take the reply to a write."""
        value, with_others = self.open.pop(asked, (None, True))
        if unsure or service in (_WRITE_REPLY, Service.ODErrorTimeOut):
            self.value = None if unsure or with_others or service != _WRITE_REPLY else _whole(value)
            self.changed = frame
        if asked == self.last_frame and not unsure:
            if service == _WRITE_REPLY:
                self.last = _Last.CONFIRMED
            elif service not in (Service.ODStateBusy, Service.ODErrorTimeOut):
                self.last = _Last.REFUSED

    def give_up(self, key: _Key, asked: int, frame: int) -> None:
        """Let a write have been taken, or not: nobody knows; and a reply to a read say what may be old."""
        if self.open.pop(asked, None) is not None:
            self.value, self.changed = None, frame
            return
        self.unanswered.pop(key, None)
        if len(self.unanswered) == MOST_LATE:
            del self.unanswered[next(iter(self.unanswered))]
        self.unanswered[key] = asked

    def read(self, value: Value, asked: int) -> None:
        """Take what a reply says to a read that was asked for in a frame."""
        self.value = _whole(value) if asked >= self.changed else None

    def stray_read(self, value: Value, key: _Key) -> None:
        """Take what a reply says that ends no read: it is late, comes again, or its request was not seen."""
        if key in self.unanswered:
            self.read(value, self.unanswered[key])
        elif value != self.value:
            self.read(value, 0)

    def stray_write(self, key: _Key | None, frame: int) -> None:
        """Take a reply that ends no write, or, without a key, a request of which nobody knows whether it was one."""
        if key is not None and key == self.key and self.last is not _Last.REFUSED:
            if self.last is _Last.CONFIRMED:
                return
            self.value = _whole(self.last_value) if self.is_alone and not self.open else None
            self.last = _Last.CONFIRMED
        else:
            self.value = None
        self._share()
        self.changed = frame

    def _share(self) -> None:
        """Let open writes, and the last one, be no longer alone."""
        self.is_alone = False
        self.open = {frame: (value, True) for frame, (value, _) in self.open.items()}


class Answers(NamedTuple):
    """What became of requests in a batch: replies and what they close, replies that close nothing, what is too late.

    ``shown`` are the rows that show of those that are ``late`` that they are.
    """

    closing: Messages
    closed: Open
    stray: Messages
    late: Open
    shown: I64


class _Rows(Columns, Struct, frozen=True):
    """What happens in a batch; int64, of shape (n,).

    ``number`` is that of the parameter, -1 without one; ``frame`` that of the request.
    """

    packet: I64
    kind: I64
    number: I64
    pair: I64
    word: I64
    service: I64
    frame: I64
    unsure: I64


class WrittenOver:
    """What parameters are, by partner, Index and SubIndex, whatever the port; ``pairs`` are those of transactions.

    What is read alone, which is the rule, is taken for whole columns at once; parameters that somebody writes are
    followed one by one.
    """

    def __init__(self, pairs: KeyTable) -> None:
        self._pairs = pairs
        self._partners = KeyTable()
        self._partner_of = np.empty(0, np.uint64)
        self.forget()

    def forget(self) -> None:
        """Let nothing be known: nobody listened for a while."""
        self._values = LastValues()
        self._written: dict[int, _Parameter] = {}
        self._is_written: Bool = np.zeros(0, np.bool_)

    def observe(
        self, told: Told, asked: Messages, new: Sequence[Value], found: Answers, stop: int
    ) -> tuple[list[Value | None], Messages]:  # fmt: skip
        """Take a batch up to a row; return what the writes ``asked`` are written over, whose values are ``new``.

        Returned with these are the replies whose values there was no room for.
        """
        rows, untold = self._rows(told, asked, found, stop)
        if not len(rows):
            return [None] * len(asked), untold
        self._is_written = np.append(
            self._is_written, np.zeros(max(0, len(self._values.places) - len(self._is_written)), np.bool_)
        )
        self._is_written[rows.number[np.isin(rows.kind, _WRITES)]] = True
        written = self._is_written[rows.number]
        self._learn(told, rows.take(~written))
        return self._follow(told, rows.take(written), new, asked.packet), untold

    def _rows(self, told: Told, asked: Messages, found: Answers, stop: int) -> tuple[_Rows, Messages]:
        """Return what happens up to a row to parameters that have a number, and replies to what has none."""
        is_read, is_write = found.closing.service == _READ_REPLY, found.closed.service == Service.ODWriteRequest
        own = (is_read | is_write) & (found.closing.packet < stop)
        closing, closed = found.closing.take(own), found.closed.take(own)
        stray = np.isin(found.stray.service, (_READ_REPLY, _WRITE_REPLY)) & (found.stray.packet < stop)
        strays, malformed = found.stray.take(stray), malformed_writes(told)
        malformed = malformed.take(malformed.packet < stop)
        partners = self._partners.numbers_within(
            MOST_PARTNERS * told.max_streams, malformed.partner_hi, malformed.partner_lo
        )
        malformed, partners = malformed.take(partners >= 0), partners[partners >= 0].astype(np.uint64)
        messages = Messages.stacked([asked, closing, strays])
        kind = np.concatenate([
            np.full(len(asked), _Happened.ASKED),
            np.where(closing.service == _READ_REPLY, _Happened.READ, _Happened.ANSWERED),
            np.where(strays.service == _READ_REPLY, _Happened.STRAY_READ, _Happened.STRAY_WRITE),
        ])  # fmt: skip
        nothing = np.zeros(len(malformed), np.int64)
        unseen = partners << _PARTNER_BIT | malformed.parameter.astype(np.uint64)
        packet = np.concatenate([messages.packet, malformed.packet])
        words = np.concatenate([self._words(messages.pair, messages.word), unseen])
        # In the order of the capture, so that the first ones have a number however it is cut.
        order, number = np.argsort(packet, kind="stable"), np.empty(len(packet), np.int64)
        number[order] = self._values.numbers(words[order], told.max_streams)
        frames = asked.packet + told.first_frame, closed.frame, np.zeros(len(strays), np.int64), nothing
        unsure = np.zeros(len(packet), np.int64)
        unsure[len(asked) : len(asked) + len(closed)] = closed.unsure
        rows = _Rows(
            packet, np.concatenate([kind, nothing + _Happened.UNSEEN]), number,
            np.concatenate([messages.pair, nothing]), np.concatenate([messages.word, nothing]),
            np.concatenate([messages.service, nothing]), np.concatenate(frames), unsure,
        )  # fmt: skip
        late = found.shown < stop
        waits, shown = found.late.take(late), found.shown[late]
        if len(waits):
            of_late = _Rows(
                shown, np.full(len(waits), _Happened.LATE), self._values.find(self._words(waits.pair, waits.word)),
                waits.pair, waits.word, waits.service, waits.frame, waits.unsure,
            )  # fmt: skip
            rows = _Rows.stacked([rows, of_late])
        tells = np.isin(kind, _TELLS) | ((kind == _Happened.ANSWERED) & (messages.service == _WRITE_REPLY))
        untold = messages.take(tells & (number[: len(messages)] < 0))
        return rows.take(rows.number >= 0), untold.take(np.argsort(untold.packet, kind="stable"))

    def _learn(self, told: Told, rows: _Rows) -> None:
        """Keep what parameters are that nobody has written: what the last reply says."""
        rows = rows.take(np.isin(rows.kind, _TELLS))
        rows = rows.take(np.argsort(rows.packet, kind="stable"))
        last = self._values.last_of(rows.number)
        self._values.put_from(told, rows.number[last], rows.packet[last])

    def _follow(self, told: Told, rows: _Rows, new: Sequence[Value], asked: I64) -> list[Value | None]:
        """Follow parameters that somebody writes, and return what is written over by the writes in rows ``asked``."""
        rows = _telling(rows.take(np.lexsort((rows.frame, rows.kind, rows.packet, rows.number))))
        carries = np.isin(rows.kind, _TELLS)
        values = iter(values_in(told, rows.packet[carries]))
        written = dict(zip(asked.tolist(), new, strict=True))
        old: dict[int, Value | None] = {}
        columns = (
            rows.packet, rows.kind, rows.number, rows.pair, rows.word, rows.service, rows.frame, rows.unsure
        )  # fmt: skip
        for packet, kind, number, pair, word, service, of, unsure in zip(
            *(column.tolist() for column in columns), strict=True
        ):
            if (one := self._written.get(number)) is None:
                one = self._written[number] = _Parameter(self._values.of(number))
            key, frame = (pair, word), packet + told.first_frame
            if kind == _Happened.ASKED:
                old[packet] = one.ask(frame, key, written[packet])
            elif kind == _Happened.READ:
                one.read(next(values), of)
            elif kind == _Happened.STRAY_READ:
                one.stray_read(next(values), key)
            elif kind == _Happened.ANSWERED:
                one.answer(of, service, unsure=bool(unsure), frame=frame)
            elif kind == _Happened.LATE:
                one.give_up(key, of, frame)
            else:
                one.stray_write(key if kind == _Happened.STRAY_WRITE else None, frame)
        return [old.get(packet) for packet in asked.tolist()]

    def give_up(self, waits: Open, frame: int) -> None:
        """Take requests that nobody waits for any more in front of a frame, though no packet has shown it."""
        number = self._values.find(self._words(waits.pair, waits.word))
        for place, pair, word, of in zip(
            *(column.tolist() for column in (number, waits.pair, waits.word, waits.frame)), strict=True
        ):
            if place in self._written:
                self._written[place].give_up((pair, word), of, frame)

    def _words(self, pair: I64, word: I64) -> U64:
        """Return which parameter of which partner, whatever its port, requests and replies are about."""
        known = len(self._partner_of)
        if known < len(self._pairs):
            _, _, high, low, _ = self._pairs.words
            fresh = self._partners.numbers(high[known:], low[known:])
            self._partner_of = np.append(self._partner_of, fresh.astype(np.uint64))
        words: U64 = self._partner_of[pair] << _PARTNER_BIT | parameter_of(word).astype(np.uint64)
        return words


def _telling(rows: _Rows) -> _Rows:
    """Return rows, sorted by number, without replies behind which another one says what their parameter is.

    What a reply says to a read that was waited for does not depend on what was known before.
    """
    if not len(rows):
        return rows
    tells = np.isin(rows.kind, _TELLS)
    begins = ~tells | np.append(True, ~tells[:-1] | (rows.number[1:] != rows.number[:-1]))
    run = np.cumsum(begins) - 1
    last = np.full(int(run[-1]) + 1, -1)
    read = np.flatnonzero(rows.kind == _Happened.READ)
    # Assigned in order, so that the last one is what stays.
    last[run[read]] = read
    return rows.take(~tells | (np.arange(len(rows)) >= last[run]))
