"""CanIdentifiers: how often each identifier of each channel was sent, when, and how many bits that took."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U64, Bool
from dissectors.can.bits import WireBits
from dissectors.can.frame import CanBatch, Fault
from dissectors.can.pdo import EXTENDED, words
from dissectors.keys import KeyTable
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import add_sums, runs_of, stable_order
from nvscope.tracker.events import EventLog

_STANDARD = 1 << 11
_DENSE_CHANNELS = 64


_LONG = 63
"""So many bytes of data or more share a bit: up to CAN FD only 64 of them."""


class IdentifierColumns(KeyedColumns):
    """One row an identifier of a channel: its frames with and without data, and their exact bits at both bit rates.

    ``lengths`` are those of its data: bit n for n bytes, bit 63 for more, the most of which are ``longest``.
    """

    frames: I64
    bits: I64
    fast_bits: I64
    first_ns: I64
    last_ns: I64
    first_frame: I64
    lengths: U64
    longest: I64
    COLUMNS: ClassVar = {
        name: (np.int64(0), 1)
        for name in ("frames", "bits", "fast_bits", "first_ns", "last_ns", "first_frame", "longest")
    } | {"lengths": (np.uint64(0), 1)}


class CanIdentifiers:
    """The identifiers of all channels, keyed by (channel, identifier, with ``EXTENDED`` if it has 29 bits).

    ``left_out`` are the frames of those beyond the limit, by channel.
    """

    def __init__(self) -> None:
        self.keys = KeyTable()
        self.columns = IdentifierColumns()
        self.left_out = EventLog(words=1)
        # The rows of standard identifiers of the first channels: nearly all frames are found here.
        self._dense = np.empty(0, np.int64)

    def observe(self, frames: CanBatch, bits: WireBits, first_frame: int, most: int) -> Bool:
        """Take the frames of a batch with their exact bits; its first packet is the frame ``first_frame``.

        Of each channel the first ``most`` identifiers are told apart. Return which frames are of further ones.
        """
        beyond = np.zeros(len(frames), np.bool_)
        known = (frames.fault == Fault.NONE) | (frames.fault >= Fault.TRUNCATED)
        known &= ~frames.error
        row = None if known.all() else np.flatnonzero(known)
        if row is not None:
            if not len(row):
                return beyond
            frames, bits = frames.take(row), WireBits(bits.nominal[row], bits.fast[row])
        before = len(self.keys)
        number = self._numbers(frames, most)
        if (number < 0).any():
            own = number < 0
            beyond[np.flatnonzero(known)[own]] = True
            channel = frames.channel[own].astype(np.uint64)
            self.left_out.record(frames.ts_ns[own], frames.row[own] + first_frame, channel)
            self.left_out.settle()
            kept = np.flatnonzero(~own)
            number, frames, bits = number[kept], frames.take(kept), WireBits(bits.nominal[kept], bits.fast[kept])
        rows, columns = len(self.keys), self.columns
        columns.resize(rows)
        if rows > before:
            new, at = np.unique(number, return_index=True)
            new, at = new[new >= before], at[new >= before]
            columns.first_ns[new], columns.first_frame[new] = frames.ts_ns[at], frames.row[at] + first_frame
        columns.frames[:rows] += np.bincount(number, minlength=rows)
        add_sums(columns.bits, number, bits.nominal, rows)
        if bits.fast.any():
            add_sums(columns.fast_bits, number, bits.fast, rows)
        columns.last_ns[number] = frames.ts_ns  # of equal numbers, the last one stays
        _add_lengths(columns, number, frames)
        return beyond

    def lengths_of(self, channel: int, identifier: int, *, extended: bool) -> list[int]:
        """Return how many bytes of data the frames of an identifier had, rising; of those above 62 only the most."""
        word = identifier | (EXTENDED if extended else 0)
        (row,) = self.keys.find(np.array([channel], np.uint64), np.array([word], np.uint64)).tolist()
        if row < 0:
            return []
        seen, longest = int(self.columns.lengths[row]), int(self.columns.longest[row])
        return [longest if length == _LONG else length for length in range(_LONG + 1) if seen >> length & 1]

    def take(self, part: CanIdentifiers) -> None:
        """Take over the identifiers of other channels."""
        self.columns.take_keyed(self.keys, part.columns, part.keys.words)
        self.left_out.take(part.left_out)

    def _numbers(self, frames: CanBatch, most: int) -> I64:
        """Return the rows of frames, adding those that are new, as they come; -1 of those beyond the limit."""
        channels = min(int(frames.channel.max()) + 1, _DENSE_CHANNELS)
        dense = self._dense
        if channels * _STANDARD > len(dense):
            dense = self._dense = np.concatenate([dense, np.full(channels * _STANDARD - len(dense), -1)])
        place = frames.channel.astype(np.int64) * _STANDARD + (frames.identifier & np.uint32(_STANDARD - 1))
        number: I64 = dense.take(place, mode="clip")
        number[frames.extended | (frames.channel >= _DENSE_CHANNELS)] = -1
        other = np.flatnonzero(number < 0)
        if len(other):
            unknown = frames.take(other)
            number[other] = self._number(unknown.channel.astype(np.uint64), words(unknown), most)
            short = other[~unknown.extended & (unknown.channel < _DENSE_CHANNELS)]
            dense[place[short]] = number[short]
        return number

    def _number(self, channel: U64, word: U64, most: int) -> I64:
        """Return the numbers of identifiers; those that are among the first ``most`` of their channel are added."""
        if len(self.keys) + len(word) <= most:
            return self.keys.numbers(channel, word)
        number = self.keys.find(channel, word)
        missing = np.flatnonzero(number < 0)
        fresh = KeyTable()
        seen = fresh.numbers(channel[missing], word[missing])
        # How many of its channel are in front of each new one, those known before among them.
        channels = int(channel.max()) + 1
        known = np.bincount(self.keys.high.astype(np.int64), minlength=channels)
        of_channel = fresh.high.astype(np.int64)
        order = stable_order(of_channel, channels)
        start, stop = runs_of(of_channel[order])
        before = np.empty(len(order), np.int64)
        before[order] = np.arange(len(order)) - np.repeat(start, stop - start) + known[of_channel[order]]
        room = before < most
        self.keys.numbers(fresh.high[room], fresh.low[room])
        kept = missing[room[seen]]
        number[kept] = self.keys.find(channel[kept], word[kept])
        return number


def _add_lengths(columns: IdentifierColumns, number: I64, frames: CanBatch) -> None:
    """Take the lengths of frames with data, the rows of whose identifiers are ``number``."""
    length = frames.length.astype(np.int64)
    bit = np.uint64(1) << np.minimum(length, _LONG).astype(np.uint64)
    # Nearly all frames are as long as those before.
    fresh = np.flatnonzero((bit & ~columns.lengths[number] != 0) & ~frames.remote | (length > _LONG))
    if len(fresh):
        fresh = fresh[~frames.remote[fresh]]
        np.bitwise_or.at(columns.lengths, number[fresh], bit[fresh])
        np.maximum.at(columns.longest, number[fresh], length[fresh])
