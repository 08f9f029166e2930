"""Connections: the pairs of ends between which TCP segments come, numbered, and which of each is the server."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, U64, Bool
from dissectors.headers import ACK, SYN
from dissectors.keys import KeyTable, first_rows_from
from dissectors.transport import SegmentBatch
from nvscope.engine.keyed_columns import KeyedColumns


class Ends(NamedTuple):
    """Client and server of connections: halves of addresses, and ports; columns of uint64."""

    client: tuple[U64, U64]
    client_port: U64
    server: tuple[U64, U64]
    server_port: U64


class _Servers(KeyedColumns):
    """One row a pair of ends: whether the lower one of them is the server."""

    low_serves: Bool
    COLUMNS: ClassVar = {"low_serves": (np.bool_(False), 1)}


class Connections:
    """The pairs of ends over some ports, numbered in the order in which they appear, until some are forgotten.

    A key is the halves of the lower address, of the higher one, and both ports.
    """

    def __init__(self, ports: Sequence[int]) -> None:
        self._ports = tuple(ports)
        self._keys = KeyTable(5)
        self._servers = _Servers()
        self._renewals = 0

    @property
    def version(self) -> tuple[int, int]:
        """What tells whether other connections are known than before, or by other numbers."""
        return self._renewals, len(self)

    def __len__(self) -> int:
        return len(self._keys)

    def be_as(self, others: Connections) -> None:
        """Take over the connections that others know, numbered as there."""
        self._keys, self._servers = others._keys, others._servers

    def streams_of(self, segments: SegmentBatch, carrying: Bool) -> I64:
        """Return of segments in which stream each is, -1 of those of connections that nobody knows.

        A stream is twice the number of the connection, plus 1 for what the server sends. Segments that are
        ``carrying`` something make connections known.
        """
        start, length = _runs_of(segments)
        if not len(start):
            return np.empty(0, np.int64)
        words, is_low = _keys_of(segments, start)
        carries = np.logical_or.reduceat(carrying, start)
        known = len(self._keys)
        number = np.empty(len(start), np.int64)
        number[carries] = _by_runs(self._keys.numbers, [word[carries] for word in words])
        rest = np.flatnonzero(~carries)
        if len(rest):
            number[rest] = _by_runs(self._keys.find, [word[rest] for word in words])
        self._servers.resize(len(self._keys))
        if len(self._keys) > known:
            self._name_servers(segments, np.repeat(is_low, length), carrying, np.repeat(number, length), known)
        stream = np.full(len(start), -1)
        own = np.flatnonzero(number >= 0)
        stream[own] = 2 * number[own] + (is_low[own] == self._servers.low_serves[number[own]])
        return np.repeat(stream, length)

    def _name_servers(self, segments: SegmentBatch, is_low: Bool, carrying: Bool, number: I64, known: int) -> None:
        """Find out who is the server of new connections: who has a claimed port, or else who is spoken to first."""
        # What carries nothing makes no connection known, and does not say who its server is.
        first = first_rows_from(np.where(carrying, number, -1), known, len(self._keys))
        from_claimed = np.isin(segments.source_port[first], self._ports)
        to_claimed = np.isin(segments.destination_port[first], self._ports)
        answers = (segments.flags[first] & (SYN | ACK)) == SYN | ACK
        to_server = to_claimed & ~(from_claimed & answers)
        self._servers.low_serves[number[first]] = is_low[first] != to_server

    def ends_of(self, connection: I64) -> Ends:
        """Return who speaks to whom in connections."""
        low_hi, low_lo, high_hi, high_lo, ports = (word[connection] for word in self._keys.words)
        serves = self._servers.low_serves[connection]
        low_port, high_port = ports >> np.uint64(16), ports & np.uint64(0xFFFF)

        def one(low: U64, high: U64, is_low: Bool) -> U64:
            chosen: U64 = np.where(is_low, low, high)
            return chosen

        return Ends(
            (one(low_hi, high_hi, ~serves), one(low_lo, high_lo, ~serves)), one(low_port, high_port, ~serves),
            (one(low_hi, high_hi, serves), one(low_lo, high_lo, serves)), one(low_port, high_port, serves),
        )  # fmt: skip

    def keep(self, kept: I64) -> None:
        """Forget all connections but some, which are numbered anew in their order."""
        keys = KeyTable(5)
        keys.numbers(*(word[kept] for word in self._keys.words))
        self._keys, self._servers = keys, self._servers.rows(kept)
        self._renewals += 1


def _runs_of(segments: SegmentBatch) -> tuple[I64, I64]:
    """Return where segments begin that follow each other between the same ends, the same way, and how many there are.

    So do most: what they are is found out once for all of them.
    """
    first = np.ones(len(segments), np.bool_)
    ends = (
        segments.source_lo, segments.destination_lo, segments.source_port, segments.destination_port,
        segments.source_hi, segments.destination_hi,
    )  # fmt: skip
    first[1:] = np.logical_or.reduce([column[1:] != column[:-1] for column in ends])
    start = first.nonzero()[0]
    return start, np.diff(start, append=len(segments))


def _keys_of(segments: SegmentBatch, rows: I64) -> tuple[tuple[U64, ...], Bool]:
    """Return the keys of the connections of some segments, and which of these are sent by the lower end."""
    source_hi, source_lo = segments.source_hi[rows], segments.source_lo[rows]
    to_hi, to_lo = segments.destination_hi[rows], segments.destination_lo[rows]
    port = segments.source_port[rows].astype(np.uint64)
    to_port = segments.destination_port[rows].astype(np.uint64)
    by_low = (source_lo < to_lo) | ((source_lo == to_lo) & (port <= to_port))
    is_low: Bool = (source_hi < to_hi) | ((source_hi == to_hi) & by_low)
    sixteen = np.uint64(16)
    words = (
        np.where(is_low, source_hi, to_hi), np.where(is_low, source_lo, to_lo),
        np.where(is_low, to_hi, source_hi), np.where(is_low, to_lo, source_lo),
        np.where(is_low, port << sixteen | to_port, to_port << sixteen | port),
    )  # fmt: skip
    return words, is_low


def _by_runs(look_up: Callable[..., I64], words: Sequence[U64]) -> I64:
    """Look up keys; those that follow each other often are the same, and looked up once."""
    first = np.ones(len(words[0]), np.bool_)
    first[1:] = np.logical_or.reduce([word[1:] != word[:-1] for word in words])
    start = np.flatnonzero(first)
    number: I64 = np.repeat(look_up(*(word[start] for word in words)), np.diff(start, append=len(first)))
    return number
