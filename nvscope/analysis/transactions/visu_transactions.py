"""The transactions of web visualization pages: a reply each, a write that is asked for, and what nobody answered."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors import address
from dissectors.batch import I64
from nvscope.analysis.transactions.transaction import (
    NOTHING,
    Brought,
    Group,
    Outcome,
    Pair,
    Protocol,
    Room,
    Said,
    Transaction,
    last_of_each,
)
from nvscope.engine.told import Told
from nvscope.tracker.visu.controllers import own_port
from nvscope.tracker.visu.events import OK
from nvscope.tracker.visu.on_demand import NAME

if TYPE_CHECKING:  # most plants have none
    from dissectors.webvisu import Entry, Place, Request
    from nvscope.tracker.visu.leaving import Leaving, LeavingClients
    from nvscope.tracker.visu.messages import VisuBatch
    from nvscope.tracker.visu.names import Naming
    from nvscope.view.lines.visu_words import Variable

MOST_REMEMBERED = 100_000
"""So many values are remembered, to be told as old ones where they are written over."""

_MOST_OPEN = 10_000
_UNREADABLE = "???"  # ``dissectors.webvisu.UNREADABLE``, which is not imported before there is any
_NUMBER = re.compile(r"-?[0-9]{1,15}(\.[0-9]{1,15})?\Z")
_OLD = tuple[str | None, ...]
_CONTROLLER = tuple[str, int]


class VisuTransactions:
    """Finds transactions from one batch to the next.

    The old value of a variable is the one that the controller last told, whoever had asked, or the last one that was
    written and confirmed. Values that may be secret are hidden from whoever is told of them.
    """

    def __init__(self, room: Room) -> None:
        self._room = room
        self._pairs: list[Pair] = []
        self._values: dict[tuple[_CONTROLLER, Place | str], str] = {}
        self._olds: dict[tuple[int, int], deque[_OLD]] = {}
        self._leaving: LeavingClients | None = None
        self._namings: Sequence[Naming] = ()
        # The frames of requests of which it was told that their clients gave up, before web traffic showed it.
        self._given_up: set[int] = set()

    def of(self, told: Told, last: int | None = None) -> Brought:
        """Return what a batch brings, which follows those before.

        With ``last``, there are so many of each pair and ``Group`` at most that write nothing: the last ones.
        """
        part = told.parts.get(NAME)
        if part is None:
            if self._leaving is None:
                return NOTHING
            self._leaving.observe(told, None)
            given_up = self._gone(self._leaving)
            return NOTHING._replace(pairs=self._pairs, transactions=given_up) if given_up else NOTHING
        from nvscope.tracker.visu.leaving import LeavingClients  # noqa: PLC0415
        from nvscope.tracker.visu.messages import Kind, VisuBatch  # noqa: PLC0415
        from nvscope.tracker.visu.messages import Outcome as Replied  # noqa: PLC0415

        assert isinstance(part, VisuBatch)
        self._describe(part)
        messages = part.messages
        kind = messages.kind
        asks = (kind == Kind.READ) | (kind == Kind.WRITE)
        asked = np.append(np.array([one.writes for one in part.requests], np.bool_), False)
        tells = np.isin(kind, (Kind.REPLY, Kind.CUT, Kind.UNANSWERED, Kind.REFUSED)) & (messages.asked >= 0)
        writes = asked[messages.asked] & (tells | (kind == Kind.WRITE))
        reads = np.flatnonzero(tells & ~writes)
        group = np.where((kind == Kind.REPLY) & (messages.outcome == Replied.DONE), Group.READ, Group.WRONG)[reads]
        shown = set(reads[last_of_each(messages.pair[reads], group, last)].tolist())
        rows = self._to_read(part, reads[kind[reads] == Kind.REPLY], np.flatnonzero(writes), shown, last)
        found = [one for row in rows.tolist() if (one := self._take(told, part, row, row in shown)) is not None]
        self._namings, self._leaving = part.namings, self._leaving or LeavingClients()
        self._leaving.observe(told, part.leaving)
        found += self._gone(self._leaving)
        return Brought(self._pairs, messages.pair[asks], messages.row[asks], kind[asks] == Kind.WRITE, found)

    def _describe(self, part: VisuBatch) -> None:
        """Tell pairs by their texts."""
        words = (word[len(self._pairs) :].tolist() for word in part.pairs)
        for client_hi, client_lo, server_hi, server_lo, port in zip(*words, strict=True):
            ends = address.text(client_hi, client_lo), address.text(server_hi, server_lo)
            self._pairs.append(Pair(Protocol.VISU, *ends, int(port)))

    @staticmethod
    def _to_read(part: VisuBatch, replies: I64, writes: I64, shown: set[int], last: int | None) -> I64:
        """Return the messages to be looked at, rising: all writes, what is shown, and what tells values over which
        something is, or may be, written.

        Of replies to the same read with no write between, the last one tells all that the others do.
        """
        if last is None:
            return np.union1d(np.array(sorted(shown), np.int64), writes)
        messages = part.messages
        behind = np.searchsorted(writes, replies)
        order = np.lexsort((replies, messages.asked[replies], behind))
        keys = np.stack([behind[order], messages.asked[replies[order]]])
        is_last = np.append((np.diff(keys) != 0).any(0), True) if len(order) else np.empty(0, np.bool_)
        return np.union1d(np.union1d(np.array(sorted(shown), np.int64), writes), replies[order[is_last]])

    def _take(self, told: Told, part: VisuBatch, row: int, shown: bool) -> Transaction | None:
        """Take a message, and return what it tells, where that is ``shown`` or of a write."""
        from nvscope.tracker.visu.messages import UNMEASURED_NS, Kind  # noqa: PLC0415
        from nvscope.view.lines.visu_words import said_of  # noqa: PLC0415

        messages = part.messages
        kind, number = Kind(int(messages.kind[row])), int(messages.pair[row])
        pair, request = self._pairs[number], part.requests[int(messages.asked[row])]
        names = part.namings[int(messages.naming[row])]
        controller = pair.server, names.apart or own_port(pair.port)
        known_frame = int(messages.row[row]) + told.first_frame
        time_ns = int(told.packets.ts_ns[messages.row[row]])
        asked_frame = known_frame if kind is Kind.WRITE else int(messages.asked_frame[row])
        if (over := part.over.get(row)) is not None:
            if asked_frame in self._given_up:
                return None
            known_frame, time_ns = over
        outcome = _outcome(part, row, kind, request)
        olds: _OLD = ()
        if request.writes:
            olds = self._old_values(controller, number, asked_frame, kind, request)
            variables = _asked(request, names)
            if outcome is Outcome.CONFIRMED:
                self._remember(controller, variables)
        else:
            variables = said_of(part, row)
            if outcome in (Outcome.ANSWERED, Outcome.MISCOUNTED) and not request.query:
                self._remember(controller, variables[: max(int(messages.fields[row]), 0)])
        if not (shown or request.writes):
            return None
        said = self._first(variables, olds, names)
        status, latency_ns = int(messages.status[row]), int(messages.latency_ns[row])
        return Transaction(
            pair, time_ns, asked_frame if kind is Kind.UNANSWERED else known_frame, known_frame, asked_frame,
            request.writes, outcome, said, max(len(variables) - self._room.said, 0),
            latency_ns=None if kind is not Kind.REPLY or latency_ns == UNMEASURED_NS else latency_ns,
            detail=f"HTTP status {status}" if kind in (Kind.REPLY, Kind.REFUSED) and status != OK else "",
            is_part=request.is_part,
        )  # fmt: skip

    def _gone(self, leaving: LeavingClients) -> list[Transaction]:
        """Return what time has told of clients that gave up, where that was not told before."""
        over, before = leaving.given_up(), self._given_up
        self._given_up = {one.asked_frame for one in over}
        return [self._left(one) for one in over if one.asked_frame not in before]

    def _left(self, one: Leaving) -> Transaction:
        """Return that a client gave up."""
        request, pair, names = one.request, self._pairs[one.pair], self._namings[one.naming]
        olds = self._answered(one.pair, one.asked_frame) if request.writes else ()
        said = self._first(_asked(request, names), olds, names)
        return Transaction(
            pair, one.over_ns, one.asked_frame, one.closed.over_frame, one.asked_frame, request.writes,
            Outcome.UNANSWERED, said, max(len(request.entries) - self._room.said, 0), is_part=request.is_part,
        )  # fmt: skip

    def _first(self, variables: Sequence[Variable], olds: _OLD, names: Naming) -> tuple[Said, ...]:
        """Return what is told of the first variables of a request."""
        return tuple(
            self._said(variable, olds[place] if place < len(olds) else None, names)
            for place, variable in enumerate(variables[: self._room.said])
        )

    def _old_values(
        self, controller: _CONTROLLER, number: int, asked_frame: int, kind: int, request: Request
    ) -> _OLD:  # fmt: skip
        """Return the values over which a request writes: those known when it was asked for."""
        from nvscope.tracker.visu.messages import Kind  # noqa: PLC0415

        key = number, asked_frame
        if kind == Kind.WRITE:
            olds = tuple(self._values.get((controller, one.place)) for one in request.entries)
            if len(self._olds) >= _MOST_OPEN:
                del self._olds[next(iter(self._olds))]
            self._olds.setdefault(key, deque()).append(olds)
            return olds
        return self._answered(number, asked_frame)

    def _answered(self, number: int, asked_frame: int) -> _OLD:
        """Return the values over which a request wrote of which it is known now what became of it."""
        key = number, asked_frame
        waiting = self._olds.get(key)
        if not waiting:
            return ()
        found = waiting.popleft()
        if not waiting:
            del self._olds[key]
        return found

    def _remember(self, controller: _CONTROLLER, variables: Sequence[Variable]) -> None:
        """Take the values that variables have now; nobody knows those that the controller could not read."""
        values = self._values
        for entry, _, value in variables:
            key = controller, entry.place
            if value is None or value == _UNREADABLE:
                values.pop(key, None)
            elif len(values) < MOST_REMEMBERED or key in values:
                values[key] = value

    def _said(self, variable: Variable, old: str | None, names: Naming) -> Said:
        """Return what is told of a variable: what may be secret is hidden, by the names that are known now.

        Of what the controller could not read, the text alone says so.
        """
        from nvscope.view.lines.visu_words import shown  # noqa: PLC0415

        entry, name, value = variable
        cut = self._room.cut
        text = None if value is None else cut(shown(entry, names, value))
        said = None if value == _UNREADABLE else json_value(entry, text)
        if old is None:
            return Said(cut(name), said, text)
        old_text = cut(shown(entry, names, old))
        return Said(cut(name), said, text, json_value(entry, old_text), old_text)


def _asked(request: Request, names: Naming) -> Sequence[Variable]:
    """Return the variables of a request, with the values that it writes."""
    from nvscope.tracker.visu.names import name_of  # noqa: PLC0415
    from nvscope.view.lines.visu_words import Variable  # noqa: PLC0415

    return [Variable(one, name_of(one, names), one.value) for one in request.entries]


def _outcome(part: VisuBatch, row: int, kind: int, request: Request) -> Outcome:
    from nvscope.tracker.visu.messages import Kind  # noqa: PLC0415
    from nvscope.tracker.visu.messages import Outcome as Replied  # noqa: PLC0415

    if kind == Kind.REPLY:
        return {
            Replied.DONE: Outcome.CONFIRMED if request.writes else Outcome.ANSWERED, Replied.REFUSED: Outcome.REFUSED,
            Replied.MISCOUNTED: Outcome.MISCOUNTED, Replied.AMBIGUOUS: Outcome.AMBIGUOUS,
            Replied.UNREAD: Outcome.OPEN if request.writes else Outcome.ANSWERED,
            Replied.STATUS: Outcome.REFUSED if request.writes else Outcome.STATUS,
        }[Replied(int(part.messages.outcome[row]))]  # fmt: skip
    if kind == Kind.REFUSED:
        return Outcome.REFUSED if request.writes else Outcome.STATUS
    return {Kind.CUT: Outcome.CUT, Kind.UNANSWERED: Outcome.UNANSWERED}.get(Kind(kind), Outcome.OPEN)


def json_value(entry: Entry, text: str | None) -> Any:
    """Return a value as JSON has it: a number where the variable is one, text as it was said elsewhere."""
    if text is None or entry.is_string or not _NUMBER.match(text):
        return text
    return float(text) if "." in text else int(text)
