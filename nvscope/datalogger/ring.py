"""Ring: data sets between two publishings, of which only the last ones fit into the buffer."""

from __future__ import annotations

import numpy as np

from nvscope.datalogger.rows import Rows


class Ring:
    """A buffer of so many data sets that is emptied every ``publish_ns``, at multiples of it since 1970.

    Of what is taken in between, the oldest are overwritten; the row behind them is not consistent. ``overwritten`` is
    how many were lost. Without ``publish_ns``, each data set is passed on at once.
    """

    def __init__(self, capacity: int, publish_ns: int | None) -> None:
        self._capacity = capacity
        self._publish_ns = publish_ns
        self._held: Rows | None = None
        self._lost = False
        self.overwritten = 0

    def take(self, rows: Rows, now_ns: int | None = None) -> Rows | None:
        """Take data sets, and return what is published by the time of the last of them, or by ``now_ns``."""
        if self._publish_ns is None:
            return rows if len(rows) else None
        if self._held is not None:
            rows = Rows.joined([self._held, rows]) if len(rows) else self._held
        if not len(rows):
            return None
        # A data set is published with the next publishing behind it, or with that at its time.
        group = -(-rows.time_ns // self._publish_ns)
        begins = np.flatnonzero(np.append(True, group[1:] != group[:-1]))
        stop = np.append(begins[1:], len(rows))
        first_kept = np.maximum(stop - self._capacity, begins)
        number = np.repeat(np.arange(len(begins)), stop - begins)
        kept = np.arange(len(rows)) >= first_kept[number]
        consistent = rows.consistent.copy()
        # What was lost in front of an overwritten row, was lost in front of the first that is kept.
        overwrites = first_kept > begins
        consistent[first_kept[overwrites]] = False
        if self._lost:
            consistent[first_kept[0]] = False
        is_open = now_ns is None or -(-now_ns // self._publish_ns) <= int(group[-1])
        published = int(begins[-1]) if is_open else len(rows)
        self.overwritten += int(np.count_nonzero(~kept))
        self._lost = bool(overwrites[-1] or (self._lost and len(begins) == 1)) and is_open
        held = rows.take(slice(int(first_kept[-1]), len(rows))) if is_open else None
        self._held = held
        out = kept[:published]
        if not out.any():
            return None
        found = rows.take(slice(0, published)).take(out)
        return Rows(found.time_ns, consistent[:published][out], found.cells, found.own, found.counts)

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
            consistent[0] = False
            rows = Rows(rows.time_ns, consistent, rows.cells, rows.own, rows.counts)
        self._lost = False
        return rows
