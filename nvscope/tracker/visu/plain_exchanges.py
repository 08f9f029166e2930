"""Plain exchanges: connections in which whole requests and whole replies take turns, paired all at once.

Most connections of most captures are such. What it is about all others is for ``Conversation`` to say, message by
message.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from dissectors.columns import Columns
from nvscope.engine.runs import distinct
from nvscope.tracker.pieces import ORDER_BITS
from nvscope.tracker.segments import HALF
from nvscope.tracker.visu.asking import Ask
from nvscope.tracker.visu.awaited import Waiting
from nvscope.tracker.visu.conversation import Conversation
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.http_messages import HttpMessages
from nvscope.tracker.visu.limits import MOST_WAITING
from nvscope.tracker.visu.messages import Kind
from nvscope.tracker.visu.reach import UNKNOWN, Reach, are_had, are_in_step, distances


class Said(Columns, Struct, frozen=True):
    """What is to be told, each of a message; columns of shape (n,), int64 but for ``opens``.

    ``kind`` is a ``Kind``, ``message`` a row of ``HttpMessages`` or -1, ``asked`` a place in what is asked for in the
    batch, 0 for nothing. The others are as in ``Happened``.
    """

    kind: I64
    connection: I64
    order: I64
    message: I64
    asked: I64
    latency_ns: I64
    asked_frame: I64
    gap_bytes: I64
    opens: Bool


class Exchanged(NamedTuple):
    """Requests and replies of a connection that were paired; columns of int64.

    Of each request: its message, what is ``asked`` and its ``order``; of each reply: its message, what the request that
    it answers asked for, with which order and when that was whole, and its own order and time.
    """

    connection: int
    asks: I64
    answers: I64
    asked: I64
    order: I64
    own: I64
    own_order: I64
    own_ns: I64
    answer_order: I64
    answered_ns: I64


class AskedFor:
    """What is asked for in a batch, by number; nothing is 0."""

    def __init__(self, nothing: Ask) -> None:
        self.asks = [nothing]
        self._numbers: dict[Ask, int] = {nothing: 0}
        self._are_requests = np.zeros(1, np.bool_)

    def are_requests(self) -> Bool:
        """Tell by number which ask for variables."""
        known = len(self._are_requests)
        if known < len(self.asks):
            new = [ask.request is not None for ask in self.asks[known:]]
            self._are_requests = np.append(self._are_requests, new)
        return self._are_requests

    def number(self, ask: Ask) -> int:
        """Return the number of what is asked for."""
        number = self._numbers.get(ask)
        if number is None:
            number = self._numbers[ask] = len(self.asks)
            self.asks.append(ask)
        return number


def plain_rows(http: HttpMessages, asked: I64, asks: Sequence[Ask]) -> Bool:
    """Tell which messages are whole, as they came, and no more than request or reply."""
    forms = np.zeros(len(http.forms), np.bool_)
    used = distinct(http.form)
    forms[used] = [_is_plain(http.forms[form]) for form in used.tolist()]
    files = np.array([ask.is_file for ask in asks], np.bool_)
    plain: Bool = forms[http.form] & ~files[asked]
    return plain


def _is_plain(form: Form) -> bool:
    if form.what is not What.WHOLE or form.is_coded or form.answers_nobody or form.is_late or form.head is None:
        return False
    return not form.head.is_interim and form.head.method != "HEAD"


def columns_of(http: HttpMessages, asked: I64) -> I64:
    """Return what messages are paired by, as rows of one array, so that one call takes that of some of them.

    These are order, time, what is asked, where the body begins, what its sender had, and where the message ends.
    """
    reach = http.reach
    return np.stack([http.order, http.arrival_ns, asked, reach.body_at, reach.acknowledged, reach.behind])


def paired(columns: I64, asked_for: AskedFor, conversation: Conversation, asks: I64, answers: I64) -> Exchanged | None:
    """Pair the requests of a connection with its replies, both columns of messages; None where these are not in turn.

    All of them are plain (``plain_rows``), and the connection is one of a WebVisu page.
    """
    waiting = conversation.waiting
    if conversation.beyond or any(
        one.asked.is_file or one.asked.is_part or one.is_head or one.is_behind for one in waiting
    ):
        return None
    asking = columns.take(asks, axis=1)
    asked, first = asking[2], len(waiting)
    if first:
        earlier = [
            (one.order, one.arrival_ns, asked_for.number(one.asked), one.reach.body_at, one.reach.acknowledged, UNKNOWN)
            for one in waiting
        ]  # fmt: skip
        asking = np.concatenate([np.array(earlier, np.int64).T, asking], axis=1)
    order, arrival_ns, own, body_at, had, _ = asking
    answer_order, answered_ns, _, _, told, behind = columns.take(answers, axis=1)
    replies = len(answers)
    if replies > len(order) or (order[:replies] >= answer_order).any():
        return None
    acknowledges = _acknowledges(told, body_at[:replies], conversation.turns.acknowledges)
    in_step = are_in_step(had, behind)
    if acknowledges is None or (not in_step and are_had(behind, had[:replies]).any()):
        return None
    if len(order) > MOST_WAITING:
        answered = np.searchsorted(answer_order, order)
        if (np.arange(1, len(order) + 1) - answered > MOST_WAITING).any():
            return None
    conversation.turns.acknowledges = acknowledges
    conversation.turns.answer_all(had, behind, first, in_step=in_step)
    waiting.clear()
    left = (column[replies:].tolist() for column in (own, order, arrival_ns, body_at, had))
    for number, at, time_ns, body, acknowledged in zip(*left, strict=True):
        waiting.append(Waiting(asked_for.asks[number], at, time_ns, reach=Reach(body, UNKNOWN, acknowledged)))
    return Exchanged(
        conversation.connection, asks, answers, asked, asking[0, first:], own[:replies], order[:replies],
        arrival_ns[:replies], answer_order, answered_ns,
    )  # fmt: skip


def told_of(exchanged: Sequence[Exchanged], asked_for: AskedFor) -> Said:
    """Return what is to be told of exchanges that were paired: the requests, then the replies."""
    if not exchanged:
        none: I64 = np.empty(0, np.int64)
        return Said(none, none, none, none, none, none, none, none, np.empty(0, np.bool_))
    connection = np.array([one.connection for one in exchanged])
    columns = zip(*(one[1:] for one in exchanged), strict=True)
    asks, answers, asked, order, own, own_order, own_ns, answer_order, answered_ns = map(np.concatenate, columns)
    is_request = asked_for.are_requests()
    read, answered = is_request[asked].nonzero()[0], is_request[own].nonzero()[0]
    begin, count = len(read), len(read) + len(answered)
    of_asks = np.repeat(connection, [len(one.asks) for one in exchanged])
    of_answers = np.repeat(connection, [len(one.answers) for one in exchanged])
    nothing = np.zeros(count, np.int64)
    latency_ns, asked_frame = nothing.copy(), nothing.copy()
    latency_ns[begin:] = (answered_ns - own_ns)[answered]
    asked_frame[begin:] = own_order[answered] >> ORDER_BITS
    kind = np.full(count, int(Kind.REPLY))
    kind[:begin] = int(Kind.READ)
    return Said(
        kind, np.append(of_asks[read], of_answers[answered]), np.append(order[read], answer_order[answered]),
        np.append(asks[read], answers[answered]), np.append(asked[read], own[answered]), latency_ns, asked_frame,
        nothing, np.zeros(count, np.bool_),
    )  # fmt: skip


def _acknowledges(told: I64, body_at: I64, did: bool) -> bool | None:
    """Tell whether a server that ``did`` so or not has acknowledged what it answers, None where it lacks some of it.

    ``told`` is what it acknowledges with responses, ``body_at`` where the heads of the requests end in front of them.
    """
    ahead = told - body_at
    if len(told) and int(ahead.min()) >= 0 and int(body_at.min()) >= 0 and int(ahead.max()) < HALF:
        return True
    is_known = (told != UNKNOWN) & (body_at != UNKNOWN)
    lacks = distances(told, body_at) < 0
    has = did or bool((is_known & ~lacks).any())
    return None if has and lacks.any() else has
