"""SignsOfLife: when an address sent frames that are no telegrams of lists, as spans of time without a long pause."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of

CLOSE_NS = 100_000_000
"""Frames at most so far apart are of one span."""

MOST_SPANS = 1 << 18
"""So many spans are kept, of all addresses together; of what comes behind them, only how often it was is known."""

_NONE = -1
_NEVER = np.iinfo(np.int64).min


class SpanColumns(KeyedColumns):
    """One row a span of an address, in the order in which spans of one address began."""

    address: I64
    since_ns: I64
    until_ns: I64
    COLUMNS: ClassVar = {"address": (np.int64(0), 1), "since_ns": (np.int64(0), 1), "until_ns": (np.int64(0), 1)}


class _OpenColumns(KeyedColumns):
    """One row an address: its last span."""

    span: I64
    COLUMNS: ClassVar = {"span": (np.int64(_NONE), 1)}


class SignsOfLife:
    """The spans of all addresses, by number of the address; ``left_out`` counts those for which there was no room."""

    def __init__(self, most: int = MOST_SPANS) -> None:
        self._most = most
        self._open = _OpenColumns()
        self.columns = SpanColumns()
        self.left_out = 0

    def observe(self, address: I64, time_ns: I64, before_ns: I64, addresses: int) -> None:
        """Take frames by address, those of one as they came, with the time of the one before; shapes (n,).

        Where none was before, or nobody has listened since, its time is the least there is.
        """
        self._open.resize(addresses)
        columns = self.columns
        begins = (before_ns == _NEVER) | (time_ns < before_ns) | (before_ns < time_ns - CLOSE_NS)
        fresh = np.flatnonzero(begins)
        kept = fresh[: max(self._most - len(columns), 0)]
        self.left_out += len(fresh) - len(kept)
        first = len(columns)
        columns.resize(first + len(kept))
        columns.address[first : len(columns)] = address[kept]
        columns.since_ns[first : len(columns)] = time_ns[kept]
        # Each frame belongs to the last span of its address that began up to it, here or before.
        span = self._open.span[address]
        span[fresh] = _NONE
        span[kept] = np.arange(first, len(columns))
        start, stop = runs_of(address)
        place = np.arange(len(address))
        here = np.maximum.accumulate(np.where(begins, place, -1))
        span = np.where(here >= np.repeat(start, stop - start), span[here], span)
        self._open.span[address[start]] = span[stop - 1]
        known = np.flatnonzero(span >= 0)
        columns.until_ns[span[known]] = time_ns[known]  # of several frames, the last one is what stays

    def seen_between(self, address: I64, since_ns: int, until_ns: int) -> bool:
        """Tell whether one of some addresses sent such a frame from one time to another, both included."""
        columns = self.columns
        own = np.isin(columns.column("address"), address)
        overlaps = (columns.column("since_ns") <= until_ns) & (columns.column("until_ns") >= since_ns)
        return bool((own & overlaps).any())
