"""SenderState: what follows from each sender's telegrams in turn: loss by its Counter, intervals, cycles."""

from __future__ import annotations

from typing import ClassVar

from nvscope.engine.dealing import Share, SplitBy
from nvscope.engine.rows import DataRows
from nvscope.engine.told import Told
from nvscope.tracker.can.cycles import CanCycles
from nvscope.tracker.cycles import Cycles
from nvscope.tracker.loss import Loss
from nvscope.tracker.mirrored import Mirrored
from nvscope.tracker.node_steps import NodeSteps, NoNodeSteps, no_steps
from nvscope.tracker.recent import Recent
from nvscope.tracker.steps import Steps
from nvscope.tracker.timing import BatchIntervals, Timing


class SenderState:
    """The well-formed data telegrams of each sender, and the data frames of each CAN channel.

    ``recent`` are the intervals of the last minute, None unless they are wanted: to keep them takes time.
    """

    SPLIT_BY: ClassVar = SplitBy.SENDER

    def __init__(self, *, recent: bool = False) -> None:
        self.loss = Loss()
        self.mirrored = Mirrored()
        self.timing = Timing()
        self.recent = Recent() if recent else None
        self.cycles = Cycles()
        self.can_cycles = CanCycles()
        self.intervals: list[BatchIntervals] = []
        """Those that the last batch ended."""

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        rows, keys = told.laid.data, told.keys
        self.intervals = []
        self.cycles.over = self.can_cycles.over = None
        if len(rows):
            own, nodes = self.loss.observe(told, rows)
            intervals = self._observe_intervals(told, rows, own, nodes)
            self.cycles.observe(told, rows, rows.counter, intervals.usual, self.timing.columns.usual_ns)
        frames = told.laid.pdos
        if len(frames):
            # They have a time, a length and variables, and nothing else to go by.
            self.loss.streams.resize(len(keys.streams))
            intervals = self._observe_intervals(told, frames, *no_steps(len(frames)))
            usual_ns = self.timing.columns.usual_ns
            self.can_cycles.observe_frames(told, frames, intervals.usual, usual_ns)
        self.mirrored.observe(told, self.loss.streams)
        for unheard in told.unheard:
            for part in (self.loss, self.timing, self.cycles, self.can_cycles):
                part.resume(unheard)

    def _observe_intervals(
        self, told: Told, rows: DataRows, own: Steps, nodes: NodeSteps | NoNodeSteps
    ) -> BatchIntervals:
        intervals = self.timing.observe(told, rows, own, nodes)
        self.intervals.append(intervals)
        if self.recent is not None and len(intervals):
            self.recent.observe(intervals.stream, intervals.time_ns, intervals.interval_ns)
        return intervals

    def take(self, part: SenderState, share: Share) -> None:
        """Take over what a part has counted of its share of the senders."""
        self.loss.take(part.loss, share)
        self.mirrored.take(part.mirrored, share)
        self.timing.take(part.timing, share)
        if self.recent is not None and part.recent is not None:
            self.recent.take(part.recent)
        self.cycles.take(part.cycles, share)
        self.can_cycles.take(part.can_cycles, share)
