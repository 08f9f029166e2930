"""Intervals between the telegrams of each stream: sums, extremes and a logarithmic histogram, all in integers.

An interval's bucket is the upper part of its binary floating-point number: 128 buckets for each doubling, so that the
middle of a bucket is within 0.4 % of all that is in it. Nearly all intervals of a stream lie near one value; these have
a dense row of counters, from three quarters of the median of the stream's first intervals to one and a half of it. The
others are kept as events, with time, frames and whether telegrams were lost in them; an interval with a loss in it is
longer than that. Late telegrams and bursts are told by these. Of the usual ones the first ten have their frames kept
too: where a stream is always late, they are the events.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U64, Bool
from nvscope.engine.dealing import Share
from nvscope.engine.events import EventBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import spans
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.tracker.buckets import BUCKETS_A_DOUBLING, bucket_of, upper_part
from nvscope.tracker.deviation import deviations, means
from nvscope.tracker.event_kinds import FRAMES_KEPT, EventKind
from nvscope.tracker.events import EventLog
from nvscope.tracker.kept_rows import KeptRows, LossBefore, TimedRows
from nvscope.tracker.node_steps import NodeSteps, NoNodeSteps
from nvscope.tracker.rare import rare_ones
from nvscope.tracker.silences import Silences
from nvscope.tracker.steps import Step, Steps

LEARNED_INTERVALS = 8
"""So many intervals of a stream tell where its dense buckets lie."""

DENSE_BUCKETS = BUCKETS_A_DOUBLING
LONG_BITS = 9
"""An interval is long that takes at least one of 2 ** so many parts of the time since the capture's first frame."""

_RARE = 4  # an unusual interval is rare of which there is one in so many: what is cyclic has fewer of them
_BUCKET_OFFSET = 1 << 20
_LIMB_BITS = 23
_LIMB = (1 << _LIMB_BITS) - 1
_LARGE_NS = 1 << (2 * _LIMB_BITS)
_SHORT_NS = 1 << 32

UNUSUAL_STREAM_BIT = 32

NEVER = np.iinfo(np.int64).min


class IntervalColumns(KeyedColumns):
    """One row a stream; ``squares`` are three limbs of 23 bits (the last one wider) of the sum of squares.

    ``last_ns`` is when its last telegram came that was not skipped, ``NEVER`` before the first, and while it is
    unheard; ``last_frame`` is its frame. ``usual_ns`` is the median of the first intervals, 0 before these are known;
    ``unusual`` counts those outside of the dense buckets, as far as somebody listens.
    ``usual_frames`` are the frames that ended the first ``usual_kept`` intervals of the dense buckets, ``usual_keys``
    their keys as in ``Timing.unusual``.
    """

    last_ns: I64
    last_frame: I64
    node_gaps: I64
    count: I64
    total_ns: I64
    least_ns: I64
    most_ns: I64
    squares: I64
    learned: I64
    usual_ns: I64
    unusual: I64
    first_bucket: I64
    dense: I64
    usual_kept: I64
    usual_frames: I64
    usual_keys: I64
    COLUMNS: ClassVar = {
        "last_ns": (np.int64(NEVER), 1),
        "last_frame": (np.int64(0), 1),
        "node_gaps": (np.int64(0), 1),  # of the node's sequence, at the last telegram
        "count": (np.int64(-1), 1),  # of intervals; -1 before the first telegram
        "total_ns": (np.int64(0), 1),
        "least_ns": (np.iinfo(np.int64).max * np.int64(1), 1),
        "most_ns": (np.iinfo(np.int64).min * np.int64(1), 1),
        "squares": (np.int64(0), 3),
        "learned": (np.int64(0), LEARNED_INTERVALS),
        "usual_ns": (np.int64(0), 1),
        "unusual": (np.int64(0), 1),
        "first_bucket": (np.int64(0), 1),
        "dense": (np.int64(0), DENSE_BUCKETS),
        "usual_kept": (np.int64(0), 1),
        "usual_frames": (np.int64(0), FRAMES_KEPT),
        "usual_keys": (np.int64(0), FRAMES_KEPT),
    }


