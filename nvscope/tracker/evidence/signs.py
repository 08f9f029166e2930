"""SignsOfLife: when an address sent frames that are no telegrams of lists, as spans of time without a long pause."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of
from nvscope.tracker.evidence.first_and_last import FirstAndLast

CLOSE_NS = 100_000_000
"""Frames at most so far apart are of one span, if nothing else is said."""

MOST_SPANS = 1 << 18
"""So many spans are kept, of all addresses together, of captures that have an end."""

MOST_SPANS_LIVE = 1 << 16
"""So many are kept of live sources."""

_NONE = -1
_NEVER = np.iinfo(np.int64).min


class SpanColumns(KeyedColumns):
    """One row a span of an address, in the order in which spans of one address began."""

    address: I64
    since_ns: I64
    until_ns: I64
    COLUMNS: ClassVar = dict.fromkeys(("address", "since_ns", "until_ns"), (np.int64(0), 1))


class _OpenColumns(KeyedColumns):
    """One row an address: its last span."""

    span: I64
    COLUMNS: ClassVar = {"span": (np.int64(_NONE), 1)}


class SignsOfLife:
    """The spans of all addresses, by number of the address; ``left_out`` counts those for which there was no room.

    Of more than ``most``, the first and the last ones are kept, and those that go on: who was there at the beginning,
    and who is now. Frames at most ``close_ns`` apart are of one span.
    """

    def __init__(self, most: int = MOST_SPANS, close_ns: int = CLOSE_NS) -> None:
        self._room, self._close_ns = FirstAndLast(most), close_ns
        self._open = _OpenColumns()
        self.columns = SpanColumns()
        self.left_out = 0

    def observe(self, address: I64, time_ns: I64, before_ns: I64, addresses: int) -> None:
        """Take frames by address, those of one as they came, with the time of the one before; shapes (n,).

        Where none was before, or nobody has listened since, its time is the least there is.
        """
        self._open.resize(addresses)
        if not len(address):
            return
        columns = self.columns
        # Times that fall, and all behind the least there is, are as far apart as unsigned numbers can be.
        begins = (time_ns - before_ns).view(np.uint64) > np.uint64(self._close_ns)
        fresh = np.flatnonzero(begins)
        first = len(columns)
        columns.resize(first + len(fresh))
        columns.address[first : len(columns)] = address[fresh]
        columns.since_ns[first : len(columns)] = time_ns[fresh]
        # Each frame belongs to the last span of its address that began up to it, here or before.
        parts = begins.copy()
        parts[runs_of(address)[0]] = True
        start = np.flatnonzero(parts)
        owner = address[start]
        span = self._open.span[owner]
        span[begins[start]] = np.arange(first, len(columns))
        self._open.span[owner] = span  # of several spans, the last one is what stays
        columns.until_ns[span] = time_ns[np.append(start[1:], len(address)) - 1]
        if self._room.is_full(len(columns)):
            self.throw_away()

    def throw_away(self) -> None:
        """Throw away the spans for which there is no room; what is kept then does not hang on when it was done before.

        By itself that is done for many at once.
        """
        old, rows = self.columns, len(self.columns)
        if rows <= self._room.most:
            return
        # Those of several addresses stand as batches brought them.
        by_time = np.lexsort((old.column("address"), old.column("since_ns")))
        kept = np.zeros(rows, np.bool_)
        kept[by_time[self._room.kept(rows)]] = True
        last = self._open.column("span")
        kept[last[last >= 0]] = True
        self.left_out += rows - int(kept.sum())
        self.columns = old.rows(np.flatnonzero(kept))
        number = np.cumsum(kept) - 1
        last[:] = np.where(last >= 0, number[last], _NONE)

    def seen_between(self, address: I64, since_ns: int, until_ns: int) -> bool:
        """Tell whether one of some addresses sent such a frame from one time to another, both included."""
        columns = self.columns
        own = np.isin(columns.column("address"), address)
        overlaps = (columns.column("since_ns") <= until_ns) & (columns.column("until_ns") >= since_ns)
        return bool((own & overlaps).any())
