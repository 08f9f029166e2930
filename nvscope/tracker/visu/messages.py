"""What WebVisu pages and controllers say to each other, as columns, and which frames it was whole with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, U64, Bool
from dissectors.columns import Columns
from dissectors.headers import RST
from dissectors.transport import NO_SEGMENTS, SegmentBatch
from dissectors.webvisu import Request
from nvscope.engine.runs import runs_of
from nvscope.tracker.events import EventLog
from nvscope.tracker.visu.going_on import Over
from nvscope.tracker.visu.leaving import Leaving
from nvscope.tracker.visu.limits import Beyond
from nvscope.tracker.visu.names import ListFlaw, Naming

UNMEASURED_NS = int(np.iinfo(np.int64).min)
"""Stands for the latency of a reply that was captured, or by its time came, before its request was whole."""

_PORT = 4
"""The column of the server's port in ``VisuBatch.pairs``."""


class Kind(IntEnum):
    """What a message is, or what else happens to one.

    ``NAMES``: the reply to a request for a list of variables, or what there is of it. ``CUT``: a request or a reply of
    which bytes are missing, or that nobody reads. ``UNANSWERED``: the connection ended without a reply, or the client
    waits no more. ``GAP``: bytes of a client are missing of a connection with such requests; ``REPLY_GAP``: the same of
    a controller. ``OTHER``: a request of another
    protocol, or the begin of a connection over which another one is spoken. ``LEFT``: a request waits, and its client
    closes its side of the connection; ``UNCLEAR``: nobody knows what answers it, or what the reply to a part says of
    it. ``GIVEN_UP``: what is unanswered since the client waits no more; batches have that as ``UNANSWERED``, by its
    outcome. ``PART``: a request ends of which the client sent no more than a part; ``REFUSED``: the reply to such a
    one, of another status than 200. ``UNBOUNDED``: nobody knows where the message ends that comes with it: its
    Content-Length is not one number, or its chunks are none. ``OTHER_BYTES``: bytes of a client came again, and so many
    (``fields``) were others than those that came first; ``OTHER_REPLY_BYTES``: the same of a controller. ``HIDDEN``:
    bytes of a client are missing of a connection without such requests; batches have none (``HiddenBytes``). ``PAGE``:
    the reply to a request for a page that says how its texts are encoded.
    """

    READ = 0
    WRITE = 1
    REPLY = 2
    NAMES = 3
    CUT = 4
    UNANSWERED = 5
    GAP = 6
    OTHER = 7
    LEFT = 8
    UNCLEAR = 9
    GIVEN_UP = 10
    PART = 11
    REFUSED = 12
    UNBOUNDED = 13
    OTHER_BYTES = 14
    OTHER_REPLY_BYTES = 15
    HIDDEN = 16
    REPLY_GAP = 17
    PAGE = 18


class Outcome(IntEnum):
    """What a reply says. ``STATUS``: its HTTP status is another one than 200; ``NONE``: it is no reply.

    ``GIVEN_UP`` is of what is unanswered: the client ended the connection, or its side of it. ``UNREAD``: the reply is
    whole, but nobody knows what it says; in place of its content lies why, '' where it is too long. What is cut is
    ``UNREAD`` where nothing of it is missing: it is too long, or in a coding that nobody knows; ``MALFORMED`` where its
    chunks are none.
    """

    NONE = -1
    DONE = 0
    MISCOUNTED = 1
    AMBIGUOUS = 2
    REFUSED = 3
    STATUS = 4
    GIVEN_UP = 5
    UNREAD = 6
    MALFORMED = 7


class VisuMessages(Columns, Struct, frozen=True):
    """Messages in the order in which they were whole; columns of int64, shape (n,), but for ``opens``.

    ``row`` is that of the packet in its batch, ``pair`` the number of client, server and port. ``asked`` is the number
    of the request: that of a request itself, or that which a reply answers; -1 of what is neither. ``start`` and
    ``stop`` are where the content of its body lies. Of replies: HTTP ``status``, ``outcome``, how many values it has
    (``fields``), ``latency_ns``, and ``asked_frame``, that of the request; of what is no reply -1, 0 of times; of a
    latency that nobody knows ``UNMEASURED_NS``.
    ``spoken`` is a ``WebProtocol``, -1 of what is of WebVisu.
    ``asked_frame`` is also that of what is unanswered, or waits, ``latency_ns`` also how long the client waited that
    gave up, or leaves. Of other bytes that are told later, ``asked_frame`` is where they came first.
    ``gap_bytes`` are missing of the connection that were not told before; ``opens``: it is the first such request of
    its connection. ``polled_ns`` is how long it is since the pair read the same the last time, -1 of what is no such
    read. ``naming`` is which of ``VisuBatch.namings`` was known.
    """

    kind: I64
    row: I64
    pair: I64
    asked: I64
    start: I64
    stop: I64
    status: I64
    outcome: I64
    fields: I64
    latency_ns: I64
    asked_frame: I64
    gap_bytes: I64
    opens: Bool
    polled_ns: I64
    naming: I64
    spoken: I64


