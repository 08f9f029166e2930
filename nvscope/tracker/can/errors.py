"""CanErrors: what the error frames of each channel tell, how long its controller was off the bus, and how it fared."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U64, Bool
from dissectors.can.error import (
    CLASSES,
    CONTROLLER,
    CONTROLLER_BITS,
    COUNTERS,
    UNTOLD_CLASS,
    ErrorDetails,
    error_details,
)
from dissectors.can.frame import CanBatch
from dissectors.keys import KeyTable
from nvscope.engine.events import EventBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.events import EventLog

_UNTOLD = -1
_ON, _OFF, _OFF_AT_LAST = range(3)
_STATES = len(CONTROLLER_BITS)
_NAME_OF_MASK = {bit.mask: bit.name for bit in CLASSES} | {0: UNTOLD_CLASS}


class _ChannelColumns(KeyedColumns):
    """One row a channel with error frames.

    ``off`` is ``_OFF`` while its controller is off the bus, since ``off_since_ns``, and ``_OFF_AT_LAST`` where it was
    so up to ``off_until_ns``, after which nobody has listened yet; ``off_ns`` and ``longest_off_ns`` are of
    the times that have ended. ``states`` counts by bit of ``CONTROLLER_BITS``; the error counters are the highest, -1
    where none were told.
    """

    off: I64
    off_since_ns: I64
    off_until_ns: I64
    bus_offs: I64
    restarts: I64
    returns: I64
    off_ns: I64
    longest_off_ns: I64
    states: I64
    tx_errors: I64
    rx_errors: I64
    COLUMNS: ClassVar = {
        "off": (np.int64(0), 1),
        "off_since_ns": (np.int64(0), 1),
        "off_until_ns": (np.int64(0), 1),
        "bus_offs": (np.int64(0), 1),
        "restarts": (np.int64(0), 1),
        "returns": (np.int64(0), 1),
        "off_ns": (np.int64(0), 1),
        "longest_off_ns": (np.int64(0), 1),
        "states": (np.int64(0), _STATES),
        "tx_errors": (np.int64(_UNTOLD), 1),
        "rx_errors": (np.int64(_UNTOLD), 1),
    }


class BusErrors(Struct, frozen=True):
    """The error frames of a channel.

    ``frames`` are the first ten of ``count``; without any, ``first_ns`` and ``last_ns`` are None. ``classes`` are those
    of ``dissectors.can.error.CLASS_LABELS`` by how many frames told them, ``states`` likewise those of
    ``CONTROLLER_BITS``; both by name, and only what was told.
    ``bus_offs`` counts how often the controller left the bus; ``restarts`` of them ended by a frame that says so,
    ``returns`` by frames on the bus again; ``off_ns`` is how long that took in all. ``off_since_ns`` is None unless it
    was off at the end; ``off_until_ns`` is that end where the channel was listened to no longer, else None. The error
    counters are the highest that were told, None without any.
    """

    count: int
    first_ns: int | None
    last_ns: int | None
    frames: tuple[int, ...]
    classes: Mapping[str, int]
    states: Mapping[str, int]
    bus_offs: int
    restarts: int
    returns: int
    off_ns: int
    longest_off_ns: int
    off_since_ns: int | None
    off_until_ns: int | None
    tx_errors: int | None
    rx_errors: int | None


class CanErrors:
    """The error frames of all channels. ``classes`` are events by (channel, class bit, 0 for no class), ``all`` by
    (channel, 0).

    ``channels`` number the rows of ``columns``.
    """

    def __init__(self) -> None:
        self.classes = EventLog()
        self.all = EventLog()
        self.channels = KeyTable(1)
        self.columns = _ChannelColumns()

    def observe(self, told: Told, batch: CanBatch) -> None:
        """Take the CAN frames of what is told."""
        error = np.flatnonzero(batch.error)
        if not len(error) and not self.columns.column("off").any():
            return
        details = error_details(batch)
        if len(error):
            channel = batch.channel[error].astype(np.uint64)
            number = self.channels.numbers(channel)
            self.columns.resize(len(self.channels))
            time_ns, frame = batch.ts_ns[error], batch.row[error] + told.first_frame
            self._count(details, channel, number, time_ns, frame)
            on, classes = channel.astype(np.int64), details.classes.astype(np.int64)
            told.tell(EventBatch.of(EventKind.ERROR_FRAME, time_ns, frame, channel=on, detail=classes))
            self.all.settle()
            self.classes.settle()
        self._observe_bus_off(told, batch, details)

    def resume(self, unheard: Unheard) -> None:
        """Leave the controllers on unheard channels as they are: nobody will know when they came back."""
        number = self.channels.find(unheard.channels.astype(np.uint64))
        number = number[number >= 0]
        number = number[self.columns.off[number] == _OFF]
        self.columns.off[number] = _OFF_AT_LAST
        self.columns.off_until_ns[number] = unheard.until_ns

    def take(self, part: CanErrors) -> None:
        """Take over the error frames of other channels."""
        self.classes.take(part.classes)
        self.all.take(part.all)
        self.columns.take_keyed(self.channels, part.columns, part.channels.words)

    def _count(self, details: ErrorDetails, channel: U64, number: I64, time_ns: I64, frame: I64) -> None:
        columns = self.columns
        self.all.record(time_ns, frame, channel, np.zeros_like(channel))
        for bit in CLASSES:
            own = np.flatnonzero(details.classes & np.uint16(bit.mask))
            if len(own):
                mask = np.full(len(own), bit.mask, np.uint64)
                self.classes.record(time_ns[own], frame[own], channel[own], mask)
        untold = np.flatnonzero(details.classes == 0)
        if len(untold):
            self.classes.record(time_ns[untold], frame[untold], channel[untold], np.zeros(len(untold), np.uint64))
        for place, bit in enumerate(CONTROLLER_BITS):
            own = np.flatnonzero(details.controller & np.uint8(bit.mask))
            np.add.at(columns.states[:, place], number[own], 1)
        # Drivers before Linux 6.0 fill the counters in where they tell of the controller, and say so nowhere.
        told = details.classes & np.uint16(COUNTERS) != 0
        told |= (details.classes & np.uint16(CONTROLLER) != 0) & ((details.tx_errors | details.rx_errors) != 0)
        for highest, counter in ((columns.tx_errors, details.tx_errors), (columns.rx_errors, details.rx_errors)):
            np.maximum.at(highest, number[told], counter[told].astype(np.int64))

    def _observe_bus_off(self, told: Told, batch: CanBatch, details: ErrorDetails) -> None:
        """Note when controllers leave the bus and come back: told, or shown by any frame that is on the bus."""
        columns = self.columns
        leaves: Bool = np.zeros(len(batch), np.bool_)
        leaves[details.position] = details.bus_off
        if not leaves.any() and not columns.column("off").any():
            return
        back = ~batch.error
        back[details.position] |= details.recovered
        number = self.channels.find(batch.channel.astype(np.uint64))
        row = np.flatnonzero((leaves | back) & (number >= 0))
        row = row[stable_order(number[row], len(self.channels))]
        if not len(row):
            return
        number, time_ns, off = number[row], batch.ts_ns[row], leaves[row]
        start, stop = runs_of(number)
        run = number[start]
        before: Bool = np.empty_like(off)
        before[1:] = off[:-1]
        before[start] = columns.off[run] == _OFF
        begins, ends = off & ~before, np.flatnonzero(~off & before)
        # Of each end the beginning: the last one in front of it, or one in an earlier batch.
        begin = np.maximum.accumulate(np.where(begins, np.arange(len(row)), -1))
        first = np.repeat(start, stop - start)
        since_ns = np.where(begin >= first, time_ns[begin], columns.off_since_ns[number])
        np.add.at(columns.bus_offs, number[begins], 1)
        took_ns = np.maximum(time_ns[ends] - since_ns[ends], 0)
        np.add.at(columns.off_ns, number[ends], took_ns)
        np.maximum.at(columns.longest_off_ns, number[ends], took_ns)
        said = batch.error[row[ends]]
        np.add.at(columns.restarts, number[ends[said]], 1)
        np.add.at(columns.returns, number[ends[~said]], 1)
        columns.off[run], columns.off_since_ns[run] = off[stop - 1], since_ns[stop - 1]
        channel, frame = batch.channel[row].astype(np.int64), batch.row[row] + told.first_frame
        told.tell(EventBatch.of(EventKind.BUS_OFF, time_ns[begins], frame[begins], channel=channel[begins]))
        told.tell(
            EventBatch.of(
                EventKind.BUS_BACK, time_ns[ends], frame[ends], channel=channel[ends], since_ns=since_ns[ends],
                detail=said.astype(np.int64),
            )
        )  # fmt: skip

    def by_channel(self) -> dict[int, BusErrors]:
        """Return what is known of each channel with error frames, or, of a window, that they had put off the bus."""
        classes: dict[int, dict[str, int]] = {}
        keys = zip(self.classes.keys.high.tolist(), self.classes.keys.low.tolist(), strict=True)
        for row, (channel, mask) in sorted(enumerate(keys), key=lambda pair: pair[1]):
            if frames := int(self.classes.rows.count[row]):
                classes.setdefault(channel, {})[_NAME_OF_MASK[mask]] = frames
        found = {}
        events, columns, channels = self.all.rows, self.columns, self.all.keys.high
        rows = zip(channels.tolist(), self.channels.find(channels).tolist(), strict=True)
        for row, (channel, number) in enumerate(rows):
            count = int(events.count[row])
            # In a window without any, it can be off the bus, or come back to it.
            if not (count or columns.off[number] or columns.returns[number]):
                continue
            states = zip(CONTROLLER_BITS, columns.states[number].tolist(), strict=True)
            found[channel] = BusErrors(
                count, int(events.first_ns[row]) if count else None, int(events.last_ns[row]) if count else None,
                tuple(frame for frame in events.frames[row].tolist() if frame),
                MappingProxyType(classes.get(channel, {})),
                MappingProxyType({bit.name: times for bit, times in states if times}),
                int(columns.bus_offs[number]), int(columns.restarts[number]), int(columns.returns[number]),
                int(columns.off_ns[number]), int(columns.longest_off_ns[number]),
                int(columns.off_since_ns[number]) if columns.off[number] else None,
                int(columns.off_until_ns[number]) if columns.off[number] == _OFF_AT_LAST else None,
                _told(columns.tx_errors[number]), _told(columns.rx_errors[number]),
            )  # fmt: skip
        return found


def _told(counter: np.int64) -> int | None:
    return None if counter == _UNTOLD else int(counter)
