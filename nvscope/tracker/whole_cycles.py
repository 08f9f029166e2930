"""Whole cycles: those that begin and end while all streams of their list are sent.

A cycle that begins before the first telegram of one of them, or ends after the last one, is none: the capture may have
begun, or ended, within it. Which telegram is the last one is known at the end only. Each stream therefore keeps what
was counted up to its own; what the one says that ended first is what there is.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.engine.keyed_columns import KeyedColumns

_FRAME_BITS = 40


class Over(NamedTuple):
    """Cycles that are over; columns of shape (n,).

    ``known`` are the streams that their pair of sender and list had when they began, 0 where it was too early to tell.
    ``skew_ns`` is how far their first and last telegrams are apart.
    """

    pair: I64
    size: I64
    begin_ns: I64
    end_frame: I64
    known: I64
    begin_frame: I64
    skew_ns: I64


class CycleCounts(KeyedColumns):
    """How many cycles there were of one pair, how many of them were torn, and when the last torn one began."""

    cycles: I64
    torn: I64
    torn_ns: I64
    COLUMNS: ClassVar = {"cycles": (np.int64(0), 1), "torn": (np.int64(0), 1), "torn_ns": (np.int64(0), 1)}


class PairCounts(CycleCounts):
    """One row a pair: its cycles since it has as many streams as now, ``known``."""

    known: I64
    COLUMNS: ClassVar = {**CycleCounts.COLUMNS, "known": (np.int64(0), 1)}


class StreamCounts(CycleCounts):
    """One row a stream: the cycles of its pair up to its last telegram, which is in ``last_frame``."""

    last_frame: I64
    COLUMNS: ClassVar = {**CycleCounts.COLUMNS, "last_frame": (np.int64(0), 1)}


def count_cycles(
    pairs: PairCounts, streams: StreamCounts, pair_of: I64, over: Over | None, run_stream: I64, last_frame: I64
) -> None:  # fmt: skip
    """Count the cycles that a batch has ended; ``last_frame`` are those of its streams, ``run_stream``.

    ``pair_of`` is the pair of each stream, -1 of those that are not looked at.
    """
    own = pair_of[run_stream] >= 0
    run_stream, last_frame = run_stream[own], last_frame[own]
    if over is not None and len(over.pair):
        over = _counted(pairs, streams, pair_of, over)
    ended = _Ended(over)
    silent = np.ones(len(pair_of), np.bool_)
    silent[run_stream] = False
    if over is not None and len(over.pair):
        concerned = np.zeros(len(pairs) + 1, np.bool_)
        concerned[over.pair] = True
        silent &= concerned[pair_of]
        # Of a stream that is silent, a cycle may be over only now that has ended before its last telegram.
        stream = np.flatnonzero(silent)
        ended.add(streams, stream, pair_of[stream], streams.last_frame[stream])
    # What a stream of this batch knows is all that its pair knew before, and what has ended up to its last telegram.
    pair = pair_of[run_stream]
    for name in CycleCounts.COLUMNS:
        getattr(streams, name)[run_stream] = getattr(pairs, name)[pair]
    streams.last_frame[run_stream] = last_frame
    if over is not None and len(over.pair):
        ended.add(streams, run_stream, pair, last_frame)
        pair = np.flatnonzero(concerned)
        ended.add(pairs, pair, pair, np.full(len(pair), (1 << _FRAME_BITS) - 1))


def end_counting(pairs: PairCounts, streams: StreamCounts, stream: I64, pair: I64) -> None:
    """Leave of some pairs, for good, the cycles up to the last telegram of the stream that ended first.

    ``stream`` are all streams of these pairs, ``pair`` that of each.
    """
    order = np.lexsort((streams.last_frame[stream], pair))
    stream, pair = stream[order], pair[order]
    first = np.append(True, pair[1:] != pair[:-1])
    for name in CycleCounts.COLUMNS:
        of_pair, of_stream = getattr(pairs, name), getattr(streams, name)
        of_pair[pair[first]] = of_stream[stream[first]]
        of_stream[stream] = of_pair[pair]


def _counted(pairs: PairCounts, streams: StreamCounts, pair_of: I64, over: Over) -> Over:
    """Return the cycles of all streams that are known now; those of fewer are forgotten."""
    if (over.known == pairs.known[over.pair]).all():  # as it mostly is
        return over
    before = pairs.column("known").copy()
    np.maximum.at(pairs.known, over.pair, over.known)
    grown = np.append(pairs.column("known") > before, False)
    if grown.any():
        for name, (nothing, _) in CycleCounts.COLUMNS.items():
            getattr(pairs, name)[np.flatnonzero(grown)] = nothing
            getattr(streams, name)[np.flatnonzero(grown[pair_of])] = nothing
    chosen = (over.known == pairs.known[over.pair]) & (over.known > 0)
    return over if chosen.all() else Over(*(column[chosen] for column in over))


class _Ended:
    """Cycles in the order of their pairs and ends, to be counted up to any frame."""

    def __init__(self, over: Over | None) -> None:
        if over is None:
            return
        end = over.pair << _FRAME_BITS | over.end_frame
        order = np.argsort(end, kind="stable")
        torn = (over.size < over.known)[order]
        self._end, self._begin_ns = end[order], over.begin_ns[order]
        self._torn = np.append(0, np.cumsum(torn))
        self._last_torn = np.maximum.accumulate(np.append(-1, np.where(torn, np.arange(len(torn)), -1)))

    def add(self, counts: CycleCounts, row: I64, pair: I64, frame: I64) -> None:
        """Add to some rows the cycles of their pairs that end at ``frame`` at the latest."""
        first = np.searchsorted(self._end, pair << _FRAME_BITS)
        stop = np.searchsorted(self._end, pair << _FRAME_BITS | frame, "right")
        counts.cycles[row] += stop - first
        counts.torn[row] += self._torn[stop] - self._torn[first]
        last = self._last_torn[stop]
        some = last >= first
        counts.torn_ns[row[some]] = self._begin_ns[last[some]]
