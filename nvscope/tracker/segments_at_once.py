"""Segments at once: put in order as columns, as far as nothing is missing, late, or begins anew.

All segments of a batch are laid along their streams as if nothing were peculiar. That counts for those in front of the
first peculiar one of a connection, and again behind it, once the connection is where it would have been without.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.headers import ACK
from nvscope.engine.runs import runs_of, spans
from nvscope.tracker.pieces import ANEW, IN_STEP, NEVER, ORDER_BITS, Order, PieceKind, Pieces
from nvscope.tracker.segments import FAR, HALF, WRAP, Segments, StreamColumns
from nvscope.tracker.segments_along import SegmentsAlong


class SegmentsAtOnce(SegmentsAlong):
    """The segments of some connections along their streams, of which some are taken: ``streams`` go on by these."""

    def __init__(
        self, rows: Segments, carrying: Bool, streams: StreamColumns, opened_late: int = NEVER
    ) -> None:  # fmt: skip
        super().__init__(rows, carrying, streams, opened_late)
        # Which were taken, and of those with which streams begin, which these are and how.
        self._own = np.zeros(len(self._whole), np.bool_)
        self._began = np.empty((2, 0), np.int64)

    def take_up_to(self, since: I64) -> Bool:
        """Take the segments in front of a frame, by connection, none of which is peculiar; return which these are."""
        whole, rows, streams, start = self._whole, self._rows, self._streams, self._start
        is_taken: Bool = rows.frame < since[rows.stream >> 1]
        was_begun = streams.column("begun")[0::2] | streams.column("begun")[1::2]
        first = np.where(was_begun, 0, np.minimum(self._first_frame[0::2], self._first_frame[1::2]))
        told = is_taken & self._acknowledges & (rows.frame >= first[rows.stream >> 1])
        self._note_acknowledged(streams.acknowledged, rows.stream[told] ^ 1, rows.acknowledgement[told])
        start_of_row, stop_of_row = self._runs
        if not len(whole):
            self._note_had(told, start_of_row, stop_of_row)
            return is_taken
        self._own = own = whole.frame < since[whole.stream >> 1]
        count = np.add.reduceat(own, start, dtype=np.int64)
        run = np.flatnonzero(count)
        last, moved = (start + count - 1)[run], self._stream[run]
        new = run[~streams.begun[moved]]
        begins, partner = start[new], self._stream[new] ^ 1
        anew = ~streams.begun[partner] & (self._first_frame[partner] > whole.frame[begins])
        self._began = np.stack([begins, self._syn[begins] * IN_STEP | anew * ANEW])
        streams.first[self._stream[new]] = (whole.sequence[begins] + self._syn[begins]) % WRAP
        begun = self._stream[new]
        far = begun[(streams.had[begun] >= 0) & ((streams.had[begun] - self._base[new] + FAR) % WRAP > 2 * FAR)]
        streams.next[moved] = (self._base[run] + self._top[last]) % WRAP
        streams.begun[moved] = True
        streams.had[far] = -1
        streams.latest_ns[moved] = self._latest[last]
        risen = self._risen[last]
        brings = risen >= start[run]
        streams.told[moved[brings]] = self._acknowledgement[risen[brings]]
        streams.ended[whole.stream[self._ends[own[self._ends]]]] = True
        renewed = self._renewed(last)
        anew = renewed >= start[run]
        streams.had[moved[anew] ^ 1] = -1
        begin, place = start_of_row.copy(), renewed[anew]
        of_row = np.searchsorted(rows.stream[start_of_row], moved[anew])
        begin[of_row] = place if self._place_of is None else self._place_of[place]
        self._note_had(told, begin, stop_of_row)
        return is_taken

    def fits(self, connection: int, frame: int) -> bool:
        """Tell whether a connection is in front of a frame where it would be if nothing had been peculiar."""
        streams = self._streams
        if streams.ended[2 * connection] and streams.ended[2 * connection + 1]:
            return False
        runs, earlier = dict(self._runs_of(connection)), self._earlier
        for stream in (2 * connection, 2 * connection + 1):
            # Where the stream has begun, and is, tells which segments are not of it.
            first, at, run = earlier.first[stream], earlier.next[stream], runs.get(stream)
            if run is not None:
                place, begin = self._place(run, frame), int(self._start[run])
                is_over = place == self._stop[run]
                if not is_over and (streams.ended[stream] or not streams.begun[stream]):
                    return False
                at = (self._base[run] + (self._top[place - 1] if is_over else self._before[place])) % WRAP
                first = first if earlier.begun[stream] else (self._base[run] + self._syn[begin]) % WRAP
            if (streams.first[stream], streams.next[stream]) != (first, at):
                return False
            if streams.ahead[stream] != earlier.ahead[stream]:
                return False
            # Of who was not known to be in disorder, what comes too early is not marked.
            if streams.disordered[stream] and not earlier.disordered[stream]:
                return False
        return True

    def take_between(self, segments: Segments, start: int, stop: int) -> None:
        """Take some segments of a connection that fits, by frame, among which nothing is peculiar."""
        streams, frame = self._streams, segments.frame[start:stop]
        connection = int(segments.stream[start]) >> 1
        first, last = int(frame[0]), int(frame[-1])
        runs = self._runs_of(connection)
        parts = {number: (self._place(run, first), self._place(run, last + 1)) for number, run in runs}
        tells = (segments.flags[start:stop] & ACK) != 0
        by_server = (segments.stream[start:stop] & 1) == 1
        for stream, telling in ((2 * connection, tells & by_server), (2 * connection + 1, tells & ~by_server)):
            own = telling.nonzero()[0]
            told = segments.acknowledgement[start:stop].take(own)
            self._note_acknowledged_of(streams.acknowledged, stream, told)
            renewed = self._renewed_between(*parts[stream ^ 1]) if stream ^ 1 in parts else -1
            if renewed >= 0:
                streams.had[stream] = -1
                told = told[frame.take(own).searchsorted(renewed) :]
            if len(told) and not told.all():
                told = told[told > 0]
            self._note_acknowledged_of(streams.had, stream, told)
        for number, run in runs:
            begin, end = parts[number]
            if begin < end:
                self._take_part(number, run, begin, end)

    def _take_part(self, number: int, run: int, start: int, stop: int) -> None:
        """Take some segments of a stream, which is a run of those that carry something."""
        streams, span = self._streams, slice(start, stop)
        self._own[span] = True
        # What comes first, and brings nothing, comes behind what was taken in turn.
        if not self._brings[start]:
            brings = self._brings[span]
            first_bringing = int(brings.argmax()) if brings.any() else stop - start
            self._latest[start : start + first_bringing] = streams.latest_ns[number]
        streams.latest_ns[number] = self._latest[stop - 1]
        streams.next[number] = (self._base[run] + self._top[stop - 1]) % WRAP
        if (risen := int(self._risen[stop - 1])) >= start:
            streams.told[number] = self._acknowledgement[risen]
        end = int(self._ends.searchsorted(start))
        streams.ended[number] = end < len(self._ends) and self._ends[end] < stop

    def _renewed_between(self, start: int, stop: int) -> int:
        """Return the last frame of some segments in which their stream tells anew how far the other one is had.

        -1 without any.
        """
        place = int(self._renewing.searchsorted(stop)) - 1
        if place < 0 or self._renewing[place] < start:
            return -1
        return int(self._whole.frame[self._renewing[place]])

    def _runs_of(self, connection: int) -> list[tuple[int, int]]:
        """Return the streams of a connection that carry something, and their runs."""
        first, last = self._stream.searchsorted((2 * connection, 2 * connection + 2)).tolist()
        return [(int(self._stream[run]), run) for run in range(first, last)]

    def _place(self, run: int, frame: int) -> int:
        """Return which one of a stream's segments is the first that is not in front of a frame."""
        start, stop = int(self._start[run]), int(self._stop[run])
        return start + int(self._whole.frame[start:stop].searchsorted(frame))

    def told(self) -> Pieces:
        """Return what the segments bring that were taken."""
        whole = self._whole
        order = whole.frame << ORDER_BITS | int(Order.OWN)
        acknowledged = self._acknowledgement
        begin = np.maximum(self._along + self._syn, self._before)
        skipped = begin - self._along - self._syn
        size = whole.payload_bytes - skipped
        first = whole.sequence + self._syn
        last = first + whole.payload_bytes
        data = np.flatnonzero(self._own & (size > 0))
        ends = self._ends[self._own[self._ends]]
        begins, begun_as = self._began

        def made(kind: PieceKind, place: I64, start: I64, size: I64, behind: I64) -> Pieces:
            kinds = np.full(len(place), int(kind))
            return Pieces(
                whole.stream[place], kinds, start, size, order[place], self._latest[place], behind % WRAP,
                acknowledged[place],
            )  # fmt: skip

        pieces = made(PieceKind.DATA, data, (whole.payload + skipped)[data], size[data], last[data])
        if not (len(begins) or len(ends)):
            return pieces
        nothing = np.zeros(max(len(begins), len(ends)), np.int64)
        return Pieces.stacked([
            made(PieceKind.BEGIN, begins, nothing[: len(begins)], begun_as, first[begins]), pieces,
            made(PieceKind.END, ends, nothing[: len(ends)], nothing[: len(ends)], last[ends] + 1),
        ])  # fmt: skip

    def again(self) -> I64:
        """Return what comes again in segments that were taken: a row each, with the columns of ``Again``."""
        whole = self._whole
        back = self._before - self._along - self._syn
        asks = (back == 1) & (whole.payload_bytes == 1)
        late = np.flatnonzero(self._own & (back > 0) & (whole.payload_bytes > 0) & ~asks)
        size = np.minimum(whole.payload_bytes[late], back[late])
        captured = whole.captured_bytes[late]
        order = whole.frame[late] << ORDER_BITS | int(Order.OWN)
        columns = whole.stream[late], order, back[late], whole.payload[late], size, captured
        return np.stack(columns, axis=1)

    def _note_had(self, told: Bool, start: I64, stop: I64) -> None:
        """Note up to where the receivers of streams have them, by some stretches of rows, as far as these tell it."""
        place = spans(start, stop - start)
        place = place[told[place] & (self._rows.acknowledgement[place] > 0)]
        self._note_acknowledged(self._streams.had, self._rows.stream[place] ^ 1, self._rows.acknowledgement[place])

    @staticmethod
    def _note_acknowledged(highest: I64, stream: I64, told: I64) -> None:
        """Note what the receivers of streams acknowledge, all of one stream together, in its ``highest`` one."""
        start, stop = runs_of(stream)
        if not len(start):
            return
        known = highest[stream[start]]
        first = np.where(known < 0, told[start], known)
        ahead = (told - np.repeat(first, stop - start) + HALF) % WRAP - HALF
        most = np.maximum(np.maximum.reduceat(ahead, start), 0)
        highest[stream[start]] = (first + most) % WRAP

    @staticmethod
    def _note_acknowledged_of(highest: I64, stream: int, told: I64) -> None:
        """Note what the receiver of one stream acknowledges."""
        if len(told):
            known = int(highest[stream])
            first = known if known >= 0 else int(told[0])
            most = max(int(((told - first + HALF) % WRAP).max()) - HALF, 0)
            highest[stream] = (first + most) % WRAP
