"""Writes: who wrote which variable, over which value, and what became of it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from enum import StrEnum

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from dissectors.webvisu import Entry, Place, Request, read_reply
from nvscope.engine.runs import distinct
from nvscope.tracker.readings.form import MOST_CHARACTERS, cut_text
from nvscope.tracker.visu.controllers import Controller, controller_of
from nvscope.tracker.visu.leaving import Leaving
from nvscope.tracker.visu.limits import MOST_ENTRIES
from nvscope.tracker.visu.messages import Kind, Outcome, VisuBatch, VisuMessages
from nvscope.tracker.visu.names import is_secret, name_of, text_of

MOST_WRITES = 10_000
"""So many writes of variables are kept, the first ones."""

_MOST_BODY_BYTES = 1 << 16
_MOST_KEPT_BYTES = 1 << 26
"""Longer replies, and more of them, are not kept: what was written over is not known then."""

_MOST_RAW = 4 * MOST_CHARACTERS
"""So many bytes of a text are kept: characters may have several of them."""

_MOST_ASKERS = 256
"""Where more requests ask for a variable, what was written over is not known."""

Where = Place | str
_When = tuple[int, int]
_NEVER: _When = (-1, -1)


class WriteOutcome(StrEnum):
    """What became of a write. ``OPEN``: nobody has seen it, or can read it, or not yet."""

    OPEN = "open"
    CONFIRMED = "confirmed"
    REFUSED = "refused"
    UNANSWERED = "unanswered"


class Write(Struct):
    """One variable that was written.

    ``client`` and ``server`` are halves of addresses. ``old`` is what it was before, as it was read or written last;
    None where nobody knows, as where something may have been written since: it was asked for, and not refused, or a
    request is not known. So is ``new``, of a text of which nobody knows how far it goes. ``answer_frame`` is that of
    the reply, ``status`` its HTTP status, 0 without one. ``is_secret``: it is a password, or may be one.
    """

    time_ns: int
    frame: int
    client: tuple[int, int]
    server: tuple[int, int]
    port: int
    variable: str
    place: Where
    old: str | None
    new: str | None
    is_secret: bool
    outcome: WriteOutcome = WriteOutcome.OPEN
    answer_frame: int = 0
    status: int = 0


class Writes:
    """The writes of all clients; ``kept`` are the first ones, ``left_out`` is how many there were beside them."""

    def __init__(self) -> None:
        self.kept: list[Write] = []
        self.left_out = 0
        self._values = _Values()
        # With the controller, which may be known to be another one when the answer comes.
        self._open: dict[tuple[int, int], list[tuple[Request, list[Write], Controller]]] = defaultdict(list)

    def observe(self, part: VisuBatch, pair: I64, messages: VisuMessages, times_ns: I64, frames: I64) -> list[int]:
        """Take the messages of a batch, with the time and frame of each; return which of them nobody kept.

        ``pair`` numbers who asks whom, the same for all batches.
        """
        kind = messages.kind
        is_step = (kind == Kind.WRITE) | (kind == Kind.UNANSWERED) | self._is_written(part, messages)
        is_step |= kind == Kind.UNCLEAR
        steps = np.flatnonzero(is_step | _may_be_written(messages))
        done, beyond = 0, []
        reads = self._read(part, messages)
        columns = steps, kind[steps], np.searchsorted(reads, steps)
        for step, what, before in zip(*(column.tolist() for column in columns), strict=True):
            if what in (Kind.CUT, Kind.GAP):
                self._values.lose(_controller(part, step, messages), int(frames[step]), step)
                continue
            request, key = part.requests[int(messages.asked[step])], int(pair[step])
            if what == Kind.WRITE:
                # Writes alone ask for what is known, and of all else it is noted when it was.
                self._learn(part, messages, reads[done:before], frames)
                done = before
                kept = self._write(part, messages, step, key, int(times_ns[step]), int(frames[step]))
                beyond += [step] * (len(request.entries) - kept)
            elif request.writes:
                self._answer(part, key, messages, step, int(frames[step]))
        self._learn(part, messages, reads[done:], frames)
        return beyond

    def so_far(self, given_up: Iterable[Leaving]) -> Sequence[Write]:
        """Return the writes that are kept, with what became of them, and of those that were given up meanwhile."""
        gone: set[int] = set()
        for left in given_up:
            for one, writes, _ in self._open.get((left.pair, left.asked_frame), ()):
                if one == left.request and writes and id(writes[0]) not in gone:
                    gone.update(map(id, writes))
                    break
        if not gone:
            return tuple(self.kept)
        return tuple(replace(one, outcome=WriteOutcome.UNANSWERED) if id(one) in gone else one for one in self.kept)

    def _is_written(self, part: VisuBatch, messages: VisuMessages) -> Bool:
        writes = np.array([one.writes for one in part.requests] + [False], np.bool_)
        own: Bool = (messages.kind == Kind.REPLY) & writes[messages.asked]
        return own

    def _read(self, part: VisuBatch, messages: VisuMessages) -> I64:
        """Return the replies from which values are known."""
        valued = np.array([not (one.writes or one.query) for one in part.requests] + [False], np.bool_)
        good = (messages.outcome == Outcome.DONE) | (messages.outcome == Outcome.MISCOUNTED)
        return np.flatnonzero((messages.kind == Kind.REPLY) & good & valued[messages.asked])

    def _learn(self, part: VisuBatch, messages: VisuMessages, replies: I64, frames: I64) -> None:
        """Note the last one of replies to each request of each server.

        Two bodies may ask the same: what came last counts, so they are taken in the order of their replies.
        """
        if not len(replies):
            return
        asks = messages.pair[replies] * (len(part.requests) + 1) + messages.asked[replies]
        kinds = distinct(asks)
        last = np.empty(len(kinds), np.int64)
        last[np.searchsorted(kinds, asks)] = replies  # of one kind, the last one stays
        for row in np.sort(last).tolist():
            body, request = part.data[int(messages.start[row]) : int(messages.stop[row])], int(messages.asked[row])
            self._values.read(_controller(part, row, messages), part.requests[request], body, int(frames[row]), row)

    def _write(
        self, part: VisuBatch, messages: VisuMessages, step: int, key: int, time_ns: int, frame: int
    ) -> int:  # fmt: skip
        """Note a write of some variables; return of how many."""
        number = int(messages.pair[step])
        client_hi, client_lo, server_hi, server_lo, port = (int(word[number]) for word in part.pairs)
        request, names = part.requests[int(messages.asked[step])], part.namings[int(messages.naming[step])]
        controller, found = _controller(part, step, messages), []

        def said(entry: Entry, value: str | None) -> str | None:
            return value and cut_text(text_of(entry, names, value))

        for entry in request.entries[: MOST_WRITES - len(self.kept)]:
            old = self._values.known(controller, entry.place)
            found.append(
                Write(
                    time_ns, frame, (client_hi, client_lo), (server_hi, server_lo), port, name_of(entry, names),
                    entry.place, said(entry, old), said(entry, entry.value), is_secret(entry, names),
                )
            )  # fmt: skip
        self.kept += found
        self.left_out += len(request.entries) - len(found)
        if found:
            self._open[key, frame].append((request, found, controller))
            for write in found:
                self._values.doubt(controller, write.place, id(write), (frame, step))
        return len(found)

    def _answer(self, part: VisuBatch, key: int, messages: VisuMessages, step: int, frame: int) -> None:
        """Note what became of a write."""
        request = part.requests[int(messages.asked[step])]
        waiting = self._open.get((key, int(messages.asked_frame[step])), [])
        place = next((place for place, (one, *_) in enumerate(waiting) if one == request), None)
        if place is None:
            return
        _, writes, controller = waiting.pop(place)
        if messages.kind[step] == Kind.UNCLEAR or messages.outcome[step] == Outcome.UNREAD:
            return
        if messages.outcome[step] == Outcome.REFUSED:
            for write in writes:
                self._values.trust(controller, write.place, id(write))
        outcome, now = WriteOutcome.UNANSWERED, _controller(part, step, messages)
        if messages.kind[step] == Kind.REPLY:
            is_done = messages.outcome[step] == Outcome.DONE
            outcome = WriteOutcome.CONFIRMED if is_done else WriteOutcome.REFUSED
        for write, entry in zip(writes, request.entries, strict=False):
            write.outcome = outcome
            if outcome is not WriteOutcome.UNANSWERED:
                write.answer_frame, write.status = frame, int(messages.status[step])
            if outcome is WriteOutcome.CONFIRMED:
                self._values.written(now, write.place, entry.value and entry.value[:_MOST_RAW], frame, step)


def _controller(part: VisuBatch, step: int, messages: VisuMessages) -> Controller:
    """Return whose variables a message is about."""
    return controller_of(part.pairs, int(messages.pair[step]), part.namings[int(messages.naming[step])].apart)


def _may_be_written(messages: VisuMessages) -> Bool:
    """Tell which messages are requests of which nobody knows what they are, or missing bytes of such."""
    is_request = (messages.kind == Kind.CUT) & (messages.asked_frame == 0)
    found: Bool = is_request | (messages.kind == Kind.GAP)
    return found


class _Values:
    """What is known of the variables of all controllers."""

    def __init__(self) -> None:
        self._replies: dict[tuple[Controller, Request], tuple[_When, bytes]] = {}
        self._askers: dict[tuple[Controller, Where], list[tuple[Request, int]]] = defaultdict(list)
        self._written: dict[tuple[Controller, Where], tuple[_When, str | None]] = {}
        self._bytes = self._entries = 0
        # When there was no room for what came last, or it is not known: what was known of a controller before may have
        # changed since.
        self._lost: dict[Controller, _When] = {}
        # When writes of a variable were asked for, by what is kept of each; but for those that were refused.
        self._doubts: dict[tuple[Controller, Where], dict[int, _When]] = {}

    def read(self, controller: Controller, request: Request, body: bytes, frame: int, row: int) -> None:
        """Note the reply to a read; ``frame`` and ``row`` say what was first."""
        key = controller, request
        before = self._replies.get(key)
        kept_bytes = self._bytes - (len(before[1]) if before else 0) + len(body)
        if len(body) > _MOST_BODY_BYTES or kept_bytes > _MOST_KEPT_BYTES or not (before or self._has_room(key)):
            self.lose(controller, frame, row)
            return
        if before is None:
            self._entries += len(request.entries)
            for place, entry in enumerate(request.entries):
                self._askers[controller, entry.place].append((request, place))
        self._bytes = kept_bytes
        self._replies[key] = (frame, row), body

    def lose(self, controller: Controller, frame: int, row: int) -> None:
        """Note that any variable may have been written since; what is told may be of before what is known."""
        self._lost[controller] = max(self._lost.get(controller, _NEVER), (frame, row))

    def doubt(self, controller: Controller, place: Where, write: int, at: _When) -> None:
        """Note that a variable may have been written, by which write; no more of these are kept than of writes."""
        self._doubts.setdefault((controller, place), {})[write] = at

    def trust(self, controller: Controller, place: Where, write: int) -> None:
        """Note that a variable was not written."""
        self._doubts.get((controller, place), {}).pop(write, None)

    def _has_room(self, key: tuple[Controller, Request]) -> bool:
        controller, request = key
        if self._entries + len(request.entries) > MOST_ENTRIES:
            return False
        return all(len(self._askers.get((controller, one.place), ())) < _MOST_ASKERS for one in request.entries)

    def written(self, controller: Controller, place: Where, value: str | None, frame: int, row: int) -> None:
        """Note that a value was written, None for one that nobody knows."""
        if len(self._written) < MOST_WRITES or (controller, place) in self._written:
            self._written[controller, place] = (frame, row), value
        else:
            self.lose(controller, frame, row)

    def known(self, controller: Controller, place: Where) -> str | None:
        """Return what a variable was read or written as last, None where nobody knows."""
        at, found = self._lost.get(controller, _NEVER), None
        written = self._written.get((controller, place))
        if written is not None and written[0] >= at:
            at, found = written
        for request, position in self._askers.get((controller, place), ()):
            reply = self._replies[controller, request]
            if reply[0] >= at:
                values = read_reply(request, reply[1]).values
                if position < len(values):
                    at, found = reply[0], values[position]
        # They are asked for in the order of time, so that the last one is the latest.
        doubted = reversed(self._doubts.get((controller, place), {}).values())
        return None if next(doubted, _NEVER) > at else found
