"""How busy each CAN bus was: the bits of each second and identifier by channel, and what tells the bit rate."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.can.bits import Stuffing, wire_bits
from dissectors.can.frame import CanBatch
from dissectors.keys import KeyTable
from nvscope.engine.dealing import Share
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import add_sums, runs_of
from nvscope.tracker.can.bit_rate import BackToBack
from nvscope.tracker.can.identifiers import CanIdentifiers

_S_NS = 1_000_000_000
BEFORE_1970 = 1 << 62
"""What is added to seconds since 1970, so that none is below 0."""

_FEW_KEYS = 1 << 16


class SecondColumns(KeyedColumns):
    """One row a channel and second.

    ``exact_bits`` and ``worst_bits`` are those at the nominal bit rate, with the stuff bits that the frames have, or
    that they can have at most; ``fast_bits`` (exact) those at the data bit rate of CAN FD.
    """

    frames: I64
    exact_bits: I64
    worst_bits: I64
    fast_bits: I64
    worst_fast_bits: I64
    COLUMNS: ClassVar = {
        name: (np.int64(0), 1) for name in ("frames", "exact_bits", "worst_bits", "fast_bits", "worst_fast_bits")
    }


class CanLoad:
    """The bits of all channels by second, keyed by (channel, second since 1970, offset by 2^62).

    Memory grows with the seconds of the recording, not with its frames.
    """

    def __init__(self) -> None:
        self.keys = KeyTable()
        self.columns = SecondColumns()
        self.identifiers = CanIdentifiers()
        self.back_to_back = BackToBack()

    def observe(self, frames: CanBatch, first_frame: int, most: int) -> Bool:
        """Take the frames of a batch, at least one; its first packet is the frame ``first_frame``.

        Return which of them are of identifiers beyond the first ``most`` of their channel.
        """
        number = self._numbers(frames)
        columns = self.columns
        columns.resize(len(self.keys))
        exact, worst = wire_bits(frames, Stuffing.EXACT), wire_bits(frames, Stuffing.WORST)
        rows = len(self.keys)
        columns.frames[:rows] += np.bincount(number, minlength=rows)
        add_sums(columns.exact_bits, number, exact.nominal, rows)
        add_sums(columns.worst_bits, number, worst.nominal, rows)
        if exact.fast.any():
            add_sums(columns.fast_bits, number, exact.fast, rows)
            add_sums(columns.worst_fast_bits, number, worst.fast, rows)
        self.back_to_back.observe(frames, exact.nominal)
        return self.identifiers.observe(frames, exact, first_frame, most)

    def take(self, part: CanLoad, share: Share) -> None:
        """Take over the bits of a part's share of the channels."""
        self.columns.take_keyed(self.keys, part.columns, part.keys.words)
        self.identifiers.take(part.identifiers)
        self.back_to_back.take(part.back_to_back, share)

    def _numbers(self, frames: CanBatch) -> I64:
        """Return the row of each frame's channel and second."""
        second = frames.ts_ns // _S_NS
        first, last = int(second.min()), int(second.max())
        channels = int(frames.channel.max()) + 1
        if (last - first + 1) * channels > _FEW_KEYS:
            return self.keys.numbers(
                frames.channel.astype(np.uint64), (second + BEFORE_1970).astype(np.uint64)
            )  # fmt: skip
        # Of the few that a batch mostly has, each is looked up once.
        local = (second - first) * channels + frames.channel
        seen = np.flatnonzero(np.bincount(local))
        number = np.zeros((last - first + 1) * channels, np.int64)
        number[seen] = self.keys.numbers(
            (seen % channels).astype(np.uint64), (seen // channels + first + BEFORE_1970).astype(np.uint64)
        )
        own: I64 = number[local]
        return own


def rows_by_channel(keys: KeyTable) -> dict[int, I64]:
    """Return which rows are those of each channel, its number being the first word of their keys, by the second."""
    order = np.lexsort((keys.low, keys.high))
    channel = keys.high[order].astype(np.int64)
    start, stop = runs_of(channel)
    runs = zip(channel[start].tolist(), start.tolist(), stop.tolist(), strict=True)
    return {number: order[first:last] for number, first, last in runs}
