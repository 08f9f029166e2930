"""Segments: those of TCP connections as a table by stream, and where each stream is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from dissectors.columns import Columns
from dissectors.headers import ACK, FIN, SYN
from nvscope.engine.keyed_columns import KeyedColumns

FAR = 1 << 30
"""What is farther from where a stream is does not belong to it: no window is wider (RFC 7323, section 2.3)."""

WRAP, HALF = 1 << 32, 1 << 31
"""How many sequence numbers there are, and half as many."""

_OWN_BYTES = 1 << 8
"""So much is a segment that has no data."""


class StreamColumns(KeyedColumns):
    """One row a stream: where it is.

    ``next`` is the sequence number of its next byte, ``first`` that of its first one, -1 before it has begun;
    ``acknowledged`` the highest one that the other end has acknowledged, -1 before it has. ``had`` is up to where the
    other end has it, as far as that is to be believed: a segment that is not where its stream is says nothing, and what
    one acknowledges that brings something new counts in place of all that was acknowledged before. It was sent later,
    unless something that brought nothing was as far as that before: ``ahead`` is where, -1 without such. ``told`` is
    what the last segment that brought something of it acknowledged, or -1. ``waits``: something is kept of it.
    ``disordered``: something came behind what acknowledges it (``nvscope.tracker.held_back``), in either direction.
    ``heard``: something of it was captured, in this connection or in one before between the same ends; where nothing
    was of the other direction, ``said`` is what the last one of its segments acknowledged that does, or -1.
    ``latest_ns`` is the time of what was captured last of it.
    """

    begun: Bool
    ended: Bool
    waits: Bool
    disordered: Bool
    heard: Bool
    next: I64
    first: I64
    acknowledged: I64
    had: I64
    ahead: I64
    told: I64
    said: I64
    latest_ns: I64
    COLUMNS: ClassVar = {
        **dict.fromkeys(("begun", "ended", "waits", "disordered", "heard"), (np.bool_(False), 1)),
        **dict.fromkeys(("first", "acknowledged", "had", "ahead", "told", "said"), (np.int64(-1), 1)),
        **dict.fromkeys(("next", "latest_ns"), (np.int64(0), 1)),
    }  # fmt: skip

    def reset(self) -> None:
        """Make all rows what they are at the start."""
        for name, (initial, _) in self.COLUMNS.items():
            getattr(self, name)[:] = initial


class Segments(Columns, Struct, frozen=True):
    """Segments by stream, those of one stream in the order of the capture; columns of int64, shape (n,).

    ``payload`` is an offset in the batch's buffer.
    """

    stream: I64
    sequence: I64
    acknowledgement: I64
    flags: I64
    payload: I64
    payload_bytes: I64
    captured_bytes: I64
    frame: I64
    time_ns: I64

    def tuples(self, start: int, stop: int) -> Iterator[tuple[int, ...]]:
        """Return the columns of some of them, one after the other."""
        columns = (getattr(self, name)[start:stop].tolist() for name in Segments.__match_args__)
        return zip(*columns, strict=True)


class Captured(NamedTuple):
    """A segment of a connection; ``source`` is where its data is in the batch's buffer, or the data itself."""

    side: int
    sequence: int
    acknowledgement: int
    flags: int
    source: int | bytes
    payload_bytes: int
    captured_bytes: int
    frame: int
    time_ns: int

    @property
    def told(self) -> int:
        """What it acknowledges, -1 where it says nothing."""
        return self.acknowledgement if self.flags & ACK and self.acknowledgement else -1

    @property
    def size(self) -> int:
        """How many sequence numbers it takes."""
        return self.payload_bytes + (self.flags & SYN) // SYN + (self.flags & FIN)

    @property
    def room_bytes(self) -> int:
        """How much it takes to hold it."""
        return _OWN_BYTES + self.captured_bytes

    def with_data(self, data: U8) -> Captured:
        """Return it with its data, which lies in ``data``."""
        if not isinstance(self.source, int):
            return self
        return self._replace(source=data[self.source : self.source + self.captured_bytes].tobytes())
