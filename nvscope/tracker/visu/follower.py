"""VisuFollower: from the segments of claimed ports to what WebVisu pages and controllers say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from dissectors.batch import PacketBatch
from dissectors.transport import SegmentBatch
from dissectors.webvisu import Likeness
from nvscope.tracker.other_copies import OtherCopies
from nvscope.tracker.stream_places import StreamPlaces
from nvscope.tracker.streams import ENOUGH, MOST_CONNECTIONS, Streams
from nvscope.tracker.visu.exchanges import Exchanges
from nvscope.tracker.visu.http_messages import HttpStreams
from nvscope.tracker.visu.in_order import InOrder
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.tracker.visu.missing_replies import MissingReplies
from nvscope.tracker.visu.one_way import OneWay

if TYPE_CHECKING:
    from nvscope.definition.visu_encoding import Encoding
    from nvscope.definition.webvisu import GivenList


class VisuFollower:
    """Follows the connections over some ports, from one batch to the next; ``given`` are lists of names,
    ``encodings`` those of texts by address, '' for all.

    Of more than ``most`` connections at a time, those that are silent for longest are given up.
    """

    def __init__(
        self, ports: Sequence[int], given: Sequence[GivenList] = (), most: int = MOST_CONNECTIONS,
        encodings: Mapping[str, Encoding] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        # What is put in order, and where it was when what is said in it was read: that may be later.
        self._streams = Streams(ports, min(most, ENOUGH), most)
        self._copies = OtherCopies()
        self._handed: tuple[int, int] | None = None
        self._places = StreamPlaces(ports)
        self._http = HttpStreams()
        self._exchanges = Exchanges(self._places.connections, given, encodings)

    def prepare(self, packets: PacketBatch, segments: SegmentBatch, first_frame: int) -> InOrder:
        """Put the segments of a batch in order, which follows those before; its row 0 is frame ``first_frame``."""
        outlived = self._streams.outlived()
        if outlived is not None:
            self._copies.keep(outlived.numbers())
        before = self._streams.places.positions()
        brought = self._streams.observe(packets, segments, first_frame)
        others = self._copies.observe(packets.data, brought)
        connections, columns = self._streams.connections, self._streams.places.columns
        is_known, self._handed = self._handed == connections.version, connections.version
        return InOrder(outlived, before, brought, None if is_known else connections, columns, others)

    def follow(
        self, packets: PacketBatch, segments: SegmentBatch, first_frame: int, prepared: InOrder | None = None
    ) -> VisuBatch:  # fmt: skip
        """Return what the segments of a batch bring, of which this was prepared, here or elsewhere."""
        own = prepared or self.prepare(packets, segments, first_frame)
        if own.outlived is not None:
            numbers = own.outlived.numbers()
            self._http.keep(numbers)
            self._exchanges.keep(numbers, only_ended=own.outlived.only_ended)
        places, brought = self._places, own.brought
        places.be_as(own.connections, own.columns)
        one_way = OneWay(places.connections, segments, first_frame)
        messages = self._http.read(packets.data, brought, self._exchanges.waiting, one_way.missed_of)
        missing = MissingReplies(one_way, own.before, places, brought.pieces)
        told = self._exchanges.take(messages, packets, segments, first_frame, one_way, missing, own.others)
        self._exchanges.note_disorder(brought.disordered, packets, first_frame)
        return replace(told, lacking=self.lacking, disorder=self._exchanges.disorder)

    def lacking(self) -> Sequence[tuple[int, ...]]:
        """Return whose clients may have written something behind all that was read so far, by client, server and port.

        Bytes of them are missing, or may be, they have begun a request, or what they said still waits.
        """
        of_pages = np.concatenate([self._places.lacking_clients(), self._http.begun_writes(Likeness.PERHAPS)])
        any_ones = np.concatenate([self._places.held_back(), self._http.begun_writes(Likeness.YES)])
        return self._exchanges.ends_of(np.append(self._exchanges.pages_among(of_pages), any_ones))

    def pass_time(self, packets: PacketBatch, segments: SegmentBatch, first_frame: int) -> None:
        """Take a batch of which no segment is of these ports."""
        self._exchanges.pass_time(packets, segments, first_frame)

    def forget(self) -> None:
        """Forget where all connections are: what comes next of them begins in the middle."""
        self._streams.forget()
        self._http.forget()
        self._copies.forget()
        self._exchanges.forget()
