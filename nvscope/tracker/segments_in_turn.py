"""Segments in turn: those of connections in which something is missing, late, or begins anew, one after the other.

Of bytes that come twice, those that came first count. What lies behind a hole is kept until it is sure that the missing
bytes do not come any more:

- the receiver has acknowledged the first byte behind them, and is to be believed (``StreamColumns.had``), or
- more than ``MOST_KEPT_BYTES`` wait behind it in this direction, or more than ``MOST_KEPT_IN_ALL_BYTES`` everywhere, or
- the first of what is kept came more than ``one_stream.PATIENCE_NS`` before another segment of the connection, or
- the connection is reset, or another one begins between the same ends.

Where a connection is captured in another order than it was sent in, they are taken in that of ``HeldBack``.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from heapq import heappush

import numpy as np

from dissectors.batch import U8
from dissectors.headers import ACK, FIN, RST, SYN
from nvscope.tracker.held_back import HeldBack, is_behind_its_acknowledgement, is_early
from nvscope.tracker.kept_segments import BEGIN, Kept, missing_of, others_of
from nvscope.tracker.one_stream import OneStream, ahead_of
from nvscope.tracker.pieces import (
    ANEW,
    BROKEN_OFF,
    BY_CLIENT,
    IN_STEP,
    MOMENT_BITS,
    NEVER,
    PLACE_BITS,
    REPLACED,
    Again,
    Order,
    OtherBytes,
    PieceKind,
    Pieces,
)
from nvscope.tracker.segments import FAR, WRAP, Captured, Segments, StreamColumns
from nvscope.tracker.segments_aside import NEAR, Aside, SegmentsAside, missing_behind

MOST_KEPT_BYTES = 1 << 18
MOST_KEPT_IN_ALL_BYTES = 1 << 26
FORGOTTEN_NS = 240 * 10**9
"""A connection that has ended is forgotten after twice the longest life of a segment (RFC 9293, section 3.4.2)."""


class SegmentsInTurn:
    """Puts segments in order one at a time; ``columns`` are the state of all streams, which it changes.

    ``opened_late`` is the frame with which a connection was opened behind what answers that, ``NEVER`` without one.
    """

    def __init__(self, columns: StreamColumns) -> None:
        self._columns = columns
        self._waiting: dict[int, OneStream] = {}
        self._aside = SegmentsAside()
        self._held = HeldBack()
        self.opened_late = NEVER
        self._kept_bytes = 0
        self._made: list[tuple[int, ...]] = []
        self.kept: list[bytes] = []
        self.again: list[Again] = []
        self.others: list[OtherBytes] = []
        self.disordered: list[tuple[int, int]] = []
        self._data: U8 = np.empty(0, np.uint8)

    def forget(self) -> None:
        """Forget what is kept."""
        self._waiting.clear()
        self._aside.clear()
        self._held.clear()
        self._kept_bytes = 0

    def keep(self, numbers: Mapping[int, int], columns: StreamColumns) -> None:
        """Forget all streams but some, which are numbered anew; ``columns`` are their state from now on."""
        self._columns = columns
        self._aside.keep(numbers)
        self._held.keep(numbers)
        waiting, self._waiting = self._waiting, {}
        for number, stream in waiting.items():
            if number in numbers:
                stream.number = numbers[number]
                self._waiting[stream.number] = stream
            else:
                self._kept_bytes -= stream.kept_bytes

    def begin(self) -> None:
        """Begin a batch, whose buffer is another one."""
        self.kept, self.again, self.others, self.disordered = [], [], [], []

    @property
    def kept_bytes(self) -> int:
        """How much is kept of all streams."""
        return self._kept_bytes

    def observe(self, data: U8, segments: Segments) -> None:
        """Take all segments of some connections within some time.

        ``data`` is the batch's buffer; ``kept`` is the data of what had been kept before.
        """
        self._data = data
        connection = segments.stream >> 1
        by_frame = segments.take(np.lexsort((segments.frame, connection)))
        last, ends = -1, None
        for stream, *segment in by_frame.tuples(0, len(by_frame)):
            if stream >> 1 != last:
                if ends is not None:
                    self._put_back(data, ends)
                last = stream >> 1
                ends = self._taken(2 * last), self._taken(2 * last + 1)
            assert ends is not None
            self._take(ends, Captured(stream & 1, *segment))
        if ends is not None:
            self._put_back(data, ends)

    def go_on(self, data: U8, segments: Segments, place: int, stop: int, least: int) -> int:
        """Take segments of one connection, by frame, from a place on: so many, and more while something is kept of it.

        Return the place behind them, which is ``stop`` at most.
        """
        self._data = data
        connection = int(segments.stream[place]) >> 1
        ends = self._taken(2 * connection), self._taken(2 * connection + 1)
        while place < stop:
            behind = min(place + least, stop)
            for stream, *segment in segments.tuples(place, behind):
                self._take(ends, Captured(stream & 1, *segment))
            place = behind
            if not (ends[0].kept or ends[1].kept or connection in self._aside or connection in self._held):
                break
        self._put_back(data, ends)
        return place

    def told(self) -> Pieces:
        """Return what the segments bring that were taken since this was asked for last."""
        made, self._made = np.array(self._made, np.int64).reshape(-1, len(Pieces.__match_args__)).T, []
        return Pieces(*made)

    def _taken(self, number: int) -> OneStream:
        waiting = self._waiting.pop(number, None)
        if waiting is not None:
            return waiting
        columns = self._columns
        return OneStream(
            number, bool(columns.begun[number]), bool(columns.ended[number]), bool(columns.disordered[number]),
            int(columns.next[number]),
            int(columns.first[number]), int(columns.acknowledged[number]), int(columns.had[number]),
            int(columns.ahead[number]), int(columns.told[number]), int(columns.latest_ns[number]),
        )  # fmt: skip

    def _put_back(self, data: U8, ends: tuple[OneStream, OneStream]) -> None:
        columns = self._columns
        connection = ends[0].number >> 1
        self._aside.hold_data(connection, data)
        self._held.hold_data(connection, data)
        for stream in ends:
            number = stream.number
            columns.begun[number], columns.ended[number] = stream.begun, stream.ended
            columns.disordered[number] = stream.disordered
            columns.next[number], columns.first[number] = stream.next, stream.first
            columns.acknowledged[number], columns.told[number] = stream.acknowledged, stream.told
            columns.had[number], columns.ahead[number] = stream.had, stream.ahead
            columns.latest_ns[number] = stream.latest_ns
            columns.waits[number] = bool(stream.kept) or connection in self._aside or connection in self._held
            if stream.kept:
                self._waiting[number] = stream
                for one in stream.kept:
                    if isinstance(one.source, int):
                        one.source = data[one.source : one.source + one.size].tobytes()

    def _take(self, ends: tuple[OneStream, OneStream], segment: Captured) -> None:
        connection, place = ends[0].number >> 1, segment.frame << PLACE_BITS
        was_disordered = ends[0].disordered
        if connection not in self._held and not is_early(ends, segment, self.opened_late):
            self._take_now(ends, segment, place)
        else:
            if ends[0].begun or ends[1].begun:
                # That somebody has got more is known at once, whatever waits.
                ends[1 - segment.side].note_acknowledged(segment.acknowledgement, segment.flags)
            for number, one in enumerate(self._held.released(connection, ends, segment, self.opened_late)):
                self._take_now(ends, one, place + number)
        if ends[0].disordered and not was_disordered:
            self.disordered.append((connection, segment.frame))

    def _take_now(self, ends: tuple[OneStream, OneStream], segment: Captured, place: int) -> None:
        side, sequence, acknowledgement, flags, _, payload_bytes, _, _, time_ns = segment
        own, other, connection = ends[side], ends[1 - side], ends[0].number >> 1
        if own.ended and other.ended and time_ns - max(own.latest_ns, other.latest_ns) > FORGOTTEN_NS:
            self._aside.drop(connection)
            for stream in ends:
                stream.forget()
        if flags & SYN and not flags & RST:
            answers = flags & ACK
            is_new = own.first != (sequence + 1) % WRAP and (not answers or own.first >= 0)
            # What the other end has acknowledged, it has answered: it was captured before.
            is_new &= own.begun or not 0 <= ahead_of(own.had, sequence + 1) <= NEAR or own.had < 0
            # What was refused is asked for again with the same number, and so is what an older connection was in the
            # way of (RFC 9293, section 3.5.1).
            is_new |= not answers and own.is_nothing and other.is_nothing
            if is_new and (own.begun or other.begun):
                # Whoever it is whose SYN is there: it is the client that begins another one.
                self._begin_anew(ends, place, time_ns)
        elif not flags & RST and (proven := self._aside.proven_by(connection, segment)) is not None:
            self._begin_anew(ends, place, time_ns)
            self._take_proven(ends, proven, place)
        elif not (own.begun or other.begun) and (flags & RST or not (payload_bytes or flags & FIN)):
            return
        other.note_acknowledged(acknowledgement, flags)
        own.note_had(other, sequence, flags, payload_bytes, segment.told)
        while other.kept and other.hole_is_acknowledged:
            self._give_up_hole(other, place, Order.ACKNOWLEDGED)
        for stream, order in zip(ends, (Order.OLD_CLIENT, Order.OLD_SERVER), strict=True):
            while stream.kept and stream.waits_longer_than(time_ns):
                self._give_up_hole(stream, place, order)
        if flags & RST:
            by_client = 0 if side else BY_CLIENT
            self._aside.drop(connection)
            self._break_off(ends, place, time_ns, (Order.END_CLIENT, Order.END_SERVER), by_client, (side, sequence))
            return
        if not (payload_bytes or flags & (SYN | FIN)):
            return
        if own.begun and not flags & SYN and own.is_elsewhere(sequence):
            self._aside.put(connection, segment)
            return
        self._aside.drop(connection)
        if is_behind_its_acknowledgement(own, segment):
            own.disordered = other.disordered = True
        self._bring(ends, segment, place, Order.OWN)

    def _begin_anew(self, ends: tuple[OneStream, OneStream], place: int, time_ns: int) -> None:
        """Take that another connection begins in place of this one."""
        self._break_off(ends, place, time_ns, (Order.OLD_END, Order.OLD_END), BY_CLIENT | REPLACED)
        self._aside.drop(ends[0].number >> 1)
        for stream in ends:
            stream.forget()

    def _take_proven(self, ends: tuple[OneStream, OneStream], proven: Aside, place: int) -> None:
        """Take what a place has shown to be of the connection that has begun."""
        for segment in proven.segments:
            self._bring(ends, segment, place, Order.PROVEN)

    def _bring(self, ends: tuple[OneStream, OneStream], segment: Captured, place: int, order: Order) -> None:
        """Take what a segment brings of its stream."""
        side, sequence, _, flags, source, payload_bytes, captured_bytes, _, time_ns = segment
        own, other, told = ends[side], ends[1 - side], segment.told
        if not own.begun:
            own.begin(sequence, (flags & SYN) // SYN, told)
            size = (IN_STEP if flags & SYN else 0) | (0 if other.begun else ANEW)
            self._tell(own, PieceKind.BEGIN, (0, size), place, order, own.first)
        begin = own.at + own.distance(sequence)
        if own.ended or abs(begin - own.at) > FAR:
            return
        # A single byte at the place of the last one that was sent may be any (``Again``).
        asks = payload_bytes == 1 and begin + (flags & SYN) // SYN == own.sent - 1
        parts: list[Kept] = []
        for size, kind, data in (
            (1 if flags & SYN else 0, PieceKind.BEGIN, None), (captured_bytes, PieceKind.DATA, source),
            (payload_bytes - captured_bytes, PieceKind.HOLE, None), (flags & FIN, PieceKind.END, None),
        ):  # fmt: skip
            if kind is PieceKind.DATA and size and begin < own.at and not asks:
                self._note_again(own, segment, own.at - begin, place << MOMENT_BITS | int(order))
            if size and begin + size > own.at:
                part = Kept(begin, size, kind, data, place, time_ns, told)
                parts.append(part.part(own.at, part.end) if begin < own.at else part)
            begin += size
        if not parts:
            return
        if own.kept or parts[0].begin > own.at:
            for part in parts:
                if not asks and (size := others_of(own.kept, part, self._data)):
                    copy = segment.with_data(self._data).source
                    assert isinstance(copy, bytes)
                    self.others.append(OtherBytes(own.number, place << MOMENT_BITS | int(order), size, copy))
                self._keep(own, part)
            self._pass_on_kept(own, place, order)
            while own.kept and (own.hole_is_acknowledged or self._is_full(own)):
                self._give_up_hole(own, place, order)
        else:
            for part in parts:
                self._pass_on(own, part, place, order)

    def _note_again(self, stream: OneStream, segment: Captured, back: int, order: int) -> None:
        """Note that the first bytes of a segment come again, which lies so far behind the place of its stream."""
        source, captured = segment.source, segment.captured_bytes
        if isinstance(source, bytes):
            self.kept.append(source)
            source = ~(len(self.kept) - 1)
        self.again.append(Again(stream.number, order, back, source, min(captured, back), captured))

    def _is_full(self, stream: OneStream) -> bool:
        return stream.kept_bytes > MOST_KEPT_BYTES or self._kept_bytes > MOST_KEPT_IN_ALL_BYTES

    def _keep(self, stream: OneStream, part: Kept) -> None:
        """Keep of a part what is not kept already."""
        for one in list(missing_of(stream.kept, part)):
            stream.kept.insert(bisect_right(stream.kept, one.begin, key=BEGIN), one)
            heappush(stream.by_place, (one.place, one.begin, one))
            stream.kept_bytes += one.size
            self._kept_bytes += one.size

    def _pass_on_kept(self, stream: OneStream, place: int, order: Order) -> None:
        """Pass on what is kept up to the next hole."""
        passed = 0
        for part in stream.kept:
            if part.begin > stream.at:
                break
            stream.kept_bytes -= part.size
            self._kept_bytes -= part.size
            self._pass_on(stream, part, place, order)
            part.is_passed = True
            passed += 1
        del stream.kept[:passed]
        if not stream.kept:
            stream.by_place.clear()

    def _give_up_hole(self, stream: OneStream, place: int, order: Order) -> None:
        """Take the bytes in front of what is kept for missing."""
        first = stream.kept[0]
        hole = Kept(stream.at, first.begin - stream.at, PieceKind.HOLE, None, place, stream.latest_ns)
        self._pass_on(stream, hole, place, order)
        self._pass_on_kept(stream, place, order)

    def _pass_on(self, stream: OneStream, part: Kept, place: int, order: Order) -> None:
        ended = stream.ended
        stream.at += part.size
        stream.next = (stream.next + part.size) % WRAP
        if part.kind in (PieceKind.DATA, PieceKind.END):
            stream.came_at(part.place, part.time_ns)
        if part.kind is not PieceKind.HOLE:
            stream.told = part.acknowledged
        if ended:
            return
        start, size = 0, part.size
        if part.kind is PieceKind.BEGIN:
            return
        if part.kind is PieceKind.END:
            stream.ended, size = True, 0
        elif isinstance(part.source, int):
            start = part.source
        elif isinstance(part.source, bytes):
            start = ~len(self.kept)
            self.kept.append(part.source)
        self._tell(stream, part.kind, (start, size), place, order, stream.next)

    def _tell(
        self, stream: OneStream, kind: PieceKind, data: tuple[int, int], place: int, order: Order, behind: int
    ) -> None:  # fmt: skip
        at = place << MOMENT_BITS | int(order)
        self._made.append((stream.number, int(kind), *data, at, stream.latest_ns, behind, stream.told))

    def _break_off(
        self, ends: tuple[OneStream, OneStream], place: int, time_ns: int, orders: tuple[Order, Order], by_client: int,
        reset_at: tuple[int, int] | None = None,
    ) -> None:  # fmt: skip
        """End both directions behind what is kept, and known to be missing; ``reset_at``: side and number of an RST."""
        if not (ends[0].begun or ends[1].begun):
            return
        # What both sent came before either end: a server's missing reply is not one to what its client left unfinished.
        before = Order.OLD_CLIENT, Order.OLD_SERVER
        for side, (stream, order, sent) in enumerate(zip(ends, orders, before, strict=True)):
            while stream.kept:
                self._give_up_hole(stream, place, sent)
            known = stream.had, reset_at[1] if reset_at and reset_at[0] == side else -1
            if stream.begun and not stream.ended and (size := missing_behind(stream.next, known)):
                hole = Kept(stream.at, size, PieceKind.HOLE, None, place, stream.latest_ns)
                self._pass_on(stream, hole, place, sent)
            stream.begun = stream.ended = True
            stream.came_at(place, time_ns)
            self._tell(stream, PieceKind.END, (0, BROKEN_OFF | by_client), place, order, stream.next)
