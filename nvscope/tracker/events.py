"""EventLog: how often something happened, when first and last, and in which frames, for every key at once."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U64
from dissectors.keys import KeyTable
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of, stable_order
from nvscope.tracker.event_kinds import FRAMES_KEPT


class EventRows(KeyedColumns):
    """One row a key; ``frames`` holds frame numbers (from 1), 0 where there are fewer."""

    count: I64
    first_ns: I64
    last_ns: I64
    frames: I64
    COLUMNS: ClassVar = {
        "count": (np.int64(0), 1),
        "first_ns": (np.int64(0), 1),
        "last_ns": (np.int64(0), 1),
        "frames": (np.int64(0), FRAMES_KEPT),
    }

    def used(self) -> list[int]:
        """Return the rows with events, rising."""
        rows: list[int] = np.flatnonzero(self.column("count")).tolist()
        return rows

    def add(
        self, row: I64, start: I64, stop: I64, time_ns: I64, frame: I64, place: I64 | None = None, first_frame: int = 0
    ) -> None:  # fmt: skip
        """Add the events ``start[i]`` to ``stop[i]`` to row ``row[i]`` of this table; rows differ.

        Event j is described by the j-th entries of ``time_ns`` and ``frame``, or by those at ``place[j]``; frames are
        counted from ``first_frame``.
        """
        before = self.count[row]
        begins = before == 0
        first, last = (start[begins], stop - 1) if place is None else (place[start[begins]], place[stop - 1])
        self.first_ns[row[begins]] = time_ns[first]
        self.last_ns[row] = time_ns[last]
        self.count[row] = before + stop - start
        room = np.flatnonzero(before < FRAMES_KEPT)
        if not len(room):
            return
        row, start, before = row[room], start[room], before[room]
        length = np.minimum(stop[room] - start, FRAMES_KEPT - before)
        within = np.arange(int(length.sum())) - np.repeat(np.cumsum(length) - length, length)
        entry = np.repeat(start, length) + within
        frames = frame[entry if place is None else place[entry]] + first_frame
        self.frames[np.repeat(row, length), np.repeat(before, length) + within] = frames


class EventLog:
    """Events by key (two 64-bit words, or as many as said), kept as counts, first and last time, and first ten frames.

    Few events at a time are the rule, and sorting in a few costs as much as sorting in thousands: those of a batch wait
    until its end (``settle``).

    ``keys`` are the keys by row, ``rows`` what is known of each; of events that were not settled, they know nothing.
    """

    def __init__(self, words: int = 2) -> None:
        self.keys = KeyTable(words)
        self.rows = EventRows()
        self._waiting: list[tuple[I64, I64, tuple[U64, ...]]] = []

    def record(self, time_ns: I64, frame: I64, *words: U64) -> None:
        """Add one event a row; those of one key in the order in which they happened."""
        if len(frame):
            self._waiting.append((time_ns, frame, words))

    def settle(self) -> None:
        """Sort in the events that were recorded since the last time."""
        if not self._waiting:
            return
        waiting, self._waiting = self._waiting, []
        time_ns, frame, words = waiting[0]
        if len(waiting) > 1:
            time_ns, frame = (np.concatenate([part[place] for part in waiting]) for place in (0, 1))
            words = tuple(map(np.concatenate, zip(*(part[2] for part in waiting), strict=True)))
        # Events of one key often follow each other: it is looked up once for all of them.
        again = np.ones(len(frame), np.bool_)
        again[0] = False
        for word in words:
            again[1:] &= word[1:] == word[:-1]
        head = np.flatnonzero(~again)
        number = np.repeat(self.keys.numbers(*(word[head] for word in words)), np.diff(head, append=len(frame)))
        order = stable_order(number, len(self.keys))
        number = number[order]
        start, stop = runs_of(number)
        self.rows.resize(len(self.keys))
        self._add(number[start], start, stop, time_ns[order], frame[order])

    def _add(self, row: I64, start: I64, stop: I64, time_ns: I64, frame: I64) -> None:
        self.rows.add(row, start, stop, time_ns, frame)

    def take(self, part: EventLog, *words: U64) -> None:
        """Take over the events of a log that has none of this one's keys.

        ``words`` are its keys as this one has them, by default the same.
        """
        self.rows.take_keyed(self.keys, part.rows, words or part.keys.words)


class LeftOutLog(EventLog):
    """What there was no room for, by one word: of few kinds, each told in any order.

    So first and last are the earliest and the latest, and frames are the lowest ones, whichever was recorded first.
    """

    def __init__(self) -> None:
        super().__init__(1)

    def _add(self, row: I64, start: I64, stop: I64, time_ns: I64, frame: I64) -> None:
        rows = self.rows
        for one, begin, end in zip(row.tolist(), start.tolist(), stop.tolist(), strict=True):
            times = time_ns[begin:end] if not rows.count[one] else np.append(
                time_ns[begin:end], [rows.first_ns[one], rows.last_ns[one]]
            )  # fmt: skip
            known = rows.frames[one][rows.frames[one] > 0]
            lowest = np.sort(np.append(known, frame[begin:end]))[:FRAMES_KEPT]
            rows.first_ns[one], rows.last_ns[one] = times.min(), times.max()
            rows.frames[one, : len(lowest)] = lowest
            rows.count[one] += end - begin
