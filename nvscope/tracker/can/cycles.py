"""Cycles of lists on CAN: how many frames a list has, and at which interval, may be told from outside."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.rows import DataRows
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
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

    def resume(self, unheard: Unheard) -> None:
        """Leave open what is open of the unheard, for it is no cycle; what follows counts from its first frame on."""
        self._forget_open(unheard)

    def observe_frames(self, told: Told, rows: DataRows, usual: Bool, usual_ns: I64) -> None:
        """Take the data frames of a batch; ``usual`` and ``usual_ns`` are the intervals that were learned so far.

        Where a definition says the interval, it need not be learned.
        """
        pdos, known, keys = self._pdos, len(self._pdos), told.keys
        pdos.resize(len(keys.streams))
        for stream in range(known, len(pdos)) if told.pdos.lists else ():
            key, _ = keys.place_key(stream)
            if key.transport is Transport.CAN:
                frames, pdos.interval_ns[stream] = told.pdos.list_of(str(key.port), key.identifier)
                pdos.several[stream] = frames > 1
        if not pdos.column("several").any():
            return
        interval_ns = np.where(pdos.column("interval_ns") > 0, pdos.column("interval_ns"), usual_ns[: len(pdos)])
        usual = usual | (pdos.interval_ns[rows.stream] > 0)
        self.observe(told, rows, None, usual, interval_ns, pdos.several)
