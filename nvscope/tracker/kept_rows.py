"""KeptRows: the telegrams of a batch between which intervals are measured, and whether any were lost between them."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.node_steps import NodeSteps, NoNodeSteps
from nvscope.tracker.steps import Step, Steps

_FEW = 8  # of the rows, up to one in so many is few
LOSS_OF_STREAM, LOSS_OF_NODE = 1, 2
"""Bits of an unusual interval's key: there was a gap in it, by the stream's counters or by the node's."""


class TimedRows(Protocol):
    """Telegrams of a batch by stream, within a stream as captured; columns as those of ``DataRows``."""

    @property
    def packet(self) -> I64: ...

    @property
    def start(self) -> I64: ...

    @property
    def stop(self) -> I64: ...

    @property
    def run_stream(self) -> I64: ...

    @property
    def time_ns(self) -> I64: ...

    def __len__(self) -> int: ...


class KeptRows:
    """The rows of a batch without some, ``absent`` (rising), counted anew.

    ``start`` and ``stop`` bound the runs of one stream that is left, ``run``.
    """

    def __init__(self, rows: TimedRows, absent: I64) -> None:
        self.absent = absent
        bounds = np.append(rows.start, len(rows))
        bounds -= np.searchsorted(absent, bounds)
        left = np.flatnonzero(bounds[1:] > bounds[:-1])
        self.run, self.start, self.stop = rows.run_stream[left], bounds[left], bounds[left + 1]
        self._absent_place = absent - np.arange(len(absent))

    def rows(self, place: I64) -> I64:
        """Return the rows that places are."""
        if not len(self.absent):
            return place
        rows: I64 = place + np.searchsorted(self._absent_place, place, "right")
        return rows

    def streams(self, place: I64) -> I64:
        """Return the streams of places."""
        if len(place) * _FEW > self.stop[-1]:
            return np.repeat(self.run, self.stop - self.start)[place]
        streams: I64 = self.run[np.searchsorted(self.start, place, "right") - 1]
        return streams

    def places(self, row: I64) -> I64:
        """Return the places of rows that are not absent."""
        if not len(self.absent):
            return row
        places: I64 = row - np.searchsorted(self.absent, row)
        return places


class LossBefore:
    """Tells where telegrams were lost since the one kept before; ``gaps`` are the node's at that of each run."""

    def __init__(self, kept: KeptRows, own: Steps, nodes: NodeSteps | NoNodeSteps, gaps: I64) -> None:
        self._kept, self._own, self._nodes, self._gaps = kept, own, nodes, gaps

    def bits(self, row: I64) -> I64:
        """Return the loss bits of rows."""
        kept, gaps = self._kept, self._nodes.gaps
        place = kept.places(row)
        if len(row) * _FEW > kept.stop[-1]:
            # Of so many, all are looked at in order.
            every = np.delete(self._nodes.all_gaps, kept.absent)
            earlier = np.empty_like(every)
            earlier[1:] = every[:-1]
            earlier[kept.start] = self._gaps
            now, before = every[place], earlier[place]
        else:
            run = np.searchsorted(kept.start, place, "right") - 1
            begins = kept.start[run] == place
            now = gaps(row)
            before = np.where(begins, self._gaps[run], gaps(kept.rows(np.maximum(place - 1, 0))))
        of_stream = self._own.step[row] == Step.GAP
        bits: I64 = of_stream * LOSS_OF_STREAM | (now != before) * LOSS_OF_NODE
        return bits
