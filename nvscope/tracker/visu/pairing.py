"""Pairing: which reply answers which request, message by message around what is peculiar, and all at once between."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from dissectors.webvisu import Likeness, is_like_reply
from dissectors.webvisu_lists import LIST_BEGIN_BYTES
from nvscope.engine.runs import runs_of, stable_order
from nvscope.tracker.pieces import NEVER
from nvscope.tracker.visu.awaited import Early, Happened
from nvscope.tracker.visu.conversation import Conversation
from nvscope.tracker.visu.events import OK
from nvscope.tracker.visu.going_on import GoingOn, Over
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.http_messages import HttpMessages
from nvscope.tracker.visu.missing_replies import MissingReplies
from nvscope.tracker.visu.one_way import OneWay, more_bytes
from nvscope.tracker.visu.plain_exchanges import AskedFor, Exchanged, Said, columns_of, paired, told_of
from nvscope.tracker.visu.reach import NOWHERE, UNKNOWN
from nvscope.tracker.visu.unseen_requests import Answered

_FEW = 16
"""So many messages of a connection take as long one after the other as at once."""

_AT_A_TIME = 32
"""So many messages are taken out of the columns at a time, to go in turn."""

_MOST_EARLY_BYTES = 1 << 16
"""A longer response that comes before its request is whole is not read."""

_MANY = 1 << 12
"""No more are looked at, so that little is looked at in vain where a reply is too many again and again."""


class _Rows(NamedTuple):
    """Messages by connection, and in each in their order.

    ``surplus`` is how many more of those up to each message, from the first one of all on, are requests than replies.
    """

    rows: I64
    by_server: Bool
    surplus: I64


class Pairing:
    """The messages of a batch; ``is_plain`` is as in ``plain_rows``, ``asked`` as in ``Said``.

    ``conversations`` are the state of connections, ``closed`` those whose client has closed its side while its requests
    waited; of these, ``going_on`` tells whether it waits still. ``unheard`` are those in which requests wait, and of
    whose server nothing was captured; of these, ``one_way`` tells whether there was something. Of those that are given
    up, ``missing`` tells whether the capture lacks a reply. ``left_out`` are the
    requests so far for which there was no room. ``over`` is what time told of clients that gave up, by connection and
    order.
    """

    def __init__(
        self, http: HttpMessages, is_plain: Bool, asked: I64, asked_for: AskedFor,
        conversations: dict[int, Conversation], going_on: GoingOn, closed: set[int],
        one_way: OneWay, unheard: set[int], missing: MissingReplies,
    ) -> None:  # fmt: skip
        self._http = http
        self._is_plain = is_plain
        self._asked, self._asked_for = asked, asked_for
        self._conversations = conversations
        self._going_on, self._closed = going_on, closed
        self._one_way, self._unheard, self._missing = one_way, unheard, missing
        self._happened: list[Happened] = []
        self._later: list[tuple[Form, int, int, int]] = []
        self.left_out = 0
        self.over: dict[tuple[int, int], Over] = {}

    @cached_property
    def _columns(self) -> I64:
        # Not of a batch in which nothing is paired at once.
        return columns_of(self._http, self._asked)

    @property
    def messages(self) -> HttpMessages:
        """The messages of the batch, and behind them those of earlier ones that are told with it."""
        return self._http.with_later(self._later) if self._later else self._http

    def pair(self, rows: I64) -> list[Said]:
        """Take messages, all of their connections, by stream and in each in its order; return what is to be told."""
        rows = rows[np.argsort(self._http.order[rows], kind="stable")]
        connection = self._http.stream[rows] >> 1
        in_order = stable_order(connection, int(connection.max(initial=0)) + 1)
        rows, connection = rows[in_order], connection[in_order]
        by_server = (self._http.stream[rows] & 1) == 1
        of_all = _Rows(rows, by_server, np.where(by_server, -1, 1).cumsum())
        peculiar = np.flatnonzero(~self._is_plain[rows]).tolist()
        exchanged: list[Exchanged] = []
        start, stop = runs_of(connection)
        for number, *run in zip(*(column.tolist() for column in (connection[start], start, stop)), strict=True):
            conversation = self._conversations.setdefault(number, Conversation(number))
            self._take(conversation, of_all, run, peculiar, exchanged)
            if conversation.waiting and not conversation.is_heard:
                self._unheard.add(number)
            else:
                self._unheard.discard(number)
                if conversation.closed is not None and conversation.waiting:
                    self._closed.add(number)
            self.left_out += conversation.left_out
            conversation.left_out = 0
        for number in sorted(self._closed):
            conversation = self._conversations[number]
            self._leave(conversation, NEVER)
            # Another connection may have begun between the same ends.
            if conversation.closed is None or not conversation.waiting:
                self._closed.discard(number)
            else:
                conversation.closed = self._going_on.passed(conversation.closed)
        for number in self._one_way.of_clients(self._unheard):
            conversation = self._conversations[number]
            self._miss(conversation, NEVER)
            if not conversation.waiting:
                self._unheard.discard(number)
        return [told_of(exchanged, self._asked_for), self._said()]

    def _take(
        self, conversation: Conversation, of_all: _Rows, run: list[int], peculiar: list[int], exchanged: list[Exchanged]
    ) -> None:  # fmt: skip
        """Take the messages of a connection, in their order; add what is paired at once."""
        begin, end = run
        rows = of_all.rows
        least = 1
        while begin < end:
            if end - begin >= _FEW and _may_go_at_once(conversation):
                stop = min(self._next_of(peculiar, begin), end, begin + _MANY)
                stop = self._in_front_of_surplus(conversation, of_all, begin, stop)
                stop = self._without_equals(rows, begin, stop, end)
                if stop - begin >= _FEW:
                    own, by_server = rows[begin:stop], of_all.by_server[begin:stop]
                    asks, answers = own[~by_server], own[by_server]
                    found = paired(self._columns, self._asked_for, conversation, asks, answers)
                    if found is not None:
                        exchanged.append(found)
                        begin, least = stop, 1
                        continue
            # Twice as many each time: not to be tried again and again where it does not succeed.
            least *= 2
            begin = self._take_in_turn(conversation, rows, (begin, end), peculiar, least)

    @staticmethod
    def _next_of(peculiar: list[int], place: int) -> int:
        """Return the first peculiar message from a place on, one behind all without any."""
        following = bisect_left(peculiar, place)
        return peculiar[following] if following < len(peculiar) else NEVER

    @staticmethod
    def _in_front_of_surplus(conversation: Conversation, of_all: _Rows, begin: int, stop: int) -> int:
        """Return the place of the first of some messages that is a reply to which no request waits, else their end."""
        before = int(of_all.surplus[begin - 1]) if begin else 0
        is_surplus = of_all.surplus[begin:stop] < before - len(conversation.waiting)
        return begin + int(is_surplus.argmax()) if is_surplus.any() else stop

    def _without_equals(self, rows: I64, begin: int, stop: int, end: int) -> int:
        """Return the last place up to one that parts no messages of one order, for what is said is sorted by that."""
        while begin < stop < end and self._is_with_next(rows, stop - 1):
            stop -= 1
        return stop

    def _is_with_next(self, rows: I64, place: int) -> bool:
        order = self._http.order
        return bool(order[rows[place]] == order[rows[place + 1]])

    def _take_in_turn(
        self, conversation: Conversation, rows: I64, run: tuple[int, int], peculiar: list[int], least: int
    ) -> int:  # fmt: skip
        """Take messages of a connection in turn, at ``least`` so many, up to where the following may go at once.

        Return the place behind them.
        """
        begin, end = run
        enough, following = begin + least, self._next_of(peculiar, begin)
        for first in range(begin, end, _AT_A_TIME):
            for place, message in enumerate(self._in_columns(rows[first : min(first + _AT_A_TIME, end)]), first + 1):
                self._take_one(conversation, *message)
                if place >= enough and _may_go_at_once(conversation):
                    if following < place:
                        following = self._next_of(peculiar, place)
                    if min(following, end) - place >= _FEW and not self._is_with_next(rows, place - 1):
                        return place
        return end

    def _in_columns(self, rows: I64) -> Iterator[tuple[int, ...]]:
        """Return what is known of messages: row, stream, form, what is asked for, order and arrival of each."""
        http = self._http
        columns = rows, http.stream[rows], http.form[rows], self._asked[rows], http.order[rows], http.arrival_ns[rows]
        return zip(*(column.tolist() for column in columns), strict=True)

    def _take_one(
        self, conversation: Conversation, row: int, stream: int, form: int, ask: int, order: int, arrival_ns: int
    ) -> None:  # fmt: skip
        http, tell = self._http, self._happened.append
        if conversation.closed is not None:
            self._leave(conversation, order)
        if conversation.waiting and not conversation.is_heard:
            self._miss(conversation, order)
        if stream & 1:
            if not conversation.is_spoken:
                self._note_unasked(conversation, row)
            elif self._is_to_unseen(conversation, row):
                conversation.tell_unseen(order, tell)
            if not conversation.waits and (early := self._early(conversation, row, order)) is not None:
                conversation.keep(early)
                if not early.is_lost:
                    return
            if http.forms[form].what is What.END and conversation.waiting:
                lacks = self._missing.at_end(order, conversation)
                conversation.miss_replies(order, tell, lacks)
            whole = self._form(row, is_needed=conversation.turns.is_tried)
            conversation.take_from_server(whole, order, arrival_ns, row, tell, http.reach.at(row))
            if not conversation.is_spoken and http.forms[form].what in (What.BEGIN, What.ANEW):
                conversation.acknowledged = self._one_way.acknowledged_at(stream, order)
        else:
            reach, asked = http.reach.at(row), self._asked_for.asks[ask]
            conversation.take_from_client(http.forms[form], asked, order, arrival_ns, row, tell, reach)
            if not conversation.is_heard and conversation.waiting and conversation.waiting[-1].order == order:
                conversation.note_acknowledged(self._one_way.acknowledged_at(stream, order))
            is_request = http.forms[form].what in (What.WHOLE, What.CUT, What.PART)
            if is_request and conversation.has_early(http.forms[form], reach):
                early = conversation.early.first
                self._later.append((early.form, stream + 1, order, early.arrival_ns))
                conversation.answer_early(order, len(http) + len(self._later) - 1, tell)

    def _form(self, row: int, *, is_needed: bool) -> Form:
        """Return the form of a message, with its content where that says whether it answers what waits."""
        form = self._http.forms[int(self._http.form[row])]
        if not (form.is_late or (is_needed and form.what is What.WHOLE)):
            return form
        return replace(form, content=self._http.content(row), is_coded=True)

    def _early(self, conversation: Conversation, row: int, order: int) -> Early | None:
        """Return a response that is told when the request is whole that it answers, else None; no request waits.

        It answers the one that its client has begun, or one of which the server had more than was captured so far.
        """
        http = self._http
        form, reach = http.forms[int(http.form[row])], http.reach.at(row)
        is_lost = form.what is What.BROKEN and form.touched is Likeness.YES
        if not (is_lost or form.what in (What.WHOLE, What.CUT)) or form.answers_nobody:
            return None
        if form.head is not None and form.head.is_interim:
            return None
        has_begun = not conversation.early and conversation.is_spoken
        has_begun = has_begun and http.clients.has_begun(conversation.connection, order)
        if not has_begun and (is_lost or reach.acknowledged == UNKNOWN):
            return None
        if form.what is What.WHOLE:
            content = http.content(row)
            if content is not None and len(content) > _MOST_EARLY_BYTES:
                form, content = replace(form, begin=content[:LIST_BEGIN_BYTES]), None
            form = replace(form, content=content, is_coded=True)
        elif form.what is What.BROKEN:
            reach = NOWHERE if form.is_malformed or form.is_beyond else reach
            form = replace(form, what=What.CUT)
        return Early(form, int(http.arrival_ns[row]), reach, has_begun, self._is_reply(row), is_lost)

    def _miss(self, conversation: Conversation, before: int) -> None:
        """Tell that a reply was not captured, of a server of which nothing was, as far as that is known before."""
        if conversation.is_heard or not conversation.waiting:
            return
        first = conversation.waiting[0]
        if first.acknowledged == UNKNOWN:
            return
        order, size = self._one_way.more_than(first.acknowledged, 2 * conversation.connection, first.order)
        if order < before:
            conversation.miss_reply(order, size, self._happened.append)

    def _note_unasked(self, conversation: Conversation, row: int) -> None:
        """Tell that a request was not captured, of a client of which nothing was, where a page has its reply."""
        order = int(self._http.order[row])
        if not self._is_reply(row):
            return
        acknowledged = self._one_way.acknowledged_at(2 * conversation.connection + 1, order)
        size = more_bytes(acknowledged, conversation.acknowledged)
        if size:
            conversation.acknowledged = acknowledged
            conversation.miss_request(order, size, self._happened.append)

    def _is_reply(self, row: int) -> bool:
        """Tell whether a message is a reply of a page, whatever it answers."""
        form = self._http.forms[int(self._http.form[row])]
        if form.what is not What.WHOLE or form.head is None or form.head.status != OK or form.answers_nobody:
            return False
        return is_like_reply(self._http.content(row) or b"")

    def _is_to_unseen(self, conversation: Conversation, row: int) -> bool:
        if conversation.waits or not conversation.unseen.waits:
            return False
        return conversation.unseen.take(Answered(self._is_reply(row), self._http.reach.at(row).acknowledged))

    def _leave(self, conversation: Conversation, before: int) -> None:
        """Tell what a client that has closed its side does not wait for any more, as far as that is known before."""
        if conversation.closed is None or not (conversation.waiting and conversation.is_heard):
            return
        gone = self._going_on.since(conversation.connection, conversation.closed)
        if gone.order < before:
            if gone.over is not None:
                self.over[conversation.connection, gone.order] = gone.over
            lacks = self._missing.in_front_of(gone.order, conversation.connection, conversation.began)
            if not conversation.give_up(gone.order, self._happened.append, lacks):
                self.over.pop((conversation.connection, gone.order), None)

    def _said(self) -> Said:
        """Return what was found to have happened message by message."""
        number = self._asked_for.number
        table = [
            (
                int(one.kind), one.connection, one.order, one.message, number(one.asked), one.latency_ns,
                one.asked_frame, one.gap_bytes, one.opens,
            )
            for one in self._happened
        ]  # fmt: skip
        columns: Any = list(np.array(table, np.int64).reshape(-1, len(Said.__match_args__)).T)
        columns[-1] = columns[-1] > 0
        return Said(*columns)


def _may_go_at_once(conversation: Conversation) -> bool:
    """Tell whether a conversation is one of a page, heard in both directions, in which nothing is in doubt."""
    one = conversation
    if not (one.is_visu and one.is_heard and one.is_spoken and one.closed is None):
        return False
    return not (one.early or one.turns.is_unsure or one.unseen.waits)
