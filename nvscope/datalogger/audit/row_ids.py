"""Ids of rows: loggers number them one by one and delete the oldest alone, so one that lacks was taken out."""

from __future__ import annotations

import numpy as np

from nvscope.capture.datalogger.table_rows import Rows
from nvscope.datalogger.audit import topics
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.finding import Notes

_MOST = np.int64((1 << 63) - 1)


class RowIds:
    """Looks for ids that lack between the rows of a table; where rows cannot be read, nobody knows of theirs."""

    def __init__(self) -> None:
        self._last = 0
        self._stretch = -1

    def take(self, chunk: Chunk, notes: Notes) -> None:
        """Note in front of which rows ids lack."""
        if not isinstance(chunk.rows, Rows):
            return  # an id that is a column's may be anything
        rowid = chunk.rowid
        goes_on = not chunk.begins_file and self._stretch == int(chunk.stretch[0])
        before = self._last if goes_on else int(rowid[0]) - 1
        self._last, self._stretch = int(rowid[-1]), int(chunk.stretch[-1])
        if self._last - before == len(rowid):
            return
        steps = np.diff(rowid, prepend=rowid[0] if not goes_on else before)
        # Ids rise: what is further than can be told wraps around.
        steps[steps < 0] = _MOST
        follows = np.diff(chunk.stretch, prepend=chunk.stretch[0]) == 0
        # That data was lost before a row says enough.
        places = np.flatnonzero((steps > 1) & follows & ~chunk.lost)
        if len(places):
            timed = chunk.times.valid[places]
            notes.of(topics.DELETED).add(rowid[places], chunk.time_ns[places], timed, steps[places] - 1)
