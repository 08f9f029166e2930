"""Torn cycles: those of a sender's list in which fewer telegrams or frames came than the list has."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from nvscope.engine.runs import distinct
from nvscope.findings.finding import Events
from nvscope.tracker.cycles import KNOWN_BIT, Cycles
from nvscope.tracker.event_kinds import FRAMES_KEPT


class TornCycles(Struct, frozen=True):
    """The torn cycles of one sender and list, of how many there were, and how far apart the parts of one are."""

    events: Events
    cycles: int
    skew_ns: int


class CycleSizes:
    """A look at the log of cycles, with those of one sender and list found by any stream of theirs."""

    def __init__(self, cycles: Cycles) -> None:
        self._cycles = cycles
        kind = cycles.events.keys.low.astype(np.int64)
        self._sizes, self._known = kind & (1 << KNOWN_BIT) - 1, kind >> KNOWN_BIT
        self._rows_of_pair: dict[int, list[int]] = defaultdict(list)
        for row, pair in enumerate(cycles.events.keys.high.tolist()):
            self._rows_of_pair[pair].append(row)

    def torn_whole(self, streams: Sequence[int]) -> TornCycles | None:
        """Return the torn ones among the cycles that lie between the first and the last telegrams of all streams.

        ``streams`` are all those of one sender and list. None where there are none.
        """
        counts, parts = self._cycles.stream_counts, len(streams)
        pair = int(self._cycles.streams.pair[streams[0]])
        if self._cycles.pair_counts.known[pair] < parts:
            return None
        first = min(streams, key=lambda stream: int(counts.last_frame[stream]))
        count = int(counts.torn[first])
        if not count:
            return None
        rows = np.array(self._rows_of_pair[pair], np.int64)
        torn = rows[(self._known[rows] == parts) & (self._sizes[rows] < parts)]
        log = self._cycles.events.rows
        frames = distinct(log.frames[torn])
        events = Events(
            count,
            int(log.first_ns[torn].min()),
            int(counts.torn_ns[first]),
            tuple(frames[frames > 0][: min(count, FRAMES_KEPT)].tolist()),
        )
        return TornCycles(events, int(counts.cycles[first]), int(self._cycles.columns.skew_ns[pair]))

    def torn(self, stream: int, parts: int) -> TornCycles | None:
        """Return the cycles with fewer than ``parts`` telegrams or frames, None where there are none."""
        pair = int(self._cycles.streams.pair[stream])
        rows = np.array(self._rows_of_pair.get(pair, ()), np.int64)
        torn = rows[self._sizes[rows] < parts]
        if not len(torn):
            return None
        log = self._cycles.events.rows
        frames = distinct(log.frames[torn])
        events = Events(
            int(log.count[torn].sum()),
            int(log.first_ns[torn].min()),
            int(log.last_ns[torn].max()),
            tuple(frames[frames > 0][:FRAMES_KEPT].tolist()),
        )
        return TornCycles(events, int(log.count[rows].sum()), int(self._cycles.columns.skew_ns[pair]))
