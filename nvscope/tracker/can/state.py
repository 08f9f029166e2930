"""What is known of CAN buses so far besides the data they carry: load, remote frames, error frames, faults.

A frame tells neither its sender nor its list: an identifier of a channel is all there is. Data frames have streams as
telegrams have (``nvscope.engine.keys``); which list they belong to is said from outside (``dissectors.can.pdo``).
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.can.frame import CanBatch
from dissectors.can.pdo import PdoRules, words
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import Keys
from nvscope.engine.rows import DataRows
from nvscope.tracker.can.canopen import CanOpen
from nvscope.tracker.can.errors import CanErrors
from nvscope.tracker.can.load import CanLoad
from nvscope.tracker.cycles import Cycles
from nvscope.tracker.events import EventLog
from nvscope.tracker.loss import NodeSteps
from nvscope.tracker.steps import Step, Steps


class PdoColumns(KeyedColumns):
    """One row a stream of ``Keys``: what is told of its list, if it is one on CAN.

    ``interval_ns`` is that at which it is sent, 0 where nobody says; ``several``: it has several frames.
    """

    interval_ns: I64
    several: Bool
    COLUMNS: ClassVar = {"interval_ns": (np.int64(0), 1), "several": (np.False_, 1)}


class CanState:
    """The CAN frames observed so far.

    ``faults`` are frames that could not be read, or not wholly, by (channel, ``dissectors.can.frame.Fault``),
    ``remotes`` those that ask for data, by (channel, identifier as in ``dissectors.can.pdo.words``).
    """

    def __init__(self) -> None:
        self.frames = 0
        self.load = CanLoad()
        self.cycles = Cycles()
        self.pdos = PdoColumns()
        self.errors = CanErrors()
        self.canopen = CanOpen()
        self.faults = EventLog()
        self.remotes = EventLog()

    def observe(self, frames: CanBatch, first_frame: int) -> None:
        """Take the CAN frames of a packet batch, whose first packet is the frame ``first_frame``."""
        self.frames += len(frames)
        self._observe_faults(frames, first_frame)
        self._observe_remotes(frames, first_frame)
        self.errors.observe(frames, first_frame)
        self.canopen.observe(frames, first_frame)
        self.load.observe(frames, first_frame)

    def observe_cycles(
        self, rows: DataRows, usual: Bool, usual_ns: I64, keys: Keys, rules: PdoRules, first_frame: int
    ) -> None:
        """Take the data frames of a batch; ``usual`` and ``usual_ns`` are the intervals that were learned so far.

        Where the interval is told, it need not be learned.
        """
        told, known = self.pdos, len(self.pdos)
        told.resize(len(keys.streams))
        for stream in range(known, len(told)):
            (channel, cob_id), _ = keys.place_key(stream)
            if isinstance(channel, str):
                frames, told.interval_ns[stream] = rules.list_of(channel, cob_id)
                told.several[stream] = frames > 1
        if not told.column("several").any():
            return
        interval_ns = np.where(told.column("interval_ns") > 0, told.column("interval_ns"), usual_ns[: len(told)])
        usual = usual | (told.interval_ns[rows.stream] > 0)
        self.cycles.observe(rows, None, usual, interval_ns, keys, first_frame, told.several)

    def _observe_faults(self, frames: CanBatch, first_frame: int) -> None:
        wrong = np.flatnonzero(frames.fault)
        if len(wrong):
            channel, fault = (column[wrong].astype(np.uint64) for column in (frames.channel, frames.fault))
            self.faults.record(channel, fault, frames.ts_ns[wrong], frames.row[wrong] + first_frame)

    def _observe_remotes(self, frames: CanBatch, first_frame: int) -> None:
        asking = np.flatnonzero(frames.remote)
        if len(asking):
            channel, number = frames.channel[asking].astype(np.uint64), words(frames)[asking]
            self.remotes.record(channel, number, frames.ts_ns[asking], frames.row[asking] + first_frame)


def no_steps(count: int) -> tuple[Steps, NodeSteps]:
    """Return the steps of frames that carry no counter, of their streams and nodes: each as if it were the next."""
    step: U8 = np.full(count, Step.REGULAR, np.uint8)
    nothing = np.zeros(0, np.uint16)
    own = Steps(step, nothing, nothing, nothing.astype(np.uint64), np.empty(0, np.int64))
    return own, NodeSteps(np.zeros(count, np.int64))
