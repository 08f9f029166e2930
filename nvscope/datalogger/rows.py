"""Rows: data sets of a session as columns, on their way from the samples to the database."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dissectors.batch import I64, Bool


@dataclass(frozen=True, slots=True)
class Rows:
    """Data sets in their order, of a session with v variables.

    ``time_ns`` (n,) are their timestamps, ``consistent`` (n,) is False where data was lost in front of one. ``cells``
    (n, v), int64, are the values, also those that have not changed: integers, the bits of float64, or numbers of
    ``Texts``. ``own`` (n, v) tells which values belong to the data set: those of another task do not, nor what nobody
    knows. ``counts`` (n, v) is how often a value had changed by then, -1 before it is known.
    """

    time_ns: I64
    consistent: Bool
    cells: I64
    own: Bool
    counts: I64

    def __len__(self) -> int:
        return len(self.time_ns)

    def take(self, rows: I64 | Bool | slice) -> Rows:
        """Return some of the rows."""
        return Rows(self.time_ns[rows], self.consistent[rows], self.cells[rows], self.own[rows], self.counts[rows])

    @staticmethod
    def joined(parts: Sequence[Rows]) -> Rows:
        """Return rows one part behind the other; there is one part at least."""
        if len(parts) == 1:
            return parts[0]
        return Rows(
            *(
                np.concatenate([getattr(part, name) for part in parts])
                for name in ("time_ns", "consistent", "cells", "own", "counts")
            )
        )

    @staticmethod
    def none(variables: int) -> Rows:
        """Return no rows."""
        return Rows(
            np.empty(0, np.int64), np.empty(0, np.bool_), np.empty((0, variables), np.int64),
            np.empty((0, variables), np.bool_), np.empty((0, variables), np.int64),
        )  # fmt: skip