class BatchIntervals(Struct, frozen=True):
    """The intervals of a batch: of which stream, ending when, how long; columns of shape (n,).

    ``usual`` tells of each row of the batch whether it ended one, while the stream's usual interval was known. Those of
    stream ``run[i]`` are ``length[i]`` in a row. ``rows`` are the telegrams of the batch, ``ends`` those that end one.
    """

    usual: Bool
    run: I64
    length: I64
    time_ns: I64
    interval_ns: I64
    rows: TimedRows
    ends: KeptRows

    def __len__(self) -> int:
        return len(self.interval_ns)

    @property
    def stream(self) -> I64:
        return np.repeat(self.run, self.length)

    def packets(self, place: I64) -> I64:
        """Return the packets that end the intervals at some places."""
        packet: I64 = self.rows.packet[self.ends.rows(place)]
        return packet


class Timing:
    """The intervals of all streams.

    ``unusual`` holds the intervals outside of the dense buckets, keyed by one word: the stream from
    ``UNUSUAL_STREAM_BIT`` on, below it ``key_of`` bucket and loss bits. ``silences`` are those at the ends of sources.
    """

    def __init__(self) -> None:
        self.columns = IntervalColumns()
        self.unusual = EventLog(words=1)
        self.large_squares: dict[int, int] = {}
        self.silences = Silences()

    def observe(
        self, told: Told, rows: TimedRows, own: Steps, nodes: NodeSteps | NoNodeSteps
    ) -> BatchIntervals:  # fmt: skip
        """Take the intervals of a batch, of whose telegrams ``own`` and ``nodes`` are the steps."""
        columns = self.columns
        columns.resize(len(told.keys.streams))
        step = own.step[own.irregular]
        skipped = (step == Step.LATE) | (step == Step.OVERTAKEN)
        kept = KeptRows(rows, own.irregular[skipped])
        run, start, last = kept.run, kept.start, kept.stop - 1
        time_ns = np.delete(rows.time_ns, kept.absent) if len(kept.absent) else rows.time_ns
        interval = np.empty_like(time_ns)
        np.subtract(time_ns[1:], time_ns[:-1], out=interval[1:])
        before_ns = columns.last_ns[run]
        interval[start] = time_ns[start] - before_ns
        columns.last_ns[run] = time_ns[last]
        columns.last_frame[run] = rows.packet[kept.rows(last)] + told.first_frame
        loss = LossBefore(kept, own, nodes, columns.node_gaps[run])
        columns.node_gaps[run] = nodes.gaps(kept.rows(last))
        ends = kept
        fresh = before_ns == NEVER
        if fresh.any():
            # The first telegram of a stream ends no interval.
            columns.count[run[fresh]] = np.maximum(columns.count[run[fresh]], 0)
            ends = KeptRows(rows, np.sort(np.append(kept.absent, kept.rows(start[fresh]))))
            interval, time_ns = np.delete(interval, start[fresh]), np.delete(time_ns, start[fresh])
        usual = np.ones(len(rows), np.bool_)
        usual[ends.absent] = False
        if len(interval):
            self._add(interval, ends)
            usual[ends.rows(self._sort_in(told, rows, ends, interval, loss))] = False
        return BatchIntervals(usual, ends.run, ends.stop - ends.start, time_ns, interval, rows, ends)

    def resume(self, unheard: Unheard) -> None:
        """Let no interval go on from the unheard; how long each was silent before is kept, unless that was usual."""
        columns = self.columns
        stream = columns.own_rows(unheard.streams)
        stream = stream[columns.last_ns[stream] != NEVER]
        since_ns, frame = columns.last_ns[stream], columns.last_frame[stream]
        columns.last_ns[stream] = NEVER
        silent = unheard.until_ns - since_ns > columns.usual_ns[stream]
        self.silences.add(stream[silent], since_ns[silent], frame[silent], unheard.until_ns)

    def take(self, part: Timing, share: Share) -> None:
        """Take over the intervals of a part's share of the senders."""
        self.columns.take(part.columns, share.streams)
        self.unusual.take(part.unusual)
        self.silences.take(part.silences)
        self.large_squares |= part.large_squares

    def _add(self, interval: I64, ends: KeptRows) -> None:
        columns, run, start = self.columns, ends.run, ends.start
        columns.total_ns[run] += np.add.reduceat(interval, start)
        least, most = np.minimum.reduceat(interval, start), np.maximum.reduceat(interval, start)
        columns.least_ns[run] = np.minimum(columns.least_ns[run], least)
        columns.most_ns[run] = np.maximum(columns.most_ns[run], most)
        size = interval if least.min() >= 0 else np.abs(interval)
        largest = max(int(most.max()), -int(least.min()))
        if largest >= _LARGE_NS:
            large = np.flatnonzero(size >= _LARGE_NS)
            size = size.copy()
            for place, number in zip(large.tolist(), ends.streams(large).tolist(), strict=True):
                self.large_squares[number] = self.large_squares.get(number, 0) + int(interval[place]) ** 2
            size[large] = 0
        low, middle, high = (_squares_of_short if largest < _SHORT_NS else _squares)(size, start)
        squares = columns.squares[run]
        low += squares[:, 0]
        middle += squares[:, 1].astype(np.uint64) + (low >> _LIMB_BITS).astype(np.uint64)
        squares[:, 0] = low & _LIMB
        squares[:, 1] = (middle & np.uint64(_LIMB)).astype(np.int64)
        squares[:, 2] += high + (middle >> np.uint64(_LIMB_BITS)).astype(np.int64)
        columns.squares[run] = squares

    def _sort_in(self, told: Told, rows: TimedRows, ends: KeptRows, interval: I64, loss: LossBefore) -> I64:
        """Put intervals into the buckets; return the places of those that were learned from."""
        columns = self.columns
        run, length = ends.run, ends.stop - ends.start
        before = columns.count[run]
        columns.count[run] += length
        young = before < LEARNED_INTERVALS
        learned = self._learn(interval, ends.start, length, run, before, young)
        dense = upper_part(interval)
        dense -= np.repeat(columns.first_bucket[run], length)
        outside = dense.view(np.uint64) >= DENSE_BUCKETS
        outside[learned] = True
        self._keep_usual(rows, ends, outside, interval, loss, told.first_frame)
        place = np.flatnonzero(outside)
        dense += np.repeat(run * DENSE_BUCKETS, length)
        dense[place] = columns.dense.size - 1  # taken back below: cheaper than leaving them out
        flat = columns.dense.ravel()
        np.add.at(flat, dense, 1)
        flat[-1] -= len(place)
        if len(place):
            row, stream, took_ns = ends.rows(place), ends.streams(place), interval[place]
            time_ns, frame, lost = rows.time_ns[row], rows.packet[row] + told.first_frame, loss.bits(row)
            key = stream << UNUSUAL_STREAM_BIT | key_of(bucket_of(took_ns), lost)
            self.unusual.record(time_ns, frame, key.view(np.uint64))
            self.unusual.settle()
            if told.is_heard:
                self._tell(told, ends, before, place, stream, time_ns, frame, took_ns, lost)
        return learned

    def _tell(
        self, told: Told, ends: KeptRows, before: I64, place: I64, stream: I64, time_ns: I64, frame: I64, took_ns: I64,
        lost: I64,
    ) -> None:  # fmt: skip
        """Tell of unusual intervals as far as they are rare, and of all that are long for a picture of the capture.

        ``before`` are the intervals that each run's stream had before; ``place`` is where the unusual ones are.
        """
        columns = self.columns
        bounds = np.searchsorted(place, np.append(ends.start, ends.stop[-1]))
        start, stop = bounds[:-1], bounds[1:]
        known, run = columns.unusual[ends.run], ends.run
        columns.unusual[run] += stop - start
        rare = rare_ones(_RARE, known, before, ends.start, ends.stop - ends.start, start, stop, place)
        if rare is not None:
            rare |= took_ns >= time_ns - told.start_ns >> LONG_BITS
            chosen = np.flatnonzero(rare)
            stream, time_ns, frame, took_ns, lost = (one[chosen] for one in (stream, time_ns, frame, took_ns, lost))
        lists, node, subindex = told.keys.described(stream)
        told.tell(
            EventBatch.of(
                EventKind.UNUSUAL_INTERVAL, time_ns, frame, lists=lists, node=node, subindex=subindex,
                since_ns=time_ns - took_ns, amount=took_ns, detail=lost,
            )
        )  # fmt: skip

    def _keep_usual(
        self, rows: TimedRows, ends: KeptRows, outside: Bool, interval: I64, loss: LossBefore, first_frame: int
    ) -> None:
        """Keep the frames of the first intervals that are not ``outside`` of the dense buckets."""
        columns = self.columns
        room = np.flatnonzero(columns.usual_kept[ends.run] < FRAMES_KEPT)
        if not len(room):
            return
        run, inside = ends.run[room], np.flatnonzero(~outside)
        start, stop = np.searchsorted(inside, ends.start[room]), np.searchsorted(inside, ends.stop[room])
        before = columns.usual_kept[run]
        columns.usual_kept[run] = np.minimum(before + stop - start, FRAMES_KEPT)
        for number in range(FRAMES_KEPT):
            fits = (start + number < stop) & (before + number < FRAMES_KEPT)
            if not fits.any():
                break
            place = inside[start[fits] + number]
            row, entry = ends.rows(place), before[fits] + number
            columns.usual_frames[run[fits], entry] = rows.packet[row] + first_frame
            columns.usual_keys[run[fits], entry] = key_of(bucket_of(interval[place]), loss.bits(row))

    def _learn(self, interval: I64, start: I64, length: I64, run: I64, before: I64, young: Bool) -> I64:
        """Take the first intervals of young streams, place their dense buckets, and return the places of these."""
        columns = self.columns
        number, known = run[young], before[young]
        taken = np.minimum(LEARNED_INTERVALS - known, length[young])
        learned = spans(start[young], taken)
        columns.learned[np.repeat(number, taken), spans(known, taken)] = interval[learned]
        full = number[known + taken == LEARNED_INTERVALS]
        median = np.sort(columns.learned[full], axis=1)[:, LEARNED_INTERVALS // 2]
        columns.usual_ns[full] = np.maximum(median, 1)
        columns.first_bucket[full] = bucket_of(np.maximum(median * 3 // 4, 1))
        return learned

    def means_ns(self, stream: I64) -> list[int | None]:
        """Return the mean intervals of streams, rounded half to even; None without intervals."""
        return means(self.columns.count[stream], self.columns.total_ns[stream])

    def deviations_ns(self, stream: I64) -> list[int | None]:
        """Return the standard deviations of all intervals of streams (of the population), rounded half to even."""
        columns = self.columns
        large = [self.large_squares.get(number, 0) for number in stream.tolist()] if self.large_squares else None
        squares = (
            low + (middle << _LIMB_BITS) + (high << (2 * _LIMB_BITS))
            for low, middle, high in columns.squares[stream].tolist()
        )
        whole = squares if large is None else map(sum, zip(squares, large, strict=True))
        return deviations(columns.count[stream], columns.total_ns[stream], whole)


def _squares(size: I64, start: I64) -> tuple[I64, U64, I64]:
    """Return the sums of squares of the stretches that begin at ``start``, in limbs that may be above their 23 bits."""
    high, low = size >> _LIMB_BITS, size & _LIMB
    middle = np.uint64(2) * np.add.reduceat(high * low, start).astype(np.uint64)
    return np.add.reduceat(low * low, start), middle, np.add.reduceat(high * high, start)


def _squares_of_short(size: I64, start: I64) -> tuple[I64, U64, I64]:
    """Return the same of sizes below ``_SHORT_NS``, whose squares are one word each; with half the work."""
    square = (size * size).view(np.uint64)
    # Modulo 2^64: what the upper halves leave of it is the sum of the lower ones, which fits.
    total = np.add.reduceat(square, start)
    square >>= np.uint64(32)
    high = np.add.reduceat(square, start)
    low = (total - (high << np.uint64(32))).astype(np.int64)
    return low, high << np.uint64(32 - _LIMB_BITS), np.zeros(len(start), np.int64)


def key_of(bucket: I64, loss: I64) -> I64:
    key: I64 = (bucket + _BUCKET_OFFSET) << 2 | loss
    return key


def key_parts(key: I64) -> tuple[I64, I64]:
    return (key >> 2) - _BUCKET_OFFSET, key & 3
