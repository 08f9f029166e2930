"""Segments at once: put in order as columns, as far as nothing is missing, late, or begins anew.

All segments of a batch are laid along their streams as if nothing were peculiar. That counts for those in front of the
first peculiar one of a connection, and again behind it, once the connection is where it would have been without.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.headers import ACK, FIN, RST, SYN
from nvscope.engine.runs import runs_of, spans
from nvscope.tracker.pieces import ANEW, IN_STEP, NEVER, ORDER_BITS, Order, PieceKind, Pieces
from nvscope.tracker.segments import FAR, HALF, WRAP, Segments, StreamColumns
from nvscope.tracker.segments_aside import NEAR
from nvscope.tracker.segments_in_turn import FORGOTTEN_NS

_APART = 1 << 34
_LATE = NEVER - FORGOTTEN_NS


class SegmentsAtOnce:
    """The segments of some connections within some time, along their streams; ``streams`` are the state of all.

    ``is_peculiar`` tells which segments are, ``since`` by connection from which frame on something is, ``NEVER`` where
    nothing is: -1 where something was kept before. A stream's places are counted from where it was.
    """

    def __init__(self, rows: Segments, carrying: Bool, streams: StreamColumns) -> None:
        self._streams = streams
        self._rows = rows
        self._whole = whole = rows if carrying.all() else rows.take(carrying)
        self._start, self._stop = start, _ = runs_of(whole.stream)
        self._stream = stream = whole.stream[start]
        self._first_frame = np.full(len(streams), NEVER)
        self._first_frame[stream] = whole.frame[start]
        self._syn, self._fin = (whole.flags & SYN) >> 1, whole.flags & FIN
        self._base = np.where(streams.begun[stream], streams.next[stream], whole.sequence[start])
        told = (whole.flags & ACK > 0) & (whole.acknowledgement > 0)
        self._acknowledgement = np.where(told, whole.acknowledgement, -1)
        self._earlier = streams.copied("begun", "first", "next", "ahead")
        self._own = np.zeros(len(whole), np.bool_)
        self._began = np.empty((2, 0), np.int64)
        peculiar = self._lay_along()
        peculiar |= whole.captured_bytes < whole.payload_bytes
        self._mark_behind_ends(peculiar)
        self._mark_begins(peculiar)
        brings = self._rises & ((whole.payload_bytes > 0) | (self._fin > 0))
        self._brought_ns = np.where(brings, whole.time_ns, 0)
        self._latest = self._latest_of_all()
        self.is_peculiar = (rows.flags & RST) != 0
        if peculiar.any():
            self.is_peculiar[np.flatnonzero(carrying)[peculiar]] = True
        self._runs = (start, self._stop) if whole is rows else runs_of(rows.stream)
        self._place_of = None if whole is rows else np.flatnonzero(carrying)
        self._acknowledges = (rows.flags & ACK) != 0
        self._renewing = self._all_renewing(told)
        self._mark_ahead(carrying)
        self._mark_far()
        self._mark_forgotten()
        self.since = self._since()

    def _lay_along(self) -> Bool:
        """Find out where segments lie along their streams; return in front of which something is missing."""
        whole, start = self._whole, self._start
        step = np.empty(len(whole), np.int64)
        step[1:] = np.diff(whole.sequence)
        step[start] = whole.sequence[start] - self._base
        step = (step + HALF) % WRAP - HALF
        length = self._stop - start
        along = np.cumsum(step)
        along -= np.repeat(along[start] - step[start], length)
        far: Bool = (np.abs(step) >= FAR) | (np.abs(along) >= FAR)
        end = np.clip(along, -FAR, FAR) + self._syn + whole.payload_bytes + self._fin
        apart = np.repeat(np.arange(len(start)) * _APART, length)
        top = np.maximum.accumulate(np.maximum(end, 0) + apart) - apart
        before = np.empty(len(whole), np.int64)
        before[1:] = top[:-1]
        before[start] = 0
        self._along, self._end, self._top, self._before = along, end, top, before
        self._rises = end > before
        # The last one up to each that brings something, wherever that is.
        self._risen = np.maximum.accumulate(np.where(self._rises, np.arange(len(whole)), -1))
        far |= along > before
        if int(along.min(initial=0)) < -NEAR:
            far |= self._are_in_front(length)
        return far

    def _are_in_front(self, length: I64) -> Bool:
        """Tell what is in front of where its stream has begun (``segments_aside.is_in_front``)."""
        streams, stream = self._streams, self._stream
        first = np.where(streams.begun[stream], streams.first[stream], self._base)
        gone = (self._base - first) % WRAP
        least = np.where(gone <= FAR, -gone - NEAR, -HALF)
        return self._along < np.repeat(least, length)

    def _mark_behind_ends(self, peculiar: Bool) -> None:
        """Mark what comes behind the end of a stream."""
        start, stop, rises = self._start, self._stop, self._rises
        beyond = self._streams.ended[self._stream] & (self._top[stop - 1] > 0)
        if beyond.any():
            peculiar |= rises & np.repeat(beyond, stop - start)
        self._ends = ends = np.flatnonzero((self._fin > 0) & rises)
        run = np.searchsorted(start, ends, side="right") - 1
        early = self._end[ends] < self._top[stop[run] - 1]
        if early.any():
            ends, run = ends[early], run[early]
            rising = np.flatnonzero(rises)
            peculiar[rising[np.searchsorted(rising, ends, side="right")]] = True

    def _mark_forgotten(self) -> None:
        """Mark what comes long after its connection has ended, be it among these segments."""
        streams, rows = self._streams, self._rows
        end_ns = np.where(streams.column("ended"), streams.column("latest_ns"), _LATE)
        # Assigned backwards, so that the first end of a stream is what stays.
        ends = self._ends[::-1]
        end_ns[self._whole.stream[ends]] = self._latest[ends]
        end_ns = np.maximum(end_ns[0::2], end_ns[1::2])
        if int(end_ns.min()) < int(rows.time_ns.max()) - FORGOTTEN_NS:
            self.is_peculiar |= rows.time_ns > end_ns[rows.stream >> 1] + FORGOTTEN_NS

    def _mark_begins(self, peculiar: Bool) -> None:
        """Mark each SYN that is not the first thing of its connection, or its answer."""
        streams, syn = self._streams, np.flatnonzero(self._syn)
        stream, flags, frame = (column[syn] for column in (self._whole.stream, self._whole.flags, self._whole.frame))
        is_first = (frame == self._first_frame[stream]) & ~streams.begun[stream]
        answers = (flags & ACK) != 0
        by_server = (stream & 1) == 1
        alone = ~streams.begun[stream ^ 1] & (self._first_frame[stream ^ 1] > frame)
        peculiar[syn[~(is_first & (by_server == answers) & (answers | alone))]] = True

    def _all_renewing(self, told: Bool) -> I64:
        """Return the segments that tell anew up to where their sender has the other stream (``had``)."""
        tells = self._rises & told
        ahead = self._streams.ahead[self._stream]
        if int(ahead.max(initial=-1)) >= 0:
            ahead, further = (np.repeat(one, self._stop - self._start) for one in (ahead, ahead - self._base))
            tells &= (ahead < 0) | ((further - self._end) % WRAP > NEAR)
        # What a stream begins with, in the middle of it, was not sent later than something.
        tells[self._start[~self._streams.begun[self._stream]]] = False
        return np.flatnonzero(tells)

    def _renewed(self, last: I64) -> I64:
        """Return the last segment up to each of some that tells anew how far something is had, -1 without any."""
        place = self._renewing.searchsorted(last, side="right") - 1
        return np.where(place >= 0, self._renewing[place], -1) if len(self._renewing) else np.full(len(last), -1)

    def _mark_ahead(self, carrying: Bool) -> None:
        """Mark what brings nothing where its stream is not yet, or not any more."""
        rows, whole, streams = self._rows, self._whole, self._streams
        if self._place_of is None:
            return
        place = np.flatnonzero(~(carrying | self.is_peculiar))
        stream = rows.stream[place]
        at = np.where(streams.first[stream] >= 0, streams.next[stream], -1)
        if len(whole):
            last = np.maximum(np.cumsum(carrying)[place] - 1, 0)
            own = (whole.stream[last] == stream) & (whole.frame[last] < rows.frame[place])
            run = np.searchsorted(self._stream, stream[own])
            at[own] = self._base[run] + self._top[last[own]]
        ahead = streams.ahead[stream]
        if int(ahead.max(initial=-1)) >= 0:
            at = np.where((ahead >= 0) & ((at < 0) | ((ahead - at) % WRAP <= NEAR)), ahead, at)
        peculiar = (rows.sequence[place] - at + NEAR) % WRAP > NEAR
        unknown = np.flatnonzero(at < 0)
        if len(unknown):
            # What comes before a connection is nobody's.
            connection = stream[unknown] & ~1
            first = np.minimum(self._first_frame[connection], self._first_frame[connection + 1])
            is_known = streams.begun[connection] | streams.begun[connection + 1]
            peculiar[unknown] = is_known | (rows.frame[place[unknown]] >= first)
        self.is_peculiar[place[peculiar]] = True

    def _mark_far(self) -> None:
        """Mark what acknowledges bytes that may be far from where a stream is."""
        rows, streams = self._rows, self._streams
        at = np.where(streams.column("first") >= 0, streams.column("next"), -1)
        at[self._stream] = self._base
        start, stop = self._runs
        of = at[rows.stream[start] ^ 1]
        away = rows.acknowledgement - np.repeat(of - FAR // 2, stop - start)
        away &= WRAP - 1
        far = away > FAR
        if far.any():
            self.is_peculiar |= far & np.repeat(of >= 0, stop - start) & self._acknowledges & (rows.acknowledgement > 0)

    def _since(self) -> I64:
        waits = self._streams.column("waits")
        since = np.where(waits[0::2] | waits[1::2], -1, NEVER)
        place = np.flatnonzero(self.is_peculiar)
        np.minimum.at(since, self._rows.stream[place] >> 1, self._rows.frame[place])
        return since

    def _latest_of_all(self) -> I64:
        """Return the latest time of what streams bring, up to each of their segments; 0 is the time of no such one."""
        time_ns, start, stop, streams = self._brought_ns, self._start, self._stop, self._streams
        known = np.where(streams.begun[self._stream], streams.latest_ns[self._stream], 0)
        falls = np.zeros(len(time_ns), np.bool_)
        falls[1:] = time_ns[1:] < time_ns[:-1]
        falls[start] = time_ns[start] < known
        latest = time_ns.copy()
        runs = np.searchsorted(start, np.flatnonzero(falls), side="right") - 1
        for run in sorted(set(runs.tolist())):
            own = slice(int(start[run]), int(stop[run]))
            latest[own] = np.maximum(np.maximum.accumulate(time_ns[own]), known[run])
        return latest

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
        return True

    def take_between(self, segments: Segments, start: int, stop: int) -> None:
        """Take some segments of a connection that fits, by frame, among which nothing is peculiar."""
        streams, part = self._streams, slice(start, stop)
        connection = int(segments.stream[start]) >> 1
        told, frame = segments.acknowledgement[part], segments.frame[part]
        tells = (segments.flags[part] & ACK) != 0
        by_server = (segments.stream[part] & 1) == 1
        for stream, telling in ((2 * connection, tells & by_server), (2 * connection + 1, tells & ~by_server)):
            own = telling.nonzero()[0]
            self._note_acknowledged_of(streams.acknowledged, stream, told[own])
            renewed = self._renewed_of(stream ^ 1, int(frame[0]), int(frame[-1]))
            if renewed >= 0:
                streams.had[stream] = -1
                own = own[frame[own].searchsorted(renewed) :]
            self._note_acknowledged_of(streams.had, stream, told[own][told[own] > 0])
        first, last = int(segments.frame[start]), int(segments.frame[stop - 1])
        for number, run in self._runs_of(connection):
            start, stop = self._place(run, first), self._place(run, last + 1)
            if start == stop:
                continue
            span = slice(start, stop)
            self._own[span] = True
            latest = self._latest[span]
            np.maximum(self._brought_ns[span], streams.latest_ns[number], out=latest)
            np.maximum.accumulate(latest, out=latest)
            streams.latest_ns[number] = self._latest[stop - 1]
            streams.next[number] = (self._base[run] + self._top[stop - 1]) % WRAP
            if (risen := int(self._risen[stop - 1])) >= start:
                streams.told[number] = self._acknowledgement[risen]
            streams.ended[number] = ((self._fin[span] > 0) & self._rises[span]).any()

    def _renewed_of(self, stream: int, first: int, last: int) -> int:
        """Return the last frame of some in which a stream tells anew how far the other one is had, -1 without any."""
        run = int(self._stream.searchsorted(stream))
        if run == len(self._stream) or self._stream[run] != stream:
            return -1
        place = int(self._renewing.searchsorted(self._place(run, last + 1))) - 1
        if place < 0 or self._renewing[place] < self._start[run]:
            return -1
        frame = int(self._whole.frame[self._renewing[place]])
        return frame if frame >= first else -1

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
        columns = whole.stream[late], whole.frame[late], back[late], whole.payload[late], size, captured
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
