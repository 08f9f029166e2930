"""StreamPlaces: where the streams of TCP connections are, behind all that was put in order of them so far."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.connections import Connections
from nvscope.tracker.segments import WRAP, StreamColumns
from nvscope.tracker.segments_aside import NEAR


class Positions(NamedTuple):
    """Where streams are, and how far the other end has acknowledged them: sequence numbers by stream, or -1."""

    next: I64
    acknowledged: I64

    def of(self, stream: int) -> tuple[int, int]:
        """Return those of a stream, -1 of one that is not there."""
        if stream >= len(self.next):
            return -1, -1
        return int(self.next[stream]), int(self.acknowledged[stream])


class StreamPlaces:
    """The connections over some ports that are known, and a row of ``columns`` for each of their streams.

    ``nvscope.tracker.streams.Streams`` changes them; who goes on with what it brings looks at places of its own, which
    are as those were behind the same batch (``be_as``).
    """

    def __init__(self, ports: Sequence[int]) -> None:
        self.connections = Connections(ports)
        self.columns = StreamColumns()

    def be_as(self, connections: Connections | None, columns: StreamColumns) -> None:
        """Take that streams are there; ``connections`` are None where they are those that are known."""
        if connections is not None:
            self.connections.be_as(connections)
        self.columns = columns

    def positions(self) -> Positions:
        """Return where all streams are now."""
        column, count = self.columns.column, 2 * len(self.connections)
        at = np.where(column("begun")[:count], column("next")[:count], -1)
        return Positions(at, column("acknowledged")[:count].copy())

    def position(self, stream: int) -> tuple[int, int]:
        """Return where a stream is now, which has begun, and how far it was acknowledged, or -1."""
        return int(self.columns.next[stream]), int(self.columns.acknowledged[stream])

    def lacking_clients(self) -> I64:
        """Return the connections of whose clients bytes are missing, or may be, in front of the end of the capture.

        Their servers acknowledge bytes behind all that is there, or something waits behind a hole.
        """
        column, count = self.columns.column, 2 * len(self.connections)
        begun, ended, told, at, waits = (column(name)[:count:2] for name in ("begun", "ended", "had", "next", "waits"))
        ahead = np.where(told >= 0, (told - at) % WRAP, 0)
        lacks = begun & ~ended & (waits | ((ahead > 1) & (ahead <= NEAR)))
        return np.flatnonzero(lacks)

    def held_back(self) -> I64:
        """Return the connections of which all that their clients said, or but that they begin, still waits.

        Their servers have said nothing that was read, and what waits is held back for that
        (``nvscope.tracker.held_back``).
        """
        column, count = self.columns.column, 2 * len(self.connections)
        begun, at, first, waits = (column(name)[:count] for name in ("begun", "next", "first", "waits"))
        own, other = begun[::2], begun[1::2]
        return np.flatnonzero(waits[::2] & ~(own & (other | (at != first)[::2])))
