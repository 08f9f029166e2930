"""Throughput: how much was captured in each tenth of a second."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64
from dissectors.keys import KeyTable
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.told import Told

SLOT_NS = 100_000_000

MOST_SLOTS = 1 << 20
"""So many slots with frames are kept, 29 hours without a pause; frames in others are counted."""


class SlotColumns(KeyedColumns):
    """One row a slot in which there were frames: how many, and how many bytes they had on the wire."""

    frames: I64
    bytes: I64
    COLUMNS: ClassVar = {"frames": (np.int64(0), 1), "bytes": (np.int64(0), 1)}


class Throughput:
    """An observer of all frames.

    ``slots`` number the slots, by time // ``SLOT_NS`` as a 64-bit word, in the order in which they were seen; they are
    the rows of ``columns``. ``left_out`` counts the frames for which there was no room.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, most: int = MOST_SLOTS) -> None:
        self._most = most
        self.slots = KeyTable(1)
        self.columns = SlotColumns()
        self.left_out = 0

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        packets = told.packets
        slot = (packets.ts_ns // SLOT_NS).view(np.uint64)
        number = self.slots.numbers_within(self._most, slot)
        room = number >= 0
        self.left_out += len(slot) - int(np.count_nonzero(room))
        self.columns.resize(len(self.slots))
        np.add.at(self.columns.frames, number[room], 1)
        np.add.at(self.columns.bytes, number[room], packets.original[room])
