"""Ring: data sets between two publishings, of which only the last ones fit into the buffer."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

from dissectors.batch import Bool
from nvscope.datalogger.rows import Rows


class Ring:
    """A buffer of so many data sets that is emptied every ``publish_ns``, at multiples of it since 1970.

    Of what is sampled in between, the oldest are overwritten; the row behind them is not consistent. What cycles made
    is not overwritten: it waits for those in front of it; ``sampled`` tells which schedules take samples.
    ``overwritten`` is how many were lost. Without ``publish_ns``, each data set is passed on at once.
    """

    def __init__(self, capacity: int, publish_ns: int | None, sampled: Bool) -> None:
        self._capacity = capacity
        self._publish_ns = publish_ns
        self._sampled = sampled
        self._held: Rows | None = None
        self._lost = False
        self.overwritten = 0

    def take(self, rows: Rows, now_ns: int | None = None) -> Rows | None:
        """Take data sets, and return what is published by the time of the last of them, or by ``now_ns``."""
        if self._publish_ns is None:
            return rows if len(rows) else None
        if self._held is not None:
            rows = Rows.joined([self._held, rows]) if len(rows) else self._held
        sampled = np.flatnonzero(self._sampled[rows.schedule])
        if not len(sampled):
            return rows if len(rows) else None
        # A data set is published with the next publishing behind it, or with that at its time.
        group = -(-rows.time_ns[sampled] // self._publish_ns)
        begins = np.flatnonzero(np.append(True, group[1:] != group[:-1]))
        stop = np.append(begins[1:], len(sampled))
        first_kept = np.maximum(stop - self._capacity, begins)
        kept = np.ones(len(rows), np.bool_)
        kept[sampled[np.arange(len(sampled)) < np.repeat(first_kept, stop - begins)]] = False
        consistent = rows.consistent.copy()
        # What was lost in front of an overwritten row, was lost in front of the first that is kept.
        overwrites = first_kept > begins
        consistent[sampled[first_kept[overwrites]]] = False
        if self._lost:
            consistent[sampled[first_kept[0]]] = False
        rows = replace(rows, consistent=consistent)
        is_open = now_ns is None or -(-now_ns // self._publish_ns) <= int(group[-1])
        published = int(sampled[begins[-1]]) if is_open else len(rows)
        self.overwritten += int(np.count_nonzero(~kept))
        self._lost = bool(overwrites[-1] or (self._lost and len(begins) == 1)) and is_open
        self._held = rows.take(slice(published, None)).take(kept[published:]) if is_open else None
        out = rows.take(slice(0, published)).take(kept[:published])
        return out if len(out) else None

    @property
    def held(self) -> Rows | None:
        """What is in the buffer."""
        return self._held

    def end(self) -> Rows | None:
        """Return what is in the buffer, which is empty then."""
        rows, self._held = self._held, None
        if rows is None or not len(rows):
            return None
        if self._lost:
            consistent = rows.consistent.copy()
            consistent[np.argmax(self._sampled[rows.schedule])] = False
            rows = replace(rows, consistent=consistent)
        self._lost = False
        return rows
