"""Rows: data sets of a session as columns, on their way from the samples to the database."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.expression.typed_columns import Numbers


class Rows(Struct, frozen=True):
    """Data sets in their order, of a session with v variables.

    ``time_ns`` (n,) are their timestamps, ``consistent`` (n,) is False where data was lost in front of one. ``cells``
    (n, v) are the values, also those that have not changed: integers, the bits of reals, or numbers of ``Texts``, as
    signed integers of as few bytes as all of them need. ``own`` (n, v) tells which values belong to the data set:
    those of another task do not, nor what nobody knows; None where all do. ``counts`` (n, v), int64, is how often a
    value had changed by then, -1 before it is known; (n, 0) where nobody counts. ``schedule`` (n,) is the number of the
    schedule that made the data set: an interval, or the cycles of a list.
    """

    time_ns: I64
    consistent: Bool
    cells: Numbers
    own: Bool | None
    counts: I64
    schedule: I64

    def __len__(self) -> int:
        return len(self.time_ns)

    def take(self, rows: I64 | Bool | slice) -> Rows:
        """Return some of the rows."""
        own = None if self.own is None else self.own[rows]
        return Rows(
            self.time_ns[rows], self.consistent[rows], self.cells[rows], own, self.counts[rows], self.schedule[rows]
        )

    @staticmethod
    def joined(parts: Sequence[Rows]) -> Rows:
        """Return rows one part behind the other; there is one part at least."""
        if len(parts) == 1:
            return parts[0]
        time_ns, consistent, cells, counts, schedule = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("time_ns", "consistent", "cells", "counts", "schedule")
        )
        whole = all(part.own is None for part in parts)
        own = None if whole else np.concatenate([one.owned for one in parts])
        return Rows(time_ns, consistent, cells, own, counts, schedule)

    @property
    def owned(self) -> Bool:
        """``own`` as a mask."""
        return np.ones(self.cells.shape, np.bool_) if self.own is None else self.own

    @staticmethod
    def none() -> Rows:
        """Return no rows, which cannot be joined with others."""
        none, table = np.empty(0, np.int64), np.empty((0, 0), np.int64)
        return Rows(none, np.empty(0, np.bool_), table, None, table, none)
