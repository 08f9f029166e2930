"""Dissector: how a protocol is read that has ports, or a link type, of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, Self

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool, PacketBatch
from dissectors.claims import Claims
from dissectors.stretches import Uncopied
from dissectors.transport import DatagramBatch, SegmentBatch


class Part(Protocol):
    """What a protocol found in the frames of a packet batch: columns, in the order of the batch, one row a frame."""

    @property
    def row(self) -> I64:
        """The rows of the packets, rising, none twice."""
        ...

    def __len__(self) -> int: ...

    def take(self, rows: I64 | Bool) -> Self:
        """Return those at the given positions or where the mask is set."""
        ...


class Prepared(Protocol):
    """What a follower has prepared of a batch, as a value that may be handed over to another process."""

    def apart(self, packets: PacketBatch) -> tuple[Self, Uncopied]:
        """Return it without the bytes that it needs of packets and streams, and these."""
        ...

    def with_bytes(self, data: memoryview) -> Self:
        """Return it with the bytes that were taken from it, which are valid as long as the batch is."""
        ...


class Follower(Protocol):
    """Reads a protocol over TCP whose messages span segments: it keeps what it needs from one batch to the next.

    Its work has two parts, each with a state of its own. They may be done by two processes, one of which is ahead.
    """

    def prepare(self, packets: PacketBatch, segments: SegmentBatch, first_frame: int) -> Prepared | None:
        """Return what can be known of a batch without what its messages say; None where there is nothing.

        The batch follows those before; ``first_frame`` is the number of its first packet in the capture.
        """
        ...

    def follow(
        self, packets: PacketBatch, segments: SegmentBatch, first_frame: int, prepared: Prepared | None
    ) -> Part:  # fmt: skip
        """Return what is whole with the segments of a batch, of which this was prepared.

        What has become whole is of the frame with which that is known.
        """
        ...

    def forget(self) -> None:
        """Forget where all connections are: nobody listened for a while."""
        ...


Dissect = Callable[[PacketBatch, DatagramBatch, SegmentBatch], Part]


class Dissector(Struct, frozen=True):
    """A protocol on ports, or a link type, of its own; ``name`` is what its fields begin with.

    ``dissect`` is given a packet batch, and the datagrams and segments in it that go over the ports of ``claims``. It
    is total: no bytes raise, what is wrong with a message is a column of its part, and what is none is left out. Only
    of what is ``holding`` so many bytes may so many be gathered. It keeps nothing from one batch to the next. Where
    messages span frames, ``begin`` makes in its place what follows the connections of one capture. Packets of a link
    type of its ``own_link`` are its own, too.
    """

    name: str
    claims: Claims
    dissect: Dissect | None = None
    begin: Callable[[], Follower] | None = None
    own_link: int | None = None

    def own_segments(self, segments: SegmentBatch) -> SegmentBatch:
        """Return those of its ports."""
        return segments.take(self.claims.claim_tcp(segments.source_port, segments.destination_port))

    def part_of(
        self, packets: PacketBatch, datagrams: DatagramBatch, segments: SegmentBatch, first_frame: int = 1,
        follower: Follower | None = None, prepared: Prepared | None = None,
    ) -> Part:  # fmt: skip
        """Return what it finds in datagrams and segments of which some are of its ports.

        ``prepared`` is what the follower has prepared of its own segments. Raises ValueError for a dissector that does
        not keep what ``Part.row`` promises.
        """
        claims = self.claims
        datagrams = datagrams.take(claims.claim_udp(datagrams.source_port, datagrams.destination_port))
        segments = self.own_segments(segments)
        if follower is not None:
            part = follower.follow(packets, segments, first_frame, prepared)
        else:
            assert self.dissect is not None
            part = self.dissect(packets, datagrams, segments)
        given = np.zeros(len(packets), np.bool_) if self.own_link is None else packets.link == self.own_link
        given[datagrams.row] = given[segments.row] = True
        row = part.row
        if len(row) and not ((np.diff(row) > 0).all() and row[0] >= 0 and row[-1] < len(given) and given[row].all()):
            raise ValueError(f"dissector {self.name}: rows have to rise, and to be of the frames that it was given")
        return part
