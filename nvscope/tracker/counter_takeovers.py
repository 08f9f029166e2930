"""CounterTakeovers: senders whose telegrams go on in the Counter of another one, although not in their own.

Of a (list, SubIndex) that one node sends, nothing is counted.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.dealing import Share
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import COUNTER_SHIFT, Keys
from nvscope.engine.rows import DataRows
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.watch import Unheard
from nvscope.tracker.events import EventLog

MOST_PAIRS = 1 << 16
"""So many pairs of streams are kept, of which the one goes on in the Counter of the other."""

_NONE = -1


class _PlaceColumns(KeyedColumns):
    """One row a (list, SubIndex): how many streams it has, the first of them, and who sent last, with its Counter.

    ``stream`` is -1 where nobody sent since several do, or since somebody listens again.
    """

    streams: I64
    first_stream: I64
    stream: I64
    counter: I64
    is_shared: Bool
    COLUMNS: ClassVar = {
        "streams": (np.int64(0), 1), "first_stream": (np.int64(_NONE), 1), "stream": (np.int64(_NONE), 1),
        "counter": (np.int64(0), 1), "is_shared": (np.False_, 1),
    }  # fmt: skip


class StepColumns(KeyedColumns):
    """One row a stream: its own steps since its (list, SubIndex) has another sender, too, and those of them by 1.

    A telegram with the Counter of its sender's previous one, such as a copy, takes no step.
    """

    steps: I64
    regular: I64
    COLUMNS: ClassVar = {"steps": (np.int64(0), 1), "regular": (np.int64(0), 1)}


class CounterTakeovers:
    """The steps of streams that are not alone in their (list, SubIndex).

    ``events`` are telegrams whose Counter is the next one behind that of another sender, which sent last, and is not
    the next one of their own; keyed by their stream and by that of the other. ``left_out`` are those of further pairs,
    by their stream.
    """

    def __init__(self, most: int = MOST_PAIRS) -> None:
        self.most = most
        self.columns, self.events, self.left_out = StepColumns(), EventLog(), EventLog(1)
        self._places = _PlaceColumns()
        self._counted_streams = 0
        self._any_shared = False

    def observe(self, rows: DataRows, keys: Keys, first_frame: int) -> None:
        """Take the data telegrams of a batch, which follow those observed so far."""
        self._count_streams(keys)
        if not self._any_shared:
            return
        places = self._places
        shared = places.streams[keys.place_of(rows.run_stream)] > 1
        if not shared.any():
            return
        self.columns.resize(len(keys.streams))
        row = np.flatnonzero(np.repeat(shared, rows.stop - rows.start))
        own_before, has_own = _own_counters(rows, row)
        counter = rows.counter[row].astype(np.int64)
        distance = (counter - own_before) & 0xFFFF
        moves = ~has_own | (distance != 0)
        row, counter, distance, has_own = row[moves], counter[moves], distance[moves], has_own[moves]
        order = np.argsort(rows.packet[row], kind="stable")
        order = order[stable_order(keys.place_of(rows.stream[row[order]]), len(keys.places))]
        row, counter, distance, has_own = row[order], counter[order], distance[order], has_own[order]
        stream, place = rows.stream[row], keys.place_of(rows.stream[row])
        start, stop = runs_of(place)
        if not len(start):
            return
        run_place = place[start]
        before_stream, before_counter = np.roll(stream, 1), np.roll(counter, 1)
        before_stream[start], before_counter[start] = places.stream[run_place], places.counter[run_place]
        counts = self._since_shared(stream, place, start, stop)
        steps = counts & has_own
        np.add.at(self.columns.steps, stream[steps], 1)
        np.add.at(self.columns.regular, stream[steps & (distance == 1)], 1)
        follows = steps & (distance != 1) & (before_stream >= 0) & (before_stream != stream)
        follows &= (counter - before_counter) & 0xFFFF == 1
        places.stream[run_place], places.counter[run_place] = stream[stop - 1], counter[stop - 1]
        found = np.flatnonzero(follows)
        if len(found):
            found = found[np.argsort(rows.packet[row[found]], kind="stable")]
            words = stream[found].view(np.uint64), before_stream[found].view(np.uint64)
            time_ns, frame = rows.time_ns[row[found]], rows.packet[row[found]] + first_frame
            kept = self.events.keys.numbers_within(self.most, *words) >= 0
            self.events.record(time_ns[kept], frame[kept], *(word[kept] for word in words))
            self.events.settle()
            self.left_out.record(time_ns[~kept], frame[~kept], words[0][~kept])
            self.left_out.settle()

    def resume(self, unheard: Unheard) -> None:
        """Let what follows of the unheard follow nothing."""
        places = self._places
        places.stream[: len(places) if unheard.everything else 0] = _NONE
        places.stream[places.own_rows(unheard.places)] = _NONE

    def take(self, part: CounterTakeovers, share: Share) -> None:
        """Take over what a part has found of its share of the lists."""
        self._places.take(part._places, share.places)
        self.columns.take(part.columns, share.streams)
        self.events.take(part.events)
        self.left_out.take(part.left_out)
        # How many streams a place has is counted anew, with the next batch.
        self._places.streams[:] = 0
        self._counted_streams, self._any_shared = 0, False

    def _count_streams(self, keys: Keys) -> None:
        known = self._counted_streams
        if known == len(keys.streams):
            return
        places = self._places
        places.resize(len(keys.places))
        new = keys.streams.high[known:].astype(np.int64)
        np.add.at(places.streams, new, 1)
        # In the order in which they came: assigned backwards, the first one is what stays.
        first = np.flatnonzero(places.first_stream[new] == _NONE)[::-1]
        places.first_stream[new[first]] = first + known
        self._counted_streams = len(keys.streams)
        self._any_shared |= bool((places.streams[new] > 1).any())

    def _since_shared(self, stream: I64, place: I64, start: I64, stop: I64) -> Bool:
        """Tell which telegrams, by place and as they came, are there since the place has several senders."""
        places = self._places
        is_further = stream != places.first_stream[place]
        so_far = np.cumsum(is_further)
        before = so_far[start] - is_further[start]
        since: Bool = (so_far > np.repeat(before, stop - start)) | places.is_shared[place]
        places.is_shared[place[start]] |= so_far[stop - 1] > before
        return since


def _own_counters(rows: DataRows, row: I64) -> tuple[I64, Bool]:
    """Return the Counter of the telegram before in the same stream, and where there is one that somebody saw."""
    run = np.searchsorted(rows.start, row, "right") - 1
    first = row == rows.start[run]
    kept = (rows.signature_before[run] >> COUNTER_SHIFT).astype(np.int64) & 0xFFFF
    before = np.where(first, kept, rows.counter[row - 1].astype(np.int64))
    return before, ~(first & rows.fresh[run])
