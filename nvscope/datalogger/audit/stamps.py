"""Timestamps by their form: which are of another one than the first of the table, of local time, or none at all."""

from __future__ import annotations

import numpy as np

from dissectors.batch import Bool
from dissectors.datalogger.row_times import Stamp
from nvscope.datalogger.audit import topics
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.finding import Notes

_FORMS = {Stamp.ISO: "iso", Stamp.RAW_UTC: "raw", Stamp.RAW_UNSPECIFIED: "raw", Stamp.RAW_LOCAL: "raw"}


class Stamps:
    """The forms of the timestamps of a table so far, and how many rows have no time."""

    def __init__(self) -> None:
        self.untimed = 0
        self.forms: set[str] = set()
        self._first: str | None = None

    def take(self, chunk: Chunk, timed: Bool, notes: Notes) -> None:
        """Note which rows of a chunk have a timestamp that is not as it should be."""
        stamp = chunk.times.stamp
        low, high = int(stamp.min()), int(stamp.max())
        if low == Stamp.NONE:
            rows = np.flatnonzero(~timed)
            self.untimed += len(rows)
            notes.of(topics.NO_TIME).add(chunk.rowid[rows], chunk.time_ns[rows], timed[rows])
        present = (
            {int(one) for one in {low, high}} if high - low < 2 else set(np.flatnonzero(np.bincount(stamp)).tolist())
        )
        present.discard(Stamp.NONE)
        if not present:
            return
        self.forms |= {_FORMS[Stamp(one)] for one in present}
        if self._first is None:
            self._first = _FORMS[Stamp(int(stamp[timed][0]))]
        if any(_FORMS[Stamp(one)] != self._first for one in present):
            others = np.array(
                [one in _FORMS and one != Stamp.RAW_LOCAL and _FORMS[one] != self._first for one in Stamp]
            )
            rows = np.flatnonzero(others[stamp])
            notes.of(topics.OTHER_FORM).add(chunk.rowid[rows], chunk.time_ns[rows], timed[rows])
        if Stamp.RAW_LOCAL in present:
            rows = np.flatnonzero(stamp == Stamp.RAW_LOCAL)
            notes.of(topics.LOCAL).add(chunk.rowid[rows], chunk.time_ns[rows], timed[rows])
