"""Segments along their streams: where they lie if nothing is peculiar, and which are.

Peculiar is in front of which something is missing, what comes behind the end of a stream, or begins one anew, or lies
far from where its stream is, and what comes in another order than it was sent in.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.headers import ACK, FIN, RST, SYN
from nvscope.engine.runs import runs_of
from nvscope.tracker.pieces import NEVER
from nvscope.tracker.segments import FAR, HALF, WRAP, Segments, StreamColumns
from nvscope.tracker.segments_aside import NEAR
from nvscope.tracker.segments_in_turn import FORGOTTEN_NS

_APART = 1 << 34
_LATE = NEVER - FORGOTTEN_NS


class SegmentsAlong:
    """The segments of some connections within some time, along their streams; ``streams`` are the state of all.

    ``is_peculiar`` tells which segments are, ``since`` by connection from which frame on something is, ``NEVER`` where
    nothing is: -1 where something was kept before. A stream's places are counted from where it was.
    """

    def __init__(
        self, rows: Segments, carrying: Bool, streams: StreamColumns, opened_late: int = NEVER
    ) -> None:  # fmt: skip
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
        self._earlier = streams.copied("begun", "first", "next", "ahead", "disordered")
        peculiar = self._lay_along()
        peculiar |= whole.captured_bytes < whole.payload_bytes
        self._mark_behind_ends(peculiar)
        self._mark_begins(peculiar)
        self._brings = self._rises & ((whole.payload_bytes > 0) | (self._fin > 0))
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
        self._mark_disordered(opened_late)
        if opened_late != NEVER:
            self._mark_alone(opened_late)
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

    def _mark_disordered(self, opened_late: int) -> None:
        """Mark what comes behind its acknowledgement, and, where that is known to happen, what acknowledges that."""
        whole, streams, start = self._whole, self._streams, self._start
        if not len(whole):
            return
        rows, tells = self._rows, self._acknowledges & (self._rows.acknowledgement > 0)
        is_new = np.empty(len(rows), np.bool_)
        np.not_equal(rows.acknowledgement[1:], rows.acknowledgement[:-1], out=is_new[1:])
        is_new[self._runs[0]] = True
        early, place, acknowledged = self._ahead_of_all(np.flatnonzero(is_new & tells))
        rising = np.flatnonzero(self._rises)
        # Of what was acknowledged before, only the first that a stream brings may be acknowledged.
        owed = (streams.had[self._stream] - self._base) % WRAP
        owing = np.flatnonzero((streams.had[self._stream] >= 0) & (owed > 0) & (owed <= NEAR))
        place, acknowledged = np.append(place, start[owing]), np.append(acknowledged, streams.had[self._stream[owing]])
        if not len(place) and not len(early):
            return
        following = rising.searchsorted(place)
        is_there = following < len(rising)
        row, acknowledged, place = rising[following[is_there]], acknowledged[is_there], place[is_there]
        run = start.searchsorted(row, side="right") - 1
        end = self._base[run] + self._end[row]
        is_late = (start[run] <= place) & ((acknowledged - end) % WRAP <= NEAR)
        row = row[is_late]
        self.is_peculiar[row if self._place_of is None else self._place_of[row]] = True
        disordered = self._earlier.disordered
        disordered[whole.stream[row]] = disordered[whole.stream[row] ^ 1] = True
        if opened_late == NEVER and not disordered.any():
            return
        # Who tells again what is not there yet is still too early.
        may_wait = disordered[rows.stream] | (rows.frame > opened_late)
        early, _, _ = self._ahead_of_all(np.flatnonzero(may_wait & tells))
        self.is_peculiar[early] = True

    def _mark_alone(self, since: int) -> None:
        """Mark what acknowledges something behind a frame, of whose other direction nothing has come before."""
        rows, partner = self._rows, self._rows.stream ^ 1
        alone = ~self._streams.begun[partner] & (self._first_frame[partner] > rows.frame) & (rows.frame > since)
        self.is_peculiar |= alone & self._acknowledges & (rows.acknowledgement > 0)

    def _ahead_of_all(self, told: I64) -> tuple[I64, I64, I64]:
        """Return which of some segments acknowledge what is not there yet.

        And where the streams of that go on, of those among these segments, with what is acknowledged.
        """
        rows, whole, streams, start = self._rows, self._whole, self._streams, self._start
        partner = rows.stream[told] ^ 1
        run = self._stream.searchsorted(partner)
        run[run == len(self._stream)] = 0
        is_here = self._stream[run] == partner
        first, span = int(rows.frame.min()), int(rows.frame.max()) - int(rows.frame.min()) + 1
        at = np.repeat(np.arange(len(start)) * span - first, self._stop - start) + whole.frame
        place = at.searchsorted(run * span + rows.frame[told] - first)
        sent = self._base[run]
        behind = np.flatnonzero(is_here & (place > start[run]))
        sent[behind] += self._top[place[behind] - 1]
        elsewhere = np.flatnonzero(~is_here)
        sent[elsewhere] = streams.next[partner[elsewhere]]
        is_known = is_here
        is_known[elsewhere] = streams.begun[partner[elsewhere]]
        acknowledged = rows.acknowledgement[told]
        ahead = (acknowledged - sent) % WRAP
        found = is_known & (ahead > 0) & (ahead <= NEAR)
        early = told[found]
        found[elsewhere] = False
        return early, place[found], acknowledged[found]

    def _since(self) -> I64:
        waits = self._streams.column("waits")
        since = np.where(waits[0::2] | waits[1::2], -1, NEVER)
        place = np.flatnonzero(self.is_peculiar)
        np.minimum.at(since, self._rows.stream[place] >> 1, self._rows.frame[place])
        return since

    def _latest_of_all(self) -> I64:
        """Return the time of the last one up to each segment that brings something; 0 is that of no such one."""
        latest, start = self._whole.time_ns, self._start
        others = np.flatnonzero(~self._brings)
        if not len(others):
            return latest
        latest = latest.copy()
        known = np.where(self._streams.begun[self._stream], self._streams.latest_ns[self._stream], 0)
        bringing = np.flatnonzero(self._brings)
        last = bringing.searchsorted(others) - 1
        run = start.searchsorted(others, side="right") - 1
        own = (last >= 0) & (bringing[last] >= start[run]) if len(bringing) else np.zeros(len(others), np.bool_)
        latest[others] = known[run]
        latest[others[own]] = self._whole.time_ns[bringing[last[own]]]
        return latest
