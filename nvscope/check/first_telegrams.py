"""The first telegram of each stream behind the warm-up, so that a verdict about who sends can show one."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.told import Told


class FirstTelegrams:
    """An observer that keeps the frame of each stream's first telegram from ``since_ns`` on, None for all."""

    by_stream: ClassVar[bool] = True

    def __init__(self, since_ns: int | None = None) -> None:
        self._since_ns = since_ns
        self._streams = _FirstColumns()

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not len(told):
            return
        self._streams.resize(len(told.keys.streams))
        frame = self._streams.column("frame")
        for rows in (told.laid.data, told.laid.pdos):
            if not len(rows):
                continue
            new = np.flatnonzero(frame[rows.run_stream] == 0)
            if not len(new):
                continue
            if self._since_ns is None:
                frame[rows.run_stream[new]] = rows.packet[rows.start[new]] + told.first_frame
                continue
            for run in new.tolist():
                start, stop = int(rows.start[run]), int(rows.stop[run])
                behind = np.flatnonzero(rows.time_ns[start:stop] >= self._since_ns)
                if len(behind):
                    frame[rows.run_stream[run]] = rows.packet[start + behind[0]] + told.first_frame

    def frame(self, stream: int) -> int | None:
        """Return that of a stream, None where none has come."""
        frame = self._streams.column("frame")
        return int(frame[stream]) or None if stream < len(frame) else None


class _FirstColumns(KeyedColumns):
    """One row a stream: the number of a frame, 0 for none."""

    frame: I64
    COLUMNS: ClassVar = {"frame": (np.int64(0), 1)}
