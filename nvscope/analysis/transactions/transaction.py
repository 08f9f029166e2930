"""Transaction: one request and what became of it, by the Parameter Manager or a web visualization page alike."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum, StrEnum
from typing import Any, NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool


class Protocol(StrEnum):
    """Which protocol it is, by its name in documents and topics."""

    SDO = "sdo"
    VISU = "visu"


class Pair(NamedTuple):
    """Who asks whom, by the texts of their addresses, and on which port of the server."""

    protocol: Protocol
    client: str
    server: str
    port: int


class Outcome(StrEnum):
    """What is known of a request with a frame.

    ``OPEN``: a write was asked for, and nobody has seen yet what came of it; of reads, nothing is told then. ``CUT``:
    the reply is not whole. ``UNEXPECTED``: a reply to nothing.
    """

    OPEN = "open"
    ANSWERED = "answered"
    CONFIRMED = "confirmed"
    REFUSED = "refused"
    BUSY = "busy"
    MISCOUNTED = "miscounted"
    AMBIGUOUS = "ambiguous"
    STATUS = "status"
    CUT = "cut"
    UNANSWERED = "unanswered"
    UNEXPECTED = "unexpected"


class Operation(StrEnum):
    """What a request asks for; ``UNKNOWN`` where it was never sent whole, and does not say that it writes."""

    READ = "read"
    WRITE = "write"
    UNKNOWN = "unknown"


class Group(IntEnum):
    """What of a pair is kept apart: pages read so often that nothing else would be left."""

    READ = 0
    WRONG = 1
    WRITE = 2


class Said(NamedTuple):
    """A variable or a parameter, and its value: as JSON has it, and as a person reads it; None where none was said.

    Of a write, the value is the one that is written; ``old`` is the one that was known before, None without any.
    """

    name: str
    value: Any = None
    text: str | None = None
    old: Any = None
    old_text: str | None = None


class Room(NamedTuple):
    """How much is kept of one transaction: so many of what was said, texts of so many characters."""

    said: int
    characters: int

    def cut(self, text: str) -> str:
        """Return a text, or its beginning where it is longer."""
        return text if len(text) <= self.characters else f"{text[: self.characters - 1]}…"


class Transaction(Struct, frozen=True):
    """What is known of a request with one frame.

    ``frame`` is that of the reply, or of a write that was asked for, ``time_ns`` its time; of what nobody answered, the
    frame of the request and the time at which that was certain. ``known_frame`` is the frame that showed it, which may
    be yet to come where time has passed without one. ``asked_frame`` is that of the request, None of a reply to
    nothing. ``said`` are the first of the variables that it is about, ``left_out`` how many more there are.
    ``latency_ns`` is None without a reply. ``detail`` is what a refusal says. ``is_part``: the request was never sent
    whole, and nobody knows for which variables.
    """

    pair: Pair
    time_ns: int
    frame: int
    known_frame: int
    asked_frame: int | None
    writes: bool
    outcome: Outcome
    said: Sequence[Said]
    left_out: int = 0
    latency_ns: int | None = None
    detail: str = ""
    is_part: bool = False

    @property
    def operation(self) -> Operation:
        if self.writes:
            return Operation.WRITE
        return Operation.UNKNOWN if self.is_part else Operation.READ

    @property
    def group(self) -> Group:
        if self.writes:
            return Group.WRITE
        return Group.READ if self.outcome is Outcome.ANSWERED else Group.WRONG


class Brought(NamedTuple):
    """What a batch brings of one protocol: transactions, in the order in which they are known.

    ``pairs`` are all so far. ``pair`` and ``row`` are those of each request that is no repetition, and ``writes`` tells
    which of these write, of shape (n,).
    """

    pairs: Sequence[Pair] = ()
    pair: I64 = np.empty(0, np.int64)
    row: I64 = np.empty(0, np.int64)
    writes: Bool = np.empty(0, np.bool_)
    transactions: Sequence[Transaction] = ()


NOTHING = Brought()


def last_of_each(pair: I64, group: I64, last: int | None) -> I64:
    """Return where the last so many of each pair and group stand, rising; all of them where ``last`` is None."""
    if last is None or len(pair) <= last:
        return np.arange(len(pair))
    key = pair * len(Group) + group
    order = np.argsort(key, kind="stable")
    stop = np.searchsorted(key[order], key[order], "right")
    return np.sort(order[stop - np.arange(len(pair)) <= last])
