"""What is known of CAN buses so far: each identifier of each channel, the load, and error frames.

A frame tells neither its sender nor its list: an identifier of a channel is all there is. Which identifiers belong to
one list is for whoever knows the definitions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U8, U16, U32, Bool
from dissectors.can import DLC_OF_LENGTH, FD_LENGTHS, MAX_FD_DATA_BYTES, CanBatch, Fault
from dissectors.keys import KeyTable
from nvscope.tracker.can_errors import CanErrors
from nvscope.tracker.can_load import CanLoad
from nvscope.tracker.canopen import CanOpen
from nvscope.tracker.columns import Columns, runs_of, stable_order
from nvscope.tracker.events import EventLog
from nvscope.tracker.loss import NodeSteps
from nvscope.tracker.sequence import Step, Steps
from nvscope.tracker.timing import Timing

_NO_LENGTH = -1
_STANDARD = 1 << 11
_LENGTHS = len(FD_LENGTHS)


class CanColumns(Columns):
    """One row a stream: how many data frames it had, when the first and the last, and how long the last one was.

    ``remote`` counts frames that ask for data of this identifier; they are no transmission. ``by_length`` has an entry
    for each of ``dissectors.can.FD_LENGTHS``: how many frames had as much data, or, in CAN FD, no more.
    """

    frames: I64
    remote: I64
    first_ns: I64
    last_ns: I64
    first_frame: I64
    last_frame: I64
    length: I64
    by_length: I64
    COLUMNS: ClassVar = {
        "frames": (np.int64(0), 1),
        "remote": (np.int64(0), 1),
        "first_ns": (np.int64(0), 1),
        "last_ns": (np.int64(0), 1),
        "first_frame": (np.int64(0), 1),
        "last_frame": (np.int64(0), 1),
        "length": (np.int64(_NO_LENGTH), 1),
        "by_length": (np.int64(0), _LENGTHS),
    }


@dataclass(frozen=True, slots=True)
class _Rows:
    """Data frames by stream, within a stream as captured, as ``Timing`` wants them; ``frame`` is their number."""

    packet: I64
    start: I64
    stop: I64
    run_stream: I64
    time_ns: I64
    repeated: Bool | None = None

    def __len__(self) -> int:
        return len(self.packet)


class CanState:
    """The CAN frames observed so far.

    ``streams`` are keyed by (channel, identifier, with ``EXTENDED_KEY`` where it is one of 29 bits). ``lengths`` are
    changes of length by stream, ``faults`` frames that could not be read, or not wholly, by (channel,
    ``dissectors.can.Fault``).
    """

    def __init__(self) -> None:
        self.frames = 0
        self.data_frames = 0
        self.streams = KeyTable()
        # The streams of standard identifiers, by channel and identifier: nearly all frames are found here.
        self._standard = np.empty(0, np.int64)
        self.columns = CanColumns()
        self.timing = Timing()
        self.load = CanLoad()
        self.lengths = EventLog()
        self.errors = CanErrors()
        self.canopen = CanOpen()
        self.faults = EventLog()

    def observe(self, batch: CanBatch, first_frame: int) -> None:
        """Take the CAN frames of a packet batch, whose first packet is the frame ``first_frame``."""
        if not len(batch):
            return
        self.frames += len(batch)
        self._observe_faults(batch, first_frame)
        self.errors.observe(batch, first_frame)
        self.canopen.observe(batch, first_frame)
        self.load.observe(batch, first_frame)
        told = (batch.fault == Fault.NONE) | (batch.fault >= Fault.TRUNCATED)
        told &= ~batch.error
        row = np.flatnonzero(told)
        if not len(row):
            return
        stream = self._numbers(batch.channel[row], batch.identifier[row], batch.extended[row])
        self.columns.resize(len(self.streams))
        remote = batch.remote[row]
        if remote.any():
            np.add.at(self.columns.remote, stream[remote], 1)
            row, stream = row[~remote], stream[~remote]
        self._observe_data(batch, row, stream, first_frame)

    def _numbers(self, channel: U16, identifier: U32, extended: Bool) -> I64:
        """Return the streams of frames, adding those that are new, as they come."""
        channels = int(channel.max()) + 1
        known = self._standard
        if channels * _STANDARD > len(known):
            known = self._standard = np.concatenate([known, np.full(channels * _STANDARD - len(known), -1)])
        place = channel.astype(np.int64) * _STANDARD + (identifier & np.uint32(_STANDARD - 1))
        stream = known[place]
        stream[extended] = -1
        other = np.flatnonzero(stream < 0)
        if len(other):
            word = identifier[other].astype(np.uint64) | (extended[other].astype(np.uint64) << np.uint64(31))
            stream[other] = self.streams.numbers(channel[other].astype(np.uint64), word)
            short = other[~extended[other]]
            known[place[short]] = stream[short]
        return stream

    def _observe_faults(self, batch: CanBatch, first_frame: int) -> None:
        wrong = np.flatnonzero(batch.fault)
        if len(wrong):
            channel, fault = (column[wrong].astype(np.uint64) for column in (batch.channel, batch.fault))
            self.faults.record(channel, fault, batch.ts_ns[wrong], batch.row[wrong] + first_frame)

    def _observe_data(self, batch: CanBatch, row: I64, stream: I64, first_frame: int) -> None:
        if not len(row):
            return
        self.data_frames += len(row)
        order = stable_order(stream, len(self.streams))
        row, stream = row[order], stream[order]
        start, stop = runs_of(stream)
        run, last = stream[start], stop - 1
        rows = _Rows(batch.row[row], start, stop, run, batch.ts_ns[row])
        frame = rows.packet + first_frame
        columns = self.columns
        fresh = columns.frames[run] == 0
        columns.first_ns[run[fresh]], columns.first_frame[run[fresh]] = rows.time_ns[start[fresh]], frame[start[fresh]]
        columns.frames[run] += stop - start
        columns.last_ns[run], columns.last_frame[run] = rows.time_ns[last], frame[last]
        length = batch.length[row].astype(np.int64)
        code = DLC_OF_LENGTH[np.minimum(length, MAX_FD_DATA_BYTES)]
        streams = len(columns)
        counts = np.bincount(stream * _LENGTHS + code, minlength=streams * _LENGTHS)
        columns.by_length[:streams] += counts.reshape(streams, _LENGTHS)
        before = np.empty_like(length)
        before[1:] = length[:-1]
        before[start] = columns.length[run]
        columns.length[run] = length[last]
        changed = np.flatnonzero((length != before) & (before != _NO_LENGTH))
        if len(changed):
            changed = changed[np.argsort(rows.packet[changed], kind="stable")]
            nothing = np.zeros(len(changed), np.uint64)
            self.lengths.record(stream[changed].astype(np.uint64), nothing, rows.time_ns[changed], frame[changed])
        self.timing.observe(
            rows, _no_steps(len(rows)), NodeSteps(np.zeros(len(rows), np.int64)), len(columns), first_frame
        )


def _no_steps(count: int) -> Steps:
    """Return the steps of frames that carry no counter: each as if it were the next."""
    step: U8 = np.full(count, Step.REGULAR, np.uint8)
    nothing = np.zeros(0, np.uint16)
    return Steps(step, nothing, nothing, nothing.astype(np.uint64), np.empty(0, np.int64))
