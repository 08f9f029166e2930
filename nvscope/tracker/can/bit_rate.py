"""BackToBack: the bit rate of a CAN bus, found from frames that follow each other without a gap.

Of two such frames, the time stamps are as far apart as the second one is long (if frames are stamped at their end, as
controllers do), or the first one (at their start). So the bits of a frame, over the distance of the stamps, is the bit
rate where frames are back to back, and less elsewhere. Neither is enough: a list of 125 bits a millisecond looks like
125 kbit/s too. A rate is believed only where the distances grow with the bits of the frames as they should, where many
lie near it, few beside it and next to none beyond, and where the stamps are fine enough. How distances grow is looked
at among frames with the same number of data bytes, which differ by their stuff bits alone: lists of different lengths
that are sent one after the other, some time apart, can look as if they did.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U16
from dissectors.can.bits import HEAD_BITS, HEAD_BITS_EXTENDED, TAIL_BITS
from dissectors.can.frame import MAX_DATA_BYTES, CanBatch
from nvscope.engine.dealing import Share
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of, stable_order

USUAL_RATES = (
    10_000, 20_000, 33_333, 50_000, 83_333, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
)  # fmt: skip
"""The bit rates that buses have."""

MAX_PAIRS = 1 << 14
"""So many frames of a channel, the first, are looked at: a bus does not change its bit rate."""

_MAX_CHANNELS = 256
_WINDOW = 1.08
"""A pair of frames is near a rate that differs by no more than this factor: rates are 1.2 apart at least."""

_LEAST_PAIRS = 40
_LEAST_CONTRAST = 3
_MOST_FASTER_PERCENT = 5
_LEAST_BITS_VARIANCE = 0.5
_SLOPE = (0.7, 1.3)
_MOST_DEPARTURE = 0.03
_MOST_SLOPE_ERROR = 0.15
_MOST_QUANTUM_BITS = 10
_QUANTA_NS = (1_000_000, 100_000, 10_000)
_STAMPED = ("end", "start")

_RATES = len(USUAL_RATES)
_SHAPES = 2 * (MAX_DATA_BYTES + 1)
_GROUPS = len(_STAMPED) * _RATES * _SHAPES
_NS_PER_S = 1_000_000_000


def _edge(rate: int, windows: int) -> float:
    """Return a rate that lies so many half windows beside a usual one."""
    return float(rate * _WINDOW**windows)


# Without np.unique, which would import numpy.ma.
_EDGES = np.array(sorted({_edge(rate, windows) for rate in USUAL_RATES for windows in (-3, -1, 1, 3)}))
_CELLS = len(_EDGES) + 1


def _cells(rate: int, low: int, high: int) -> slice:
    """Return which cells, between edges, lie between two of a usual rate."""
    first, last = np.searchsorted(_EDGES, [_edge(rate, low), _edge(rate, high)])
    return slice(int(first) + 1, int(last) + 1)


_NEAR = [_cells(rate, -1, 1) for rate in USUAL_RATES]
_BELOW = [_cells(rate, -3, -1) for rate in USUAL_RATES]
_ABOVE = [_cells(rate, 1, 3) for rate in USUAL_RATES]
# Among frames of a shape, those near a rate are chosen by their distance alone: had their bits a say too, the distance
# would seem to grow with these. A frame takes about 1.04 times the bits that it has without stuff bits.
_SHAPE_EDGES = np.array([edge for rate in USUAL_RATES for edge in (rate / 1.15, rate / 0.96)])
_BARE_BITS = np.array(
    [head + 8 * size + TAIL_BITS for head in (HEAD_BITS, HEAD_BITS_EXTENDED) for size in range(MAX_DATA_BYTES + 1)]
)


class _ChannelColumns(KeyedColumns):
    """One row a channel.

    ``bits`` are those of the last frame, 0 where no distance can be measured from it, ``shape`` its bytes of data, and
    whether it is extended. ``finer`` tells by entry of ``_QUANTA_NS`` how many stamps are no multiples of it. ``pairs``
    counts pairs by when frames are stamped and cell. The rest are sums over those that may be back to back at a rate,
    by when frames are stamped, rate and shape: of ones, bits, distances in thousandths of a bit, of squares and
    products.
    """

    seen: I64
    last_ns: I64
    bits: I64
    shape: I64
    finer: I64
    pairs: I64
    near: I64
    sum_bits: I64
    sum_distance: I64
    sum_bits2: I64
    sum_product: I64
    sum_distance2: I64
    COLUMNS: ClassVar = {
        "seen": (np.int64(0), 1),
        "last_ns": (np.int64(0), 1),
        "bits": (np.int64(0), 1),
        "shape": (np.int64(0), 1),
        "finer": (np.int64(0), len(_QUANTA_NS)),
        "pairs": (np.int64(0), len(_STAMPED) * _CELLS),
        "near": (np.int64(0), _GROUPS),
        "sum_bits": (np.int64(0), _GROUPS),
        "sum_distance": (np.int64(0), _GROUPS),
        "sum_bits2": (np.int64(0), _GROUPS),
        "sum_product": (np.int64(0), _GROUPS),
        "sum_distance2": (np.int64(0), _GROUPS),
    }


class BackToBack:
    """The distances of frames that follow each other on a channel, against their bits."""

    def __init__(self) -> None:
        self._columns = _ChannelColumns()

    def observe(self, frames: CanBatch, bits: U16) -> None:
        """Take the frames of a batch with their exact bits; those of CAN FD tell nothing, for they have two rates."""
        here = np.bincount(frames.channel)[:_MAX_CHANNELS]
        columns = self._columns
        columns.resize(len(here))
        open_ = (columns.column("seen")[: len(here)] < MAX_PAIRS) & (here > 0)
        if not open_.any():
            return
        row = np.arange(len(frames))
        if np.count_nonzero(here) > 1 or not open_.all():
            channel = frames.channel
            mine = open_[np.minimum(channel, len(here) - 1)] & (channel < len(here))
            row = np.flatnonzero(mine)
            row = row[stable_order(channel[row].astype(np.int64), len(here))]
        self._observe(frames, bits, row)

    def take(self, part: BackToBack, share: Share) -> None:
        """Take over the distances of a part's share of the channels."""
        channel = np.arange(len(part._columns))
        self._columns.take(part._columns, channel[share.is_own(channel)])

    def _observe(self, frames: CanBatch, bits: U16, row: I64) -> None:
        columns = self._columns
        channel = frames.channel[row].astype(np.int64)
        start, stop = runs_of(channel)
        run = channel[start]
        rank = np.arange(len(row)) + np.repeat(columns.seen[run] - start, stop - start)
        if (rank >= MAX_PAIRS).any():
            row = row[rank < MAX_PAIRS]
            channel = frames.channel[row].astype(np.int64)
            start, stop = runs_of(channel)
            run = channel[start]
        time_ns, own = frames.ts_ns[row], bits[row].astype(np.int64)
        own[frames.fd[row]] = 0
        size = np.where(frames.remote[row], 0, np.minimum(frames.length[row], MAX_DATA_BYTES)).astype(np.int64)
        shape = size + frames.extended[row] * np.int64(MAX_DATA_BYTES + 1)
        before_ns, before, before_shape = (np.empty_like(time_ns) for _ in range(3))
        for last, value, column in (
            (before_ns, time_ns, columns.last_ns), (before, own, columns.bits), (before_shape, shape, columns.shape),
        ):  # fmt: skip
            last[1:] = value[:-1]
            last[start] = column[run]
            column[run] = value[stop - 1]
        columns.seen[run] += stop - start
        for place, quantum_ns in enumerate(_QUANTA_NS):
            columns.finer[run, place] += np.add.reduceat((time_ns % quantum_ns != 0).astype(np.int64), start)
        distance_ns = time_ns - before_ns
        pair = np.flatnonzero((distance_ns > 0) & (own > 0) & (before > 0))
        for stamped, (told, told_shape) in enumerate(((own, shape), (before, before_shape))):
            self._add(stamped, channel[pair], told[pair], told_shape[pair], distance_ns[pair])

    def _add(self, stamped: int, channel: I64, bits: I64, shape: I64, distance_ns: I64) -> None:
        columns, channels = self._columns, len(self._columns)
        cell = np.searchsorted(_EDGES, bits * float(_NS_PER_S) / distance_ns, side="right")
        counted = np.bincount(channel * _CELLS + cell, minlength=channels * _CELLS).reshape(channels, _CELLS)
        columns.pairs[:channels, stamped * _CELLS : (stamped + 1) * _CELLS] += counted
        place = np.searchsorted(_SHAPE_EDGES, _BARE_BITS[shape] * float(_NS_PER_S) / distance_ns)
        near = np.flatnonzero(place & 1)
        if not len(near):
            return
        number, bits = place[near] >> 1, bits[near]
        distance = distance_ns[near] * np.array(USUAL_RATES)[number] // (_NS_PER_S // 1000)
        key = ((channel[near] * len(_STAMPED) + stamped) * _RATES + number) * _SHAPES + shape[near]
        for column, value in (
            (columns.near, np.ones(len(near))), (columns.sum_bits, bits), (columns.sum_distance, distance),
            (columns.sum_bits2, bits * bits), (columns.sum_product, bits * distance),
            (columns.sum_distance2, distance * distance),
        ):  # fmt: skip
            # Sums of a batch stay below the 2^53 up to which they are exact.
            summed = np.bincount(key, value, minlength=channels * _GROUPS).astype(np.int64)
            column[:channels] += summed.reshape(channels, _GROUPS)

    def rate(self, channel: int) -> int | None:
        """Return the bit rate of a channel, None where its frames do not tell it."""
        if channel >= len(self._columns):
            return None
        found = [
            (pairs, USUAL_RATES[number])
            for stamped in range(len(_STAMPED))
            for number in reversed(range(_RATES))
            if (pairs := self._evidence(channel, stamped, number))
        ]
        return max(found)[1] if found else None

    def _evidence(self, channel: int, stamped: int, number: int) -> int:
        """Return how many pairs of frames speak for a rate, 0 where not enough do."""
        columns, rate = self._columns, USUAL_RATES[number]
        cells = columns.pairs[channel, stamped * _CELLS : (stamped + 1) * _CELLS]
        pairs = int(cells[_NEAR[number]].sum())
        beside = max(int(cells[_BELOW[number]].sum()), int(cells[_ABOVE[number]].sum()))
        faster = int(cells[_ABOVE[number].stop :].sum())
        if pairs < _LEAST_PAIRS or pairs < _LEAST_CONTRAST * beside or 100 * faster > _MOST_FASTER_PERCENT * pairs:
            return 0
        for place, quantum_ns in enumerate(_QUANTA_NS):
            if not columns.finer[channel, place] and quantum_ns * rate > _MOST_QUANTUM_BITS * _NS_PER_S:
                return 0
        first = (stamped * _RATES + number) * _SHAPES
        near, bits, distance, bits2, product, distance2 = (
            column[channel, first : first + _SHAPES] / scale
            for column, scale in (
                (columns.near, 1), (columns.sum_bits, 1), (columns.sum_distance, 1e3), (columns.sum_bits2, 1),
                (columns.sum_product, 1e3), (columns.sum_distance2, 1e6),
            )
        )  # fmt: skip
        if not near.any() or abs(distance.sum() / bits.sum() - 1) > _MOST_DEPARTURE:
            return 0
        # Within each shape, around its means.
        count = np.maximum(near, 1)
        chosen = float(near.sum())
        spread = float((bits2 - bits * bits / count).sum())
        if spread < _LEAST_BITS_VARIANCE * chosen:
            return 0
        slope = float((product - bits * distance / count).sum()) / spread
        rest = max(0.0, float((distance2 - distance * distance / count).sum()) - slope**2 * spread)
        error = (rest / chosen / spread) ** 0.5
        return pairs if _SLOPE[0] <= slope <= _SLOPE[1] and error <= _MOST_SLOPE_ERROR else 0