class VisuBatch(Struct, frozen=True, dict=True):
    """The frames of a packet batch with which messages were whole, rising; a part of what is told.

    The messages of frame ``i`` are ``count[i]``, from ``first[i]`` on; ``segments`` are those of the whole batch.
    ``data`` are the contents of bodies, ``requests`` what was asked for, by number; ``pairs`` are halves of the
    addresses of client and server, and its port, by number of the pair, five columns of uint64; ``namings`` are what
    variables were called, ``list_flaws`` what there is to say of lists, by message.
    ``left_out`` is how often there was no room for something up to here, and that was not told before. ``leaving`` is
    what waits behind the batch in connections whose clients have closed their side. ``over`` is what time alone told of
    unanswered messages before the segment came that they stand with. ``lacking`` returns whose clients may have written
    something behind all that has been read, whenever it is asked, by client, server and port. ``disorder`` are
    connections that have shown, up to whenever it is looked at, that they were captured in another order than that of
    the wire, be they of pages or not: by client, server and port, as in ``pairs``.
    """

    row: I64
    first: I64
    count: I64
    messages: VisuMessages
    segments: SegmentBatch
    data: bytes
    requests: Sequence[Request]
    pairs: Sequence[U64]
    namings: Sequence[Naming]
    list_flaws: Mapping[int, ListFlaw]
    left_out: Mapping[Beyond, int]
    leaving: Sequence[Leaving]
    over: Mapping[int, Over]
    lacking: Callable[[], Sequence[tuple[int, ...]]] = tuple
    disorder: EventLog | None = None

    def __len__(self) -> int:
        return len(self.row)

    @cached_property
    def segment(self) -> SegmentBatch:
        """What came with each frame; few are ever asked for."""
        return self.segments.take(np.searchsorted(self.segments.row, self.row))

    def is_reset_by_server(self, row: int, pair: int) -> bool:
        """Tell whether the server of a pair broke a connection off with the packet in a row."""
        place = int(np.searchsorted(self.row, row))
        if place == len(self.row) or self.row[place] != row:
            return False
        own = int(np.searchsorted(self.segments.row, row))
        is_reset = bool(self.segments.flags[own] & RST)
        return is_reset and bool(self.segments.source_port[own] == self.pairs[_PORT][pair])

    def known_ns(self, times_ns: I64) -> I64:
        """Return when each message was known; ``times_ns`` are those of the packets of the batch."""
        found: I64 = times_ns[self.messages.row]
        for place, over in self.over.items():
            found[place] = over.time_ns
        return found

    def take(self, rows: I64 | Bool) -> VisuBatch:
        """Return the frames at the given positions or where the mask is set."""
        return replace(self, row=self.row[rows], first=self.first[rows], count=self.count[rows])

    @staticmethod
    def of(
        messages: VisuMessages, segments: SegmentBatch, data: bytes, requests: Sequence[Request], pairs: Sequence[U64],
        namings: Sequence[Naming], list_flaws: Mapping[int, ListFlaw], left_out: Mapping[Beyond, int],
        leaving: Sequence[Leaving] = (), over: Mapping[int, Over] = MappingProxyType({}),
    ) -> VisuBatch:  # fmt: skip
        """Return the frames of some messages that stand in their order; ``segments`` are those of the batch."""
        start, stop = runs_of(messages.row)
        return VisuBatch(
            messages.row[start], start, stop - start, messages, segments, data, requests, pairs, namings, list_flaws,
            left_out, leaving, over,
        )  # fmt: skip


def messages_of(rows: Sequence[Sequence[int]]) -> VisuMessages:
    """Return the columns of rows that hold all of them in their order."""
    columns: Any = list(np.array(rows, np.int64).reshape(-1, len(VisuMessages.__match_args__)).T)
    place = VisuMessages.__match_args__.index("opens")
    columns[place] = columns[place] > 0
    return VisuMessages(*columns)


def no_messages() -> VisuBatch:
    """Return the frames of no messages."""
    return VisuBatch.of(messages_of(()), NO_SEGMENTS, b"", (), (), (), {}, {})
