"""Readings of pages: what values variables had, as replies to reads say, and writes that were confirmed.

Values of a reply are by position. Replies that may be divided in several ways have none; of one with more or fewer
values than were asked for, those that are there count. A write counts where its reply comes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from dissectors.columns import Columns
from dissectors.webvisu import UNREADABLE, Place, read_reply
from nvscope.capture.spans import stretches
from nvscope.engine.runs import rows_by, spans
from nvscope.engine.told import Told
from nvscope.tracker.readings.form import Form
from nvscope.tracker.readings.readings import LEFT_OUT, MOST_AT_ONCE, Holes, Readings
from nvscope.tracker.visu.controllers import controller_of
from nvscope.tracker.visu.messages import Kind, Outcome, VisuBatch
from nvscope.tracker.visu.number_texts import forms_and_bits
from nvscope.tracker.visu.variables import PageVariable, PageVariables

_SEPARATOR = ord("|")
_QUESTION = ord("?")


class _Spans(Columns, Struct, frozen=True):
    """Texts: the message that says each, its place among the message's values, and where it lies in data."""

    message: I64
    position: I64
    start: I64
    stop: I64


class ReadPages:
    """The readings of pages (``nvscope.tracker.readings.readings.ReadValues``); None wants all variables."""

    title: ClassVar[str] = "web visualization"
    holder: ClassVar[str] = "controller"
    # Nobody promised an interval: a page asks when it has its reply, and its browser when it likes.
    late_percent: ClassVar[int] = 250
    tells_gaps: ClassVar[bool] = False
    holes: Sequence[Holes] = ()
    told_ns: Sequence[tuple[I64, int]] = ()
    missed = 0

    def __init__(self, wanted: Callable[[PageVariable], bool] | None = None) -> None:
        self.variables = PageVariables()
        self.hidden = 0
        self.meant: set[int] = set()
        self._wanted = wanted

    @property
    def known(self) -> Sequence[PageVariable]:
        """The variables seen so far, by number."""
        return self.variables.known

    @property
    def left_out(self) -> bool:
        """Whether there was no room for some variables."""
        return self.variables.left_out

    def of(self, told: Told, part: VisuBatch) -> Iterator[Readings]:
        """Yield the readings of a batch, in stretches of so many that memory stays bounded."""
        messages = part.messages
        replies = telling(part)
        if told.chosen is not None:
            replies = replies[told.chosen[messages.row[replies]]]
        if not len(replies):
            return
        entries = np.array([len(one.entries) for one in part.requests], np.int64)[messages.asked[replies]]
        bars = np.flatnonzero(np.frombuffer(part.data, np.uint8) == _SEPARATOR)
        for piece in stretches(np.maximum(entries, 1), MOST_AT_ONCE, MOST_AT_ONCE):
            yield self._read(told, part, replies[piece], entries[piece], bars)

    def lists_of(self, part: VisuBatch, chosen: Bool) -> Collection[str]:
        """Return what stands for the controllers of the messages whose packets a mask chooses."""
        messages = part.messages
        rows = chosen[messages.row]
        found = np.unique(np.stack([messages.pair[rows], messages.naming[rows]]), axis=1).T.tolist()
        return {controller_of(part.pairs, pair, part.namings[naming].apart).list for pair, naming in found}

    def _read(self, told: Told, part: VisuBatch, replies: I64, entries: I64, bars: I64) -> Readings:
        messages = part.messages
        octets = np.frombuffer(part.data, np.uint8)
        start, stop = messages.start[replies], messages.stop[replies]
        # Written values lie nowhere in the bodies of replies; others have to be put together.
        usual = (messages.outcome[replies] == Outcome.DONE) & (messages.fields[replies] == entries) & (entries > 0)
        usual[usual] = (octets[start[usual]] == _SEPARATOR) & (octets[stop[usual] - 1] == _SEPARATOR)
        own = np.flatnonzero(usual)
        count = entries[own]
        bar = spans(np.searchsorted(bars, start[own]), count)
        found = _Spans(np.repeat(replies[own], count), spans(np.zeros_like(count), count), bars[bar] + 1, bars[bar + 1])
        data = part.data
        if len(own) < len(replies):
            further, data = _put_together(part, replies[~usual])
            found = _Spans.stacked([found, further])
            found = found.take(np.lexsort((found.position, found.message)))
        return self._told(told, part, replies, found, data)

    def _told(self, told: Told, part: VisuBatch, replies: I64, found: _Spans, data: bytes) -> Readings:
        messages, variables = part.messages, self.variables
        numbers, hides = [np.empty(0, np.int64)], [np.empty(0, np.bool_)]
        begin, count = np.empty(len(replies), np.int64), 0
        keys = [getattr(messages, name)[replies] for name in ("naming", "pair", "asked")]
        # What replies have no values for was asked for all the same.
        for (naming, pair, asked), rows in rows_by(keys):
            controller, request = controller_of(part.pairs, pair, part.namings[naming].apart), part.requests[asked]
            own = self._numbers(variables.of(controller, request, naming, part.namings[naming], told.max_streams))
            numbers.append(own)
            hides.append(np.array([one >= 0 and variables.known[one].is_secret for one in own.tolist()], np.bool_))
            begin[rows] = count
            count += len(own)
        at = begin[np.searchsorted(replies, found.message)] + found.position
        variable, secret = np.concatenate(numbers)[at], np.concatenate(hides)[at]
        kept = variable >= 0
        if not kept.all():
            found, variable, secret = found.take(kept), variable[kept], secret[kept]
        form, bits = forms_and_bits(variables.kinds, variable, data, found.start, found.stop)
        octets = np.frombuffer(data, np.uint8)
        unread = found.stop - found.start == len(UNREADABLE)
        for place in range(len(UNREADABLE)):
            unread[unread] = octets[found.start[unread] + place] == _QUESTION
        form[unread] = int(Form.NOTHING)
        self.hidden += int(np.count_nonzero(secret & ~unread))

        row, names = messages.row[found.message], messages.naming[found.message]

        def text(place: int) -> str:
            said = data[int(found.start[place]) : int(found.stop[place])].decode("latin-1")
            encoding = part.namings[int(names[place])].encoding
            is_text = encoding is not None and variables.known[int(variable[place])].is_text
            return encoding.decoded(said) if encoding is not None and is_text else said

        def called(number: int, naming: int) -> str:
            where = variables.known[number].where
            return part.namings[naming].names.get(where, where.text) if isinstance(where, Place) else where

        return Readings(variable, row, form, bits, secret, names, text, called)

    def _numbers(self, own: I64) -> I64:
        """Return the numbers of the variables of a request, ``LEFT_OUT`` of those that are not wanted."""
        wanted, known = self._wanted, self.variables.known
        if wanted is not None:
            own = np.array([one if one >= 0 and wanted(known[one]) else LEFT_OUT for one in own.tolist()], np.int64)
        self.meant.update(own[own >= 0].tolist())
        return own


