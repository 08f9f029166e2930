"""Cycles of lists on CAN: how many frames a list has, and at which interval, may be told from outside."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.can.pdo import PdoRules
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import Keys
from nvscope.engine.rows import DataRows
from nvscope.list_key import Transport
from nvscope.tracker.cycles import Cycles


class PdoColumns(KeyedColumns):
    """One row a stream of ``Keys``: what is told of its list, if it is one on CAN.

    ``interval_ns`` is that at which it is sent, 0 where nobody says; ``several``: it has several frames.
    """

    interval_ns: I64
    several: Bool
    COLUMNS: ClassVar = {"interval_ns": (np.int64(0), 1), "several": (np.False_, 1)}


class CanCycles(Cycles):
    """The cycles of all lists of which a definition says that they have several frames."""

    def __init__(self) -> None:
        super().__init__()
        self._pdos = PdoColumns()

    def observe_frames(
        self, rows: DataRows, usual: Bool, usual_ns: I64, keys: Keys, rules: PdoRules, first_frame: int
    ) -> None:
        """Take the data frames of a batch; ``usual`` and ``usual_ns`` are the intervals that were learned so far.

        Where the interval is told, it need not be learned.
        """
        told, known = self._pdos, len(self._pdos)
        told.resize(len(keys.streams))
        for stream in range(known, len(told)):
            key, _ = keys.place_key(stream)
            if key.transport is Transport.CAN:
                frames, told.interval_ns[stream] = rules.list_of(str(key.port), key.identifier)
                told.several[stream] = frames > 1
        if not told.column("several").any():
            return
        interval_ns = np.where(told.column("interval_ns") > 0, told.column("interval_ns"), usual_ns[: len(told)])
        usual = usual | (told.interval_ns[rows.stream] > 0)
        self.observe(rows, None, usual, interval_ns, keys, first_frame, told.several)
