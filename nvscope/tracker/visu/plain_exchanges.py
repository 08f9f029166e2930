"""Plain exchanges: connections in which whole requests and whole replies take turns, paired all at once.

Most connections of most captures are such. What it is about all others is for ``Conversation`` to say, message by
message.
"""

from __future__ import annotations

from collections.abc import Sequence

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
from nvscope.tracker.visu.reach import UNKNOWN, Reach, are_had, distances


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
    lists = np.array([ask.is_list for ask in asks], np.bool_)
    plain: Bool = forms[http.form] & ~lists[asked]
    return plain


def _is_plain(form: Form) -> bool:
    if form.what is not What.WHOLE or form.is_coded or form.answers_nobody or form.is_late or form.head is None:
        return False
    return not form.head.is_interim and form.head.method != "HEAD"


def paired(
    http: HttpMessages, asked: I64, asked_for: AskedFor, conversation: Conversation, asks: I64, answers: I64
) -> Said | None:
    """Pair the requests of a connection with its replies, both rows of messages; None where these are not in turn.

    All of them are plain (``plain_rows``), and the connection is one of a WebVisu page.
    """
    waiting = conversation.waiting
    if conversation.beyond or any(
        one.asked.is_list or one.asked.is_part or one.is_head or one.is_behind for one in waiting
    ):
        return None
    order, arrival_ns, own = http.order[asks], http.arrival_ns[asks], asked[asks]
    if waiting:
        order = np.append([one.order for one in waiting], order)
        arrival_ns = np.append([one.arrival_ns for one in waiting], arrival_ns)
        own = np.append([asked_for.number(one.asked) for one in waiting], own)
    replies = len(answers)
    if replies > len(order) or (order[:replies] >= http.order[answers]).any():
        return None
    body_at, had = http.reach.body_at[asks], http.reach.acknowledged[asks]
    if waiting:
        body_at = np.append([one.reach.body_at for one in waiting], body_at)
        had = np.append([one.reach.acknowledged for one in waiting], had)
    behind = http.reach.behind[answers]
    acknowledges = _acknowledges(http.reach.acknowledged[answers], body_at[:replies], conversation.acknowledges)
    if acknowledges is None or are_had(behind, had[:replies]).any():
        return None
    if len(order) > MOST_WAITING:
        answered = np.searchsorted(http.order[answers], order)
        if (np.arange(1, len(order) + 1) - answered > MOST_WAITING).any():
            return None
    conversation.acknowledges = acknowledges
    conversation.turns.answer_all(had[:replies], behind, http.reach.acknowledged[asks])
    waiting.clear()
    left = (column[replies:].tolist() for column in (own, order, arrival_ns, body_at, had))
    for number, at, time_ns, body, acknowledged in zip(*left, strict=True):
        waiting.append(Waiting(asked_for.asks[number], at, time_ns, reach=Reach(body, UNKNOWN, acknowledged)))
    is_request = asked_for.are_requests()
    requests = asks[is_request[asked[asks]]]
    answered = np.flatnonzero(is_request[own[:replies]])
    count = len(requests) + len(answered)
    latency_ns, asked_frame = np.zeros(count, np.int64), np.zeros(count, np.int64)
    latency_ns[len(requests) :] = (http.arrival_ns[answers] - arrival_ns[:replies])[answered]
    asked_frame[len(requests) :] = order[:replies][answered] >> ORDER_BITS
    message = np.append(requests, answers[answered])
    kind = np.full(count, int(Kind.REPLY))
    kind[: len(requests)] = int(Kind.READ)
    return Said(
        kind, np.full(count, conversation.connection), http.order[message], message,
        np.append(asked[requests], own[:replies][answered]), latency_ns, asked_frame, np.zeros(count, np.int64),
        np.zeros(count, np.bool_),
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