def telling(part: VisuBatch) -> I64:
    """Return the messages that tell values, rising."""
    messages = part.messages
    writes = np.array([one.writes for one in part.requests] + [False], np.bool_)[messages.asked]
    query = np.array([one.query for one in part.requests] + [False], np.bool_)[messages.asked]
    done = messages.outcome == Outcome.DONE
    reads = ~writes & ~query & (done | (messages.outcome == Outcome.MISCOUNTED))
    return np.flatnonzero((messages.kind == Kind.REPLY) & (reads | (writes & done)))


def _put_together(part: VisuBatch, replies: I64) -> tuple[_Spans, bytes]:
    """Return values that are read one by one, and data in which they lie behind all that was there."""
    messages = part.messages
    texts: list[bytes] = []
    told: list[tuple[int, int]] = []
    for row in replies.tolist():
        request = part.requests[int(messages.asked[row])]
        if request.writes:
            values = [entry.value for entry in request.entries]
        else:
            body = part.data[int(messages.start[row]) : int(messages.stop[row])]
            values = [UNREADABLE if value is None else value for value in read_reply(request, body).values]
        for place, value in enumerate(values):
            if value is None:  # of a text that was written, nobody knows how far it goes
                continue
            told.append((row, place))
            texts.append(value.encode("latin-1", "replace"))
    length = np.array([len(text) for text in texts], np.int64)
    stop = len(part.data) + np.cumsum(length)
    message, position = np.array(told, np.int64).reshape(-1, 2).T
    return _Spans(message, position, stop - length, stop), b"".join([part.data, *texts])
