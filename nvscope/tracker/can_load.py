"""How busy each CAN bus was: the bits of each second, by channel."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64
from dissectors.can import CanBatch
from dissectors.can_bits import Stuffing, wire_bits
from dissectors.keys import KeyTable
from nvscope.tracker.columns import Columns

_S_NS = 1_000_000_000
_BEFORE_1970 = 1 << 62
_FEW_KEYS = 1 << 16


class SecondColumns(Columns):
    """One row a channel and second.

    ``exact_bits`` and ``worst_bits`` are those at the nominal bit rate, with the stuff bits that the frames have, or
    that they can have at most; ``fast_bits`` (exact) those at the data bit rate of CAN FD.
    """

    frames: I64
    exact_bits: I64
    worst_bits: I64
    fast_bits: I64
    COLUMNS: ClassVar = {name: (np.int64(0), 1) for name in ("frames", "exact_bits", "worst_bits", "fast_bits")}


class CanLoad:
    """The bits of all channels by second, keyed by (channel, second since 1970, offset by 2^62).

    Memory grows with the seconds of the recording, not with its frames.
    """

    def __init__(self) -> None:
        self.keys = KeyTable()
        self.columns = SecondColumns()

    def observe(self, frames: CanBatch) -> None:
        """Take the frames of a batch."""
        if not len(frames):
            return
        number = self._numbers(frames)
        columns = self.columns
        columns.resize(len(self.keys))
        exact, worst = wire_bits(frames, Stuffing.EXACT), wire_bits(frames, Stuffing.WORST)
        rows = len(self.keys)
        columns.frames[:rows] += np.bincount(number, minlength=rows)
        for column, bits in (
            (columns.exact_bits, exact.nominal), (columns.worst_bits, worst.nominal), (columns.fast_bits, exact.fast),
        ):  # fmt: skip
            # Sums of a batch stay far below the 2^53 up to which they are exact.
            column[:rows] += np.bincount(number, bits, minlength=rows).astype(np.int64)

    def _numbers(self, frames: CanBatch) -> I64:
        """Return the row of each frame's channel and second."""
        second = frames.ts_ns // _S_NS
        first, last = int(second.min()), int(second.max())
        channels = int(frames.channel.max()) + 1
        if (last - first + 1) * channels > _FEW_KEYS:
            return self.keys.numbers(
                frames.channel.astype(np.uint64), (second + _BEFORE_1970).astype(np.uint64)
            )  # fmt: skip
        # Of the few that a batch mostly has, each is looked up once.
        local = (second - first) * channels + frames.channel
        seen = np.flatnonzero(np.bincount(local))
        number = np.zeros((last - first + 1) * channels, np.int64)
        number[seen] = self.keys.numbers(
            (seen % channels).astype(np.uint64), (seen // channels + first + _BEFORE_1970).astype(np.uint64)
        )
        own: I64 = number[local]
        return own

    def seconds_of(self, channel: int) -> tuple[I64, SecondColumns]:
        """Return the rows of a channel by time, as places in ``columns``, and these."""
        own = np.flatnonzero(self.keys.high == channel)
        order = np.argsort(self.keys.low[own], kind="stable")
        return own[order], self.columns
