"""Requests and replies of the Parameter Manager, brought together.

A transaction is one requester's request to one partner, on one port, for one Index and SubIndex, with one Counter; a
read and a write are two, and so are writes of two values (``nvscope.tracker.parameter.several_values``). It is over
with the partner's reply or with its deadline, whichever comes first. What became
of a telegram depends on the one before it in its transaction alone: whether that was a request whose deadline had not
passed. So all telegrams of a batch are looked at at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from dissectors.columns import Columns
from dissectors.netvar import PARAMETER_REQUESTS, Service
from nvscope.engine.clock import Clock
from nvscope.tracker.parameter.several_values import several_values, told_apart

WRITE_SERVICES = (Service.ODWriteRequest, Service.ODWriteRequestReply)
_OF_READS = (Service.ODReadRequest, Service.ODReadRequestReply)
_READ, _WRITE, _EITHER = 0, 1, 2


class Messages(Columns, Struct, frozen=True):
    """Well-formed requests and replies, in the order of the capture; int64, of shape (n,).

    ``pair`` tells requester, partner and port by number, ``word`` Index, SubIndex and Counter (``word_of``). ``packet``
    is the row in the batch; ``node`` is who asks and ``peer`` who is asked, -1 for everybody. ``value`` is a number of
    what a write request says, as good as certain to be another one for another value; 0 of others.
    """

    packet: I64
    time_ns: I64
    pair: I64
    word: I64
    service: I64
    node: I64
    peer: I64
    value: I64

    @property
    def is_request(self) -> Bool:
        """Tell which of them ask."""
        return np.isin(self.service, PARAMETER_REQUESTS)


class Open(Columns, Struct, frozen=True):
    """Requests that wait for their replies; int64, of shape (n,).

    ``since_ns`` and ``frame`` are those of the first one, ``last_ns`` is when it was last repeated. ``service`` is that
    of the request, ``latest`` that of the last request with the same pair and word: that is what an error reply is to.
    ``node``, ``peer`` and ``value`` are as of messages. ``unsure`` is 1 of a write that was open at the same time as
    one of another value when a reply came: nobody knows which of them that is about.
    """

    pair: I64
    word: I64
    service: I64
    since_ns: I64
    frame: I64
    last_ns: I64
    latest: I64
    node: I64
    peer: I64
    value: I64
    unsure: I64


NO_MESSAGES = Messages(*(np.empty(0, np.int64) for _ in Messages.__struct_fields__))
NOTHING_OPEN = Open(*(np.empty(0, np.int64) for _ in Open.__struct_fields__))


class Matched(NamedTuple):
    """What became of requests and replies.

    ``opened``, ``repeated``, ``unexpected`` and ``closing`` are positions among the messages, rising; ``closed`` are
    the requests that the closing ones end, in the same order. ``expired`` are those that nobody answered, in the order
    in which packets showed it, and ``shown`` the rows of these packets; ``open`` those that still wait.
    """

    opened: I64
    repeated: I64
    unexpected: I64
    closing: I64
    closed: Open
    expired: Open
    shown: I64
    open: Open


def word_of(index: I64, subindex: I64, counter: I64) -> I64:
    """Return Index, SubIndex and Counter as one word."""
    return index << 32 | subindex << 16 | counter


def parameter_of(word: I64) -> I64:
    """Return Index and SubIndex of words, as one."""
    return word >> 16


def matched(before: Open, new: Messages, clock: Clock, first_frame: int, timeout_ns: int) -> Matched:
    """Bring together what was open and the messages of a batch, whose packets have the times of ``clock``.

    There is at least one of them.
    """
    old, count = len(before), len(before) + len(new)
    is_request = np.concatenate([np.ones(old, np.bool_), new.is_request])
    service = np.concatenate([before.service, new.service])
    pair, word = np.concatenate([before.pair, new.pair]), np.concatenate([before.word, new.word])
    packet = np.concatenate([np.full(old, -1), new.packet])
    time_ns = np.concatenate([before.last_ns, new.time_ns])
    node, peer = np.concatenate([before.node, new.node]), np.concatenate([before.peer, new.peer])
    value = np.concatenate([before.value, new.value])
    unsure = np.concatenate([before.unsure, np.zeros(len(new), np.int64)])
    kind, latest = _kinds(pair, word, service, is_request, before)

    order = np.lexsort((np.arange(count), kind, word, pair))
    begins = _begins(pair[order], word[order], kind[order])
    odd = several_values(np.cumsum(begins) - 1, (is_request & (kind == _WRITE))[order], value[order])
    if len(odd):
        place = order[odd]
        late = clock.first_behind(time_ns[place] + timeout_ns, packet[place])
        age = np.where(place < old, _at(before.frame, np.minimum(place, max(old - 1, 0))), first_frame + count + place)
        group = (np.cumsum(begins) - 1)[odd]
        stream = np.zeros(count, np.int64)
        stream[place], unsure[place] = told_apart(
            group, age, is_request[place], value[place], packet[place], late, unsure[place]
        )  # fmt: skip
        order = np.lexsort((np.arange(count), stream, kind, word, pair))
        begins = _begins(pair[order], word[order], kind[order], stream[order])
    asks, at = is_request[order], packet[order]
    expires = clock.first_behind(time_ns[order] + timeout_ns, at)
    expires[~asks] = -1
    waits = np.zeros(count, np.bool_)
    waits[1:] = ~begins[1:] & (expires[:-1] > at[1:])
    opens = asks & ~waits
    head = order[np.maximum.accumulate(np.where(opens, np.arange(count), 0))]
    goes_on = np.append(waits[1:], False)
    ends = np.flatnonzero(asks & ~goes_on)
    over = expires[ends] < len(clock)

    def requests(at: I64) -> Open:
        first, last = head[at], order[at]
        is_old = first < old
        own = np.minimum(first, max(old - 1, 0))
        fresh = np.maximum(first - old, 0)
        since_ns = np.where(is_old, _at(before.since_ns, own), _at(new.time_ns, fresh))
        frame = np.where(is_old, _at(before.frame, own), _at(new.packet, fresh) + first_frame)
        return Open(
            pair[last], word[last], service[first], since_ns, frame, time_ns[last], latest[last], node[first],
            peer[first], value[first], unsure[first],
        )  # fmt: skip

    expired = ends[over]
    expired = expired[np.lexsort((at[expired], time_ns[order[expired]], expires[expired]))]
    by_packet = np.argsort(order[~asks & waits])
    closing = np.flatnonzero(~asks & waits)[by_packet]
    own = order >= old
    return Matched(
        np.sort(order[opens & own]) - old, np.sort(order[asks & waits & own]) - old,
        np.sort(order[~asks & ~waits]) - old, order[closing] - old, requests(closing), requests(expired),
        expires[expired], requests(ends[~over]),
    )  # fmt: skip


def _begins(*columns: I64) -> Bool:
    """Tell which rows differ from the one above in any column; the first one does."""
    begins = np.zeros(len(columns[0]), np.bool_)
    begins[:1] = True
    for column in columns:
        begins[1:] |= column[1:] != column[:-1]
    return begins


def _at(column: I64, row: I64) -> I64:
    """Return some rows of a column, of one without any, zeros."""
    return column[row] if len(column) else np.zeros(len(row), np.int64)


def _kinds(pair: I64, word: I64, service: I64, is_request: Bool, before: Open) -> tuple[I64, I64]:
    """Return whether messages are of reads or of writes; and the last request of each one's pair and word at the end.

    An error reply does not say what it is to: it is to what was asked for last.
    """
    kind = np.where(np.isin(service, _OF_READS), _READ, np.where(np.isin(service, WRITE_SERVICES), _WRITE, _EITHER))
    count = len(pair)
    order = np.lexsort((np.arange(count), word, pair))
    begins = _begins(pair[order], word[order])
    place = np.arange(count)
    asked = service.copy()
    asked[: len(before)] = before.latest
    last = np.maximum.accumulate(np.where(is_request[order] | begins, place, 0))
    of_last = asked[order][last]
    found = np.empty(count, np.int64)
    found[order] = np.where(of_last == Service.ODWriteRequest, _WRITE, _READ)
    # At the ends of groups stands what was asked for last in them.
    stop, group = np.flatnonzero(np.append(begins[1:], True)), np.cumsum(begins) - 1
    latest = np.empty(count, np.int64)
    latest[order] = of_last[stop][group]
    return np.where(kind == _EITHER, found, kind), latest
