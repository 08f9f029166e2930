"""Flows: how often, when first and when last each flow was seen.

Every count of NetVarUDPDiagStruct but the errors is a sum over flows (``nvscope.tracker.summary``).
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from dissectors.batch import I64
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import Keys
from nvscope.engine.told import Told


class FlowCounts(KeyedColumns):
    """One row a flow. ``chosen`` counts the telegrams that a filter chose, where there is one."""

    count: I64
    mismatches: I64
    chosen: I64
    first_ns: I64
    first_frame: I64
    last_ns: I64
    last_frame: I64
    COLUMNS: ClassVar = {
        name: (np.int64(0), 1)
        for name in ("count", "mismatches", "chosen", "first_ns", "first_frame", "last_ns", "last_frame")
    }


class Flows:
    """The counts of all flows; what a flow is stands in ``keys``."""

    def __init__(self) -> None:
        self.keys = Keys()
        self.counts = FlowCounts()

    def observe(self, told: Told) -> None:
        """Count the telegrams of a batch."""
        keys = self.keys = told.keys
        counts, varieties, time_ns = self.counts, keys.varieties, told.packets.ts_ns
        counts.resize(len(keys.flows))
        begun = told.begun
        counts.first_ns[begun.flow], counts.first_frame[begun.flow] = (
            time_ns[begun.packet],
            begun.packet + told.first_frame,
        )
        last = _last_packets(told, len(varieties))
        seen = np.flatnonzero((told.count > 0) & (varieties.column("flow") >= 0))
        # A flow may be of several varieties: the last telegram of all is what stays.
        seen = seen[np.argsort(last[seen])]
        flow, last = varieties.flow[seen], last[seen]
        np.add.at(counts.count, flow, told.count[seen])
        counts.last_ns[flow], counts.last_frame[flow] = time_ns[last], last + told.first_frame
        if told.chosen is not None:
            chosen = np.bincount(told.variety[told.chosen], minlength=len(varieties))
            some = np.flatnonzero((chosen > 0) & (varieties.column("flow") >= 0))
            np.add.at(counts.chosen, varieties.flow[some], chosen[some])

    def column(self, name: str) -> Any:
        """Return a column by flow, of what it is or of what was counted."""
        table = self.counts if name in FlowCounts.COLUMNS else self.keys.columns
        return table.column(name)


def _last_packets(told: Told, varieties: int) -> I64:
    """Return the last packet of each variety that the batch has."""
    last, rows = np.empty(varieties, np.int64), told.laid.data
    # Of numbers that are assigned to one place, the last one stays.
    last[told.variety[rows.others]] = rows.others
    last[rows.variety[rows.stop - 1]] = rows.packet[rows.stop - 1]
    mixed = rows.of_runs(rows.several)
    last[rows.variety[mixed]] = rows.packet[mixed]
    return last
