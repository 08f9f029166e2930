"""Streams: the bytes of TCP connections over claimed ports, in their order, with holes where bytes are missing.

Source: RFC 9293. What was captured need not be what arrived: segments may be missing, twice, in another order, or cut
short, and connections may have begun before the capture. A hole is data: nothing is made up for it, and what lies
behind it waits until it is sure that the missing bytes do not come any more (``nvscope.tracker.segments_in_turn``).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U8, Bool, PacketBatch
from dissectors.headers import FIN, RST, SYN
from dissectors.transport import SegmentBatch
from nvscope.engine.runs import runs_of, stable_order
from nvscope.tracker.connections import Connections
from nvscope.tracker.handshakes import opened_late
from nvscope.tracker.pieces import NEVER, ORDER_BITS, Again, Brought, Pieces, no_pieces
from nvscope.tracker.segments import Segments
from nvscope.tracker.segments_at_once import SegmentsAtOnce
from nvscope.tracker.segments_in_turn import (
    FORGOTTEN_NS,
    MOST_KEPT_BYTES,
    MOST_KEPT_IN_ALL_BYTES,
    SegmentsInTurn,
)
from nvscope.tracker.stream_places import StreamPlaces

_FEW = 128
"""So many segments take as long one after the other as at once."""

_LEAST = 4
"""So many segments of a connection go in turn at a time, at least."""

_MOST_PARTS = 8

MOST_CONNECTIONS = 1 << 16
ENOUGH = 1 << 10
"""Fewer connections are not worth while to be forgotten."""


class Outlived(NamedTuple):
    """The connections that are kept, by the numbers that they had; and whether only those go that have ended."""

    kept: I64
    only_ended: bool

    def numbers(self) -> dict[int, int]:
        """Return the numbers that they have now, by those that they had."""
        return {old: new for new, old in enumerate(self.kept.tolist())}


class Streams:
    """The connections over some ports, from one batch to the next.

    Connections in which nothing is missing, late or begun anew are put in order all at once, as columns; the others a
    segment at a time. Of more than ``enough`` connections those that have ended may be forgotten, and of more than
    ``most`` others, too (``outlived``).
    """

    def __init__(self, ports: Sequence[int], enough: int = ENOUGH, most: int = MOST_CONNECTIONS) -> None:
        self.places = StreamPlaces(ports)
        self._in_turn = SegmentsInTurn(self.places.columns)
        self._latest_ns = 0
        self._again: list[I64] = []
        self._enough = self._least = enough
        self._most = most

    @property
    def connections(self) -> Connections:
        """The connections that are known."""
        return self.places.connections

    def outlived(self) -> Outlived | None:
        """Forget connections where there are many; return None where all are kept.

        Those that have ended go, sooner where there are too many of all, and of too many others those of which nothing
        came for the longest time. Those kept are numbered anew, in their order.
        """
        if len(self.connections) <= self._enough:
            return None
        column = self.places.columns.column
        latest_ns = np.maximum(column("latest_ns")[0::2], column("latest_ns")[1::2])
        stays = ~(column("ended")[0::2] & column("ended")[1::2])
        recent = np.flatnonzero(stays | (latest_ns >= self._latest_ns - FORGOTTEN_NS))
        kept = recent if len(recent) <= self._most else np.flatnonzero(stays)
        only_ended = len(kept) <= self._most
        if not only_ended:
            newest = np.argpartition(latest_ns[kept], -self._most)[-self._most :]
            kept = np.sort(kept[newest])
        self._enough = max(self._least, min(2 * len(kept), self._most))
        if len(kept) == len(self.connections):
            return None
        self.connections.keep(kept)
        streams = np.stack([2 * kept, 2 * kept + 1], axis=1).ravel()
        self.places.columns = self.places.columns.rows(streams)
        self._in_turn.keep({old: new for new, old in enumerate(streams.tolist())}, self.places.columns)
        return Outlived(kept, only_ended)

    def forget(self) -> None:
        """Forget where all connections are: what comes next of them begins in the middle."""
        self.places.columns.reset()
        self._in_turn.forget()

    def observe(self, packets: PacketBatch, segments: SegmentBatch, first_frame: int) -> Brought:
        """Take the segments of a batch, which follows those observed so far; ``first_frame`` is that of its row 0."""
        if not len(segments):
            return Brought(no_pieces())
        rows, carrying = self._numbered(packets, segments, first_frame)
        if not len(rows):
            return Brought(no_pieces())
        self._latest_ns = max(self._latest_ns, int(rows.time_ns.max()))
        self.places.columns.resize(2 * len(self.connections))
        self._in_turn.begin()
        if self._in_turn.opened_late == NEVER:
            self._in_turn.opened_late = opened_late(rows, carrying, self.places.columns)
        found: list[Pieces] = []
        self._again = []
        put_in_order = self._put_in_order if self._is_room(rows) else self._put_in_order_by_time
        put_in_order(packets.data, rows, carrying, found)
        found.append(self._in_turn.told())
        pieces = Pieces.stacked(found)
        # Of one stream, and with one frame, what was found first comes first.
        orders = pieces.order - (first_frame << ORDER_BITS)
        place = pieces.stream << (len(packets) << ORDER_BITS).bit_length() | orders
        again = np.concatenate([*self._again, np.array(self._in_turn.again, np.int64).reshape(-1, len(Again._fields))])
        others, disordered = self._in_turn.others, sorted(self._in_turn.disordered, key=lambda one: one[1])
        in_order = pieces.take(np.argsort(place, kind="stable"))
        return Brought(in_order, self._in_turn.kept, again, others, disordered)

    def _is_room(self, rows: Segments) -> bool:
        """Tell whether all that may have to be kept of some segments is within the limit, whatever comes when."""
        start, stop = runs_of(rows.stream)
        size = np.add.reduceat(rows.payload_bytes, start) + 2 * (stop - start)  # SYN and FIN take a place each
        most = MOST_KEPT_BYTES + int(rows.payload_bytes.max()) + 2
        return self._in_turn.kept_bytes + int(np.minimum(size, most).sum()) <= MOST_KEPT_IN_ALL_BYTES

    def _put_in_order(self, data: U8, rows: Segments, carrying: Bool, found: list[Pieces]) -> None:
        """Add what segments bring to ``found``: in turn around what is peculiar, else as columns."""
        least = _LEAST
        while len(rows) > _FEW:
            at_once = SegmentsAtOnce(rows, carrying, self.places.columns, self._in_turn.opened_late)
            is_plain = at_once.take_up_to(at_once.since)
            anew = np.empty(0, np.int64)
            if not is_plain.all():
                anew = self._take_turns(data, rows, np.flatnonzero(~is_plain), at_once, least)
            found.append(at_once.told())
            self._again.append(at_once.again())
            rows, carrying = rows.take(anew), carrying[anew]
            least *= 2
        self._in_turn.observe(data, rows)

    def _take_turns(self, data: U8, segments: Segments, rest: I64, at_once: SegmentsAtOnce, least: int) -> I64:
        """Take the rest of some segments, in turn where something is peculiar, and as columns between.

        Return those, rising, of connections that have to be looked at anew behind ``least`` segments or more.
        """
        frame = segments.frame[rest]
        first = int(frame.min())
        by_connection = (segments.stream[rest] >> 1) * (int(frame.max()) + 1 - first) + (frame - first)
        rest = rest[np.argsort(by_connection, kind="stable")]
        rows = segments.take(rest)
        start, stop = runs_of(rows.stream >> 1)
        peculiar = np.flatnonzero(at_once.is_peculiar[rest])
        few = stop - start <= 2 * least
        is_few = np.repeat(few, stop - start)
        self._in_turn.observe(data, rows.take(is_few))
        anew = []
        for place, end in zip(start[~few].tolist(), stop[~few].tolist(), strict=True):
            left = self._alternate(data, rows, (place, end), peculiar, at_once, least)
            if left < end:
                anew.append(rest[left:end])
        return np.sort(np.concatenate(anew)) if anew else np.empty(0, np.int64)

    def _alternate(
        self, data: U8, rows: Segments, run: tuple[int, int], peculiar: I64, at_once: SegmentsAtOnce, least: int
    ) -> int:
        """Take the segments of a connection, by frame, the first of which is peculiar, or behind something kept.

        Return the place of the first that has to be looked at anew, the end of the run where there is none.
        """
        place, stop = run
        ahead = [*peculiar[slice(*np.searchsorted(peculiar, run))].tolist(), stop]
        connection = int(rows.stream[place]) >> 1
        while place < stop:
            place = self._in_turn.go_on(data, rows, place, stop, least)
            following = ahead[bisect_left(ahead, place)]
            if following - place < least:
                continue
            if not at_once.fits(connection, int(rows.frame[place])):
                return place
            at_once.take_between(rows, place, following)
            place = following
        return place

    def _put_in_order_by_time(self, data: U8, rows: Segments, carrying: Bool, found: list[Pieces]) -> None:
        """Do the same, in parts of time: for what is kept of all connections, it matters what comes when."""
        if len(rows) <= _FEW:
            self._in_turn.observe(data, rows)
            return
        at_once = SegmentsAtOnce(rows, carrying, self.places.columns, self._in_turn.opened_late)
        is_plain = at_once.take_up_to(np.where(at_once.since == NEVER, NEVER, -1))
        found.append(at_once.told())
        self._again.append(at_once.again())
        if is_plain.all():
            return
        rest, carrying = rows.take(~is_plain), carrying[~is_plain]
        parts = min(max(-(-len(rest) // _FEW), 2), _MOST_PARTS)
        bounds = [len(rest) * part // parts for part in range(1, parts)]
        part_of = np.searchsorted(np.partition(rest.frame, bounds)[bounds], rest.frame, side="right")
        for number in range(parts):
            part = part_of == number
            self._put_in_order_by_time(data, rest.take(part), carrying[part], found)

    def _numbered(
        self, packets: PacketBatch, segments: SegmentBatch, first_frame: int
    ) -> tuple[Segments, Bool]:  # fmt: skip
        """Return the segments of connections by stream, and which of them carry something: data, SYN or FIN.

        Whoever resets a connection begins none.
        """
        carrying = (segments.payload_bytes > 0) | ((segments.flags & (SYN | FIN)) != 0)
        carrying &= (segments.flags & RST) == 0
        stream = self.connections.streams_of(segments, carrying)
        own = np.flatnonzero(stream >= 0)
        stream = stream[own]
        in_order = stable_order(stream, 2 * len(self.connections) + 1)
        order = own[in_order]
        row = segments.row[order]
        rows = Segments(
            stream[in_order], segments.sequence[order].astype(np.int64),
            segments.acknowledgement[order].astype(np.int64), segments.flags[order].astype(np.int64),
            segments.payload[order], segments.payload_bytes[order], segments.captured_bytes[order],
            row + first_frame, packets.ts_ns[row],
        )  # fmt: skip
        return rows, carrying[order]
