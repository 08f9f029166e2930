"""What is known of CAN buses so far besides the data they carry: load, remote frames, error frames, faults.

A frame tells neither its sender nor its list: an identifier of a channel is all there is. Data frames have streams as
telegrams have (``nvscope.engine.keys``); which list they belong to is said from outside (``dissectors.can.pdo``).
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import Bool
from dissectors.can.frame import CanBatch
from dissectors.can.pdo import words
from nvscope.engine.dealing import Share, SplitBy
from nvscope.engine.events import EventBatch
from nvscope.engine.told import Told
from nvscope.tracker.can.canopen import CanOpen
from nvscope.tracker.can.errors import CanErrors
from nvscope.tracker.can.load import CanLoad
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.events import EventLog


class BusState:
    """The CAN frames observed so far.

    ``faults`` are frames that could not be read, or not wholly, by (channel, ``dissectors.can.frame.Fault``),
    ``remotes`` those that ask for data, by (channel, identifier as in ``dissectors.can.pdo.words``).
    """

    SPLIT_BY: ClassVar = SplitBy.BUS

    def __init__(self) -> None:
        self.frames = 0
        self.load = CanLoad()
        self.errors = CanErrors()
        self.canopen = CanOpen()
        self.faults = EventLog()
        self.remotes = EventLog()

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        frames, first_frame = told.can, told.first_frame
        for unheard in told.unheard:
            self.errors.resume(unheard)
            self.canopen.resume(unheard)
        if frames is None:
            return
        self.frames += len(frames)
        self._observe_faults(told, frames)
        self.errors.observe(told, frames)
        self.canopen.observe(told, frames)
        beyond = self.load.observe(frames, first_frame, told.max_streams)
        self._observe_remotes(frames, first_frame, beyond)
        self.faults.settle()
        self.remotes.settle()

    def _observe_faults(self, told: Told, frames: CanBatch) -> None:
        wrong = np.flatnonzero(frames.fault)
        if len(wrong):
            channel, fault = (column[wrong].astype(np.int64) for column in (frames.channel, frames.fault))
            time_ns, frame = frames.ts_ns[wrong], frames.row[wrong] + told.first_frame
            self.faults.record(time_ns, frame, channel.astype(np.uint64), fault.astype(np.uint64))
            told.tell(EventBatch.of(EventKind.UNREADABLE_FRAME, time_ns, frame, channel=channel, detail=fault))

    def _observe_remotes(self, frames: CanBatch, first_frame: int, beyond: Bool) -> None:
        asking = np.flatnonzero(frames.remote & ~beyond)
        if len(asking):
            channel, number = frames.channel[asking].astype(np.uint64), words(frames)[asking]
            self.remotes.record(frames.ts_ns[asking], frames.row[asking] + first_frame, channel, number)

    def take(self, part: BusState, share: Share) -> None:
        """Take over what a part has counted of its share of the channels."""
        self.frames += part.frames
        self.load.take(part.load, share)
        self.errors.take(part.errors)
        self.canopen.take(part.canopen)
        self.faults.take(part.faults)
        self.remotes.take(part.remotes)
