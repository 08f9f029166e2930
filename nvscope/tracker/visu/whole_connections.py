"""Whole connections: those that begin in a batch and in which each request is answered in it, paired all at once.

Many pages open a connection for each request: then there are as many connections as requests, and most are such.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.runs import runs_of
from nvscope.tracker.pieces import ORDER_BITS
from nvscope.tracker.visu.conversation import Conversation
from nvscope.tracker.visu.http_forms import What
from nvscope.tracker.visu.http_messages import HttpMessages
from nvscope.tracker.visu.limits import MOST_WAITING
from nvscope.tracker.visu.messages import Kind
from nvscope.tracker.visu.plain_exchanges import AskedFor, Said
from nvscope.tracker.visu.reach import UNKNOWN, are_had, distances


def take_whole(
    http: HttpMessages,
    is_plain: Bool,
    asked: I64,
    asked_for: AskedFor,
    conversations: dict[int, Conversation],
    closed: Collection[int] = (),
) -> tuple[Bool, Said]:
    """Pair the messages of connections that begin and are answered; return which ones these are, and what they say.

    Messages are by stream, and in each in its order; ``is_plain`` is as in ``plain_rows``. In connections that are
    ``closed`` on one side, or seen from one alone, something waits.
    """
    what = np.array([form.what for form in http.forms], np.int64)[http.form]
    begins = (what == What.BEGIN) | (what == What.ANEW)
    start, stop = runs_of(http.stream >> 1)
    first = np.empty(len(http), np.bool_)
    first[:1], first[1:] = True, np.diff(http.stream) != 0
    last = np.append(first[1:], True)
    of_server = (http.stream & 1) == 1
    good = is_plain | (begins & first) | ((what == What.END) & last)

    def all_of(rows: Bool) -> Bool:
        return np.logical_and.reduceat(rows, start)

    def count(rows: Bool) -> I64:
        return np.add.reduceat(rows, start, dtype=np.int64)

    requests, replies = count(is_plain & ~of_server), count(is_plain & of_server)
    whole = all_of(good) & (count(begins) == 2) & (count(what == What.ANEW) == 1)
    whole &= (requests == replies) & (requests > 0) & (requests <= MOST_WAITING)
    if closed:
        whole &= ~np.isin(http.stream[start] >> 1, np.array(sorted(closed)))
    group = np.repeat(np.arange(len(start)), stop - start)
    # Where the server was heard behind the first request, or had less than is there of the client, it may lack some.
    client, server = np.flatnonzero(begins & whole[group]).reshape(-1, 2).T
    late = http.order[server] > http.order[client + 1]
    late |= distances(http.reach.behind[client], http.reach.acknowledged[server]) > 0
    whole[group[client[late]]] = False
    ask, answer = (np.flatnonzero(is_plain & whole[group] & (of_server == side)) for side in (False, True))
    # Where the client closed its side before the last reply, it matters how long it waited.
    closes = np.zeros(len(start), np.bool_)
    ends = np.flatnonzero((what == What.END) & ~of_server)
    closes[group[ends]] = http.order[ends] < _last_order(http, group, answer, len(start))[group[ends]]
    if (closes & whole).any():
        whole &= ~closes
        ask, answer = ask[whole[group[ask]]], answer[whole[group[answer]]]
    reach = http.reach
    early = http.order[answer] <= http.order[ask]
    early |= distances(reach.acknowledged[answer], reach.body_at[ask]) < 0
    early |= are_had(reach.behind[answer], reach.acknowledged[ask])
    if early.any():
        whole[group[ask[early]]] = False
        ask, answer = ask[whole[group[ask]]], answer[whole[group[answer]]]
    pairs = np.stack([group[ask], ask, answer])
    own = asked_for.are_requests()[asked[ask]]
    ask, answer = ask[own], answer[own]
    opens = np.ones(len(ask), np.bool_)
    opens[1:] = np.diff(group[ask]) != 0
    _note(http, start, whole, count(what == What.END) == 2, group[ask[opens]], conversations, pairs)
    nothing, count_of = np.zeros(len(ask), np.int64), len(ask)
    said = Said(
        np.repeat([int(Kind.READ), int(Kind.REPLY)], count_of), np.tile(http.stream[ask] >> 1, 2),
        http.order[np.append(ask, answer)], np.append(ask, answer), np.tile(asked[ask], 2),
        np.append(nothing, http.arrival_ns[answer] - http.arrival_ns[ask]),
        np.append(nothing, http.order[ask] >> ORDER_BITS), np.tile(nothing, 2),
        np.append(opens, np.zeros(count_of, np.bool_)),
    )  # fmt: skip
    return whole[group], said


def _last_order(http: HttpMessages, group: I64, answer: I64, groups: int) -> I64:
    """Return the order of the last answer of each group, -1 of those without."""
    last = np.full(groups, -1)
    last[group[answer]] = http.order[answer]  # of one group, the last one stays
    return last


def _note(
    http: HttpMessages, start: I64, whole: Bool, ended: Bool, visu: I64, conversations: dict[int, Conversation],
    pairs: I64,
) -> None:  # fmt: skip
    """Note where whole connections are: nothing more is to be said of those that have ended.

    ``pairs`` are rows of connections, requests and replies, by the first.
    """
    connection = http.stream[start] >> 1
    if conversations:
        for number in connection[whole].tolist():
            conversations.pop(number, None)
    spoke = np.zeros(len(start), np.bool_)
    spoke[visu] = True
    stays = whole & ~ended
    if not stays.any():
        return
    group, ask, answer = pairs
    reach, places = http.reach, np.flatnonzero(stays)
    had, told, behind = reach.acknowledged[ask], reach.acknowledged[answer], reach.behind[answer]
    acknowledges = (told != UNKNOWN) & (reach.body_at[ask] != UNKNOWN)
    bounds = np.searchsorted(group, places), np.searchsorted(group, places, side="right")
    for place, *bound in zip(places.tolist(), *(bound.tolist() for bound in bounds), strict=True):
        number, own = int(connection[place]), slice(*bound)
        conversations[number] = one = Conversation(number, is_visu=bool(spoke[place]), is_heard=True, is_spoken=True)
        one.turns.acknowledges = bool(acknowledges[own].any())
        one.turns.answer_all(had[own], behind[own], 0)
