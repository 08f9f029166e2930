"""Waits: who waits for an answer since when, how waits end, and the messages that can end them, as columns."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from dissectors.columns import Columns
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.tracker.errors import ErrorEvents

NEVER = np.iinfo(np.int64).min
NOBODY_YET = -1


class WaitColumns(KeyedColumns):
    """One row a stream: its open wait, if any, and when it last wanted an acknowledgement (``NEVER``: not yet).

    ``peer`` is the node to which the waiting telegram was sent, -1 for all.
    """

    open: Bool
    since_ns: I64
    frame: I64
    peer: I64
    wanted_ns: I64
    COLUMNS: ClassVar = {
        "open": (np.False_, 1),
        "since_ns": (np.int64(0), 1),
        "frame": (np.int64(0), 1),
        "peer": (np.int64(-1), 1),
        "wanted_ns": (np.int64(NEVER), 1),
    }


class PlaceColumns(KeyedColumns):
    """One row a place: who sent its last data telegram (or ``NOBODY_YET``), and when one wanted an answer."""

    sender: I64
    wanted_ns: I64
    COLUMNS: ClassVar = {"sender": (np.int64(NOBODY_YET), 1), "wanted_ns": (np.int64(NEVER), 1)}


class Messages(Struct, frozen=True):
    """Well-formed telegrams of one service, as captured. Shapes (n,).

    ``destination`` is -1 for broadcasts, ``target`` the stream of the place that the destination sends, -1 for none.
    """

    packet: I64
    time_ns: I64
    list: I64
    place: I64
    source: I64
    destination: I64
    target: I64
    flags: U8

    def __len__(self) -> int:
        return len(self.packet)


class BootUpWaits(Columns, Struct, frozen=True):
    """Boot-up requests that nobody has answered yet: by when, in which frame, for what, and who asked. Shapes (n,)."""

    deadline_ns: I64
    frame: I64
    list: I64
    place: I64
    node: I64


NO_REQUESTS = BootUpWaits(*(np.empty(0, np.int64) for _ in BootUpWaits.__struct_fields__))


class Waits(Columns, Struct, frozen=True):
    """Waits of data telegrams that have ended: from when to when, and in which frame. Shapes (n,).

    ``peer`` is the node that ended it, or of one that nobody did, the node to which the telegram was sent; -1 for all.
    """

    stream: I64
    since_ns: I64
    end_ns: I64
    frame: I64
    peer: I64


NO_WAITS_ENDED = Waits(*(np.empty(0, np.int64) for _ in Waits.__struct_fields__))


class Overdue(NamedTuple):
    """Waits whose deadline has passed without a frame that shows it, of data telegrams and of boot-up requests."""

    waits: Waits
    requests: BootUpWaits


class Answers(NamedTuple):
    """What a batch showed about answers.

    ``errors`` are error events. ``missing`` are the waits that nobody ended, with the frames that waited, ``answered``
    those of the others, with the frames that ended them; ``negative_node`` is whom each negative acknowledgement blames
    (-1: nobody); ``unexpected`` are positions among the acknowledgements; ``unanswered`` are boot-up requests, as are
    ``obtained``, of which ``data`` are the packets that answered them.
    """

    errors: list[ErrorEvents]
    missing: Waits
    answered: Waits
    negative_node: I64
    unexpected: I64
    unanswered: BootUpWaits
    obtained: BootUpWaits
    data: I64
