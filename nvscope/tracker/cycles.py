"""Cycles: which telegrams of a list over several SubIndexes were sent together, and how many of them came.

Telegrams of one sender and list belong to one cycle where they carry the same Counter, or follow each other within half
an interval with rising SubIndexes (for senders that count otherwise). A cycle is counted when the next one begins, if
the intervals of all streams of its sender and list were known when it began: before, nobody sees all of its telegrams.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from dissectors.batch import I64, U16, U64, Bool
from dissectors.keys import KeyTable
from nvscope.engine.dealing import Share
from nvscope.engine.events import EventBatch
from nvscope.engine.keys import Keys
from nvscope.engine.rows import DataRows
from nvscope.engine.runs import distinct, runs_of, spans, stable_order
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.tracker.cycle_columns import NEVER, PairColumns, StreamPairs
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.events import EventLog
from nvscope.tracker.whole_cycles import Over, PairCounts, StreamCounts, count_cycles, end_counting

AnyColumn = TypeVar("AnyColumn", I64, U16)

KNOWN_BIT = 32
_PACKET_BITS = 40
_LAST_BIT = 62


class Cycles:
    """The cycles of all senders' lists over several SubIndexes.

    ``events`` is keyed by the pair and, in one word, the streams that it had (from ``KNOWN_BIT`` on; 0 of what has no
    counter) and the telegrams in the cycle. ``pair_counts`` and ``stream_counts`` are those of whole cycles. ``over``
    are those that the last batch has ended.
    """

    def __init__(self) -> None:
        self.pairs = KeyTable()
        self.columns = PairColumns()
        self.streams = StreamPairs()
        self.events = EventLog()
        self.pair_counts = PairCounts()
        self.stream_counts = StreamCounts()
        self.over: Over | None = None

    def observe(
        self, told: Told, rows: DataRows, counter: U16 | None, usual: Bool, interval_ns: I64,
        several: Bool | None = None,
    ) -> None:  # fmt: skip
        """Take a batch; ``usual`` are the rows of streams whose interval is known, ``interval_ns`` theirs by stream.

        ``counter`` is None for what has none; then a cycle is told by time and SubIndex alone, and the first one counts
        only from its first SubIndex on, since the capture may have begun within it. ``several`` (by stream) are those
        of lists that are known to have several SubIndexes, whether these are sent or not.
        """
        keys, first_frame = told.keys, told.first_frame
        self._number(rows, keys, first_frame, several)
        self._learn(rows, usual, first_frame)
        self.over = over = self._over(told, rows, counter, usual, interval_ns)
        if counter is not None:
            frame = rows.packet[rows.stop - 1] + first_frame
            count_cycles(
                self.pair_counts, self.stream_counts, self.streams.column("pair"), over, rows.run_stream, frame
            )

    def _over(self, told: Told, rows: DataRows, counter: U16 | None, usual: Bool, interval_ns: I64) -> Over | None:
        """Return the cycles that are over."""
        columns, first_frame = self.columns, told.first_frame
        if not (columns.column("streams") > 1).any():
            return None
        run_pair = self.streams.pair[rows.run_stream]
        length = rows.stop - rows.start
        taken = np.repeat((run_pair >= 0) & (columns.streams[run_pair] > 1), length) & usual
        active_from = columns.active_from[run_pair]
        if ((active_from > first_frame) & (active_from < NEVER)).any():
            taken &= rows.packet + first_frame >= np.repeat(active_from, length)
        row = np.flatnonzero(taken)
        if not len(row):
            return None
        stream, packet = rows.stream.take(row), rows.packet.take(row)
        # The rows of each stream are in order already: a sort that merges has little to do.
        order = np.argsort(self.streams.pair.take(stream) << _PACKET_BITS | packet, kind="stable")
        # What a stream tells is looked up again, in tables that are small, rather than put in order.
        row, stream = row.take(order), stream.take(order)
        pair, half_ns = self.streams.pair.take(stream), (interval_ns // 2).take(stream)
        subindex = self.streams.subindex.take(stream)
        start, stop = runs_of(pair)
        counter = None if counter is None else counter.take(row)
        frame = packet.take(order)
        frame += first_frame
        return self._cut(told, pair, start, stop, subindex, counter, rows.time_ns.take(row), half_ns, frame)

    def take(self, part: Cycles, share: Share) -> None:
        """Take over the cycles of a part's share of the senders."""
        number = self.columns.take_keyed(self.pairs, part.columns, part.pairs.words)
        self.pair_counts.resize(len(self.pairs))
        self.pair_counts.put(number, part.pair_counts)
        self.streams.take(part.streams, share.streams)
        self.stream_counts.take(part.stream_counts, share.streams)
        stream = share.streams[share.streams < len(part.streams)]
        known = stream[part.streams.pair[stream] >= 0]
        self.streams.pair[known] = number[part.streams.pair[known]]
        pair, size = part.events.keys.words
        self.events.take(part.events, number[pair.astype(np.int64)].astype(np.uint64), size)

    def resume(self, unheard: Unheard) -> None:
        """Leave open what is open of the unheard, for it is no cycle; others count once all streams are there again.

        A capture may end, and begin, inside a cycle.
        """
        pair = self._forget_open(unheard)
        if not len(pair):
            return
        self.columns.ready[pair] = 0
        self.columns.ready_from[pair] = 0
        stream = np.flatnonzero(np.isin(self.streams.column("pair"), pair))
        self.streams.ready_from[stream] = NEVER
        end_counting(self.pair_counts, self.stream_counts, stream, self.streams.pair[stream])

    def _forget_open(self, unheard: Unheard) -> I64:
        """Forget the open cycles of the unheard; return the pairs concerned."""
        pair = distinct(self.streams.pair[self.streams.own_rows(unheard.streams)])
        pair = pair[pair >= 0]
        self.columns.size[pair] = 0
        return pair

    def _number(self, rows: DataRows, keys: Keys, first_frame: int, several: Bool | None) -> None:
        """Number the pairs of new streams, and note from when on a pair has several."""
        known = len(self.streams)
        if len(keys.streams) == known:
            return
        new = np.arange(known, len(keys.streams))
        # Streams that these rows have nothing of are of another transport.
        new = new[np.isin(new, rows.run_stream)]
        place = keys.place_of(new)
        self.streams.resize(len(keys.streams))
        self.streams.pair[new] = self.pairs.numbers(keys.places.high[place], keys.streams.low[new])
        columns = self.columns
        columns.resize(len(self.pairs))
        self.pair_counts.resize(len(self.pairs))
        self.stream_counts.resize(len(keys.streams))
        # New streams are numbered in the order of their first telegrams.
        first = rows.packet[rows.start[np.searchsorted(rows.run_stream, new)]] + first_frame
        self.streams.first_frame[new] = first
        self.streams.subindex[new] = keys.places.low[place].astype(np.int64)
        pair = self.streams.pair[new]
        np.add.at(columns.seen, pair, 1)
        np.bitwise_or.at(columns.known, pair, _bit_of(self.streams.subindex[new]))
        np.maximum.at(columns.known_from, pair, first)
        if several is None or not several[new].any():
            order = stable_order(pair, len(self.pairs))
            of_pair = pair[order]
            start, stop = runs_of(of_pair)
            before = columns.streams[of_pair] + np.arange(len(order)) - np.repeat(start, stop - start)
            columns.active_from[of_pair[before == 1]] = first[order][before == 1]
            np.add.at(columns.streams, pair, 1)
            return
        for stream, own, frame in zip(new.tolist(), pair.tolist(), first.tolist(), strict=True):
            columns.streams[own] += 1
            if several[stream]:
                columns.streams[own] = max(columns.streams[own], 2)
                columns.active_from[own] = 0
            elif columns.streams[own] == 2:
                columns.active_from[own] = frame

    def _learn(self, rows: DataRows, usual: Bool, first_frame: int) -> None:
        """Note from when on the intervals of streams are known."""
        streams, columns = self.streams, self.columns
        waiting = np.flatnonzero(streams.ready_from[rows.run_stream] == NEVER)
        known = np.append(np.flatnonzero(usual), len(rows))
        first = known[np.searchsorted(known, rows.start[waiting])]
        ready = first < rows.stop[waiting]
        stream, frame = rows.run_stream[waiting[ready]], rows.packet[first[ready]] + first_frame
        pair = streams.pair[stream]
        streams.ready_from[stream] = frame
        np.add.at(columns.ready, pair, 1)
        np.maximum.at(columns.ready_from, pair, frame)

    def _cut(
        self, told: Told, pair: I64, start: I64, stop: I64, subindex: I64, counter: U16 | None, time_ns: I64,
        half_ns: I64, frame: I64,
    ) -> Over:  # fmt: skip
        """Cut the telegrams of each pair into cycles; count those that are over, and return them."""
        columns = self.columns
        run = pair[start]
        before_subindex = _before(subindex, start, columns.subindex[run])
        rises = subindex > before_subindex
        close = time_ns - _before(time_ns, start, columns.last_ns[run]) <= half_ns
        same = rises & close
        if counter is not None:
            together = rises | (close & (subindex != before_subindex))
            same = np.where(counter == _before(counter, start, columns.counter[run]), together, same)
        begins = ~same
        # A cycle that is open from before goes on in front of the first one that begins here.
        first_of_pair = columns.size[run] == 0
        begins[start[first_of_pair]] = True
        goes_on = ~begins[start]
        # Sizes and ends of all pieces: one a beginning, and one a run that goes on.
        edges = begins.copy()
        edges[start] = True
        piece_start = np.flatnonzero(edges)
        piece_stop = np.append(piece_start[1:], len(pair))
        piece_pair = pair[piece_start]
        size = piece_stop - piece_start
        begin_ns, begin_frame = time_ns[piece_start], frame[piece_start]
        carried = np.searchsorted(piece_start, start[goes_on])
        size[carried] += columns.size[run[goes_on]]
        begin_ns[carried] = columns.begin_ns[run[goes_on]]
        begin_frame[carried] = columns.begin_frame[run[goes_on]]
        last_piece = np.append(piece_pair[1:] != piece_pair[:-1], True)
        skew = time_ns[piece_stop - 1] - begin_ns
        # What was open before a run that does not go on is over with the run's first telegram.
        closed = np.flatnonzero(~goes_on & ~first_of_pair)
        over = np.flatnonzero(~last_piece)
        over_pair = np.concatenate([run[closed], piece_pair[over]])
        over_size = np.concatenate([columns.size[run[closed]], size[over]])
        over_ns = np.concatenate([columns.begin_ns[run[closed]], begin_ns[over]])
        over_frame = np.concatenate([columns.begin_frame[run[closed]], begin_frame[over]])
        over_skew = np.concatenate([columns.last_ns[run[closed]] - columns.begin_ns[run[closed]], skew[over]])
        over_end = np.concatenate([columns.last_frame[run[closed]], frame[piece_stop[over] - 1]])
        partial = np.zeros(len(piece_start), np.bool_)
        if counter is None:
            opens = np.searchsorted(piece_start, start[first_of_pair])
            partial[opens] = subindex[start[first_of_pair]] > 0
            partial[carried] = columns.partial[run[goes_on]]
        known = self._known_streams(over_pair, over_frame)
        counts = ~np.concatenate([columns.partial[run[closed]], partial[over]]) & (known > 0)
        over_pair, over_size, over_skew, known = (part[counts] for part in (over_pair, over_size, over_skew, known))
        kind = over_size if counter is None else known << KNOWN_BIT | over_size
        self.events.record(over_ns[counts], over_frame[counts], over_pair.astype(np.uint64), kind.astype(np.uint64))
        self.events.settle()
        np.maximum.at(columns.skew_ns, over_pair, over_skew)
        open_piece = np.flatnonzero(last_piece)
        if told.is_heard:
            # Most cycles are whole: of these, nobody asks which SubIndexes they have.
            torn = np.flatnonzero(over_size < columns.streams[over_pair])
            of_torn = np.flatnonzero(counts)[torn] - len(closed)
            of_pieces = over[of_torn[of_torn >= 0]]
            present = _bits_within(subindex, piece_start, piece_stop, np.append(of_pieces, open_piece))
            present[carried] |= columns.present[run[goes_on]]
            torn_present = np.concatenate([columns.present[run[closed]], present[over]])[counts][torn]
            torn_ns, torn_frame = over_ns[counts][torn], over_frame[counts][torn]
            self._tell_torn(
                told, over_pair[torn], over_size[torn], torn_ns, over_skew[torn], torn_frame, torn_present
            )  # fmt: skip
            columns.present[run] = present[open_piece]
        columns.size[run], columns.begin_ns[run] = size[open_piece], begin_ns[open_piece]
        columns.begin_frame[run], columns.partial[run] = begin_frame[open_piece], partial[open_piece]
        columns.subindex[run] = subindex[stop - 1]
        if counter is not None:
            columns.counter[run] = counter[stop - 1]
        columns.last_ns[run], columns.last_frame[run] = time_ns[stop - 1], frame[stop - 1]
        return Over(
            over_pair, over_size, over_ns[counts], over_end[counts], known, over_frame[counts], over_skew
        )  # fmt: skip

    def _known_streams(self, pair: I64, frame: I64) -> I64:
        """Return how many streams pairs had at some frames; 0 where the interval of one of these was not known then."""
        columns = self.columns
        known = columns.seen[pair]
        early = np.flatnonzero((columns.ready[pair] < known) | (frame < columns.ready_from[pair]))
        pair_of = self.streams.column("pair")
        for number in distinct(pair[early]).tolist():
            own, stream = early[pair[early] == number], np.flatnonzero(pair_of == number)
            seen, ready = (
                np.searchsorted(np.sort(column[stream]), frame[own], "right")
                for column in (self.streams.first_frame, self.streams.ready_from)
            )
            known[own] = np.where(seen == ready, seen, 0)
        return known

    def _tell_torn(
        self, told: Told, pair: I64, size: I64, begin_ns: I64, skew_ns: I64, frame: I64, present: U64
    ) -> None:  # fmt: skip
        """Tell of those cycles that have fewer telegrams than SubIndexes were known when they began."""
        if not len(pair):
            return
        known, several = self._known(pair, frame)
        torn = np.flatnonzero(size < several)
        torn = torn[np.argsort(frame[torn], kind="stable")]
        absent = known[torn] & ~present[torn]
        pair, begin_ns = pair[torn], begin_ns[torn]
        lists, node = self.pairs.high[pair].astype(np.int64), self.pairs.low[pair].astype(np.int64)
        told.tell(
            EventBatch.of(
                EventKind.TORN_CYCLE, begin_ns + skew_ns[torn], frame[torn], lists=lists, node=node,
                since_ns=begin_ns, amount=size[torn], detail=absent.view(np.int64),
            )
        )  # fmt: skip

    def _known(self, pair: I64, frame: I64) -> tuple[U64, I64]:
        """Return the bits of the SubIndexes that pairs had sent up to some frames, and how many they must have."""
        # Once all streams of a pair have come, there is nothing to look up.
        bits, count = self.columns.known[pair], self.columns.seen[pair]
        pair_of, early = self.streams.column("pair"), np.flatnonzero(frame < self.columns.known_from[pair])
        for number in distinct(pair[early]).tolist():
            own, stream = early[pair[early] == number], np.flatnonzero(pair_of == number)
            first = self.streams.first_frame[stream]
            order = np.argsort(first, kind="stable")
            count[own] = np.searchsorted(first[order], frame[own], "right")
            known = np.bitwise_or.accumulate(_bit_of(self.streams.subindex[stream[order]]))
            bits[own] = np.append(np.uint64(0), known)[count[own]]
        # Of some lists a definition says that they have several, whatever was seen.
        return bits, np.maximum(count, np.where(self.columns.active_from[pair] == 0, 2, 0))


def _bit_of(subindex: I64) -> U64:
    """Return the bit of each SubIndex; those from 62 on share one, so that bits are a number that is not negative."""
    bits: U64 = np.uint64(1) << np.minimum(subindex, _LAST_BIT).astype(np.uint64)
    return bits


def _bits_within(subindex: I64, start: I64, stop: I64, some: I64) -> U64:
    """Return the bits of the SubIndexes in some of the pieces from ``start`` to ``stop``, 0 of the others."""
    bits = np.zeros(len(start), np.uint64)
    if len(some):
        length = stop[some] - start[some]
        within = subindex[spans(start[some], length)]
        bits[some] = np.bitwise_or.reduceat(_bit_of(within), np.cumsum(length) - length)
    return bits


def _before(column: AnyColumn, start: I64, kept: AnyColumn) -> AnyColumn:
    """Return what stood before each row: in the row above, at the starts of runs what was ``kept``."""
    before = np.empty_like(column)
    before[1:] = column[:-1]
    before[start] = kept
    return before
