"""Waiting: of some batches, what tells who sent their packets, so that many are looked at together.

What a look at a batch costs hangs little on how many packets it has: of ten batches together, it is a tenth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from dissectors.batch import I32, I64, U16, Bool, PacketBatch, Records
from dissectors.carried import Carrier
from dissectors.keys import first_rows_from
from dissectors.layout import gather_bytes
from dissectors.netvar import LIST_SERVICES
from dissectors.varieties import Varieties
from nvscope.engine.told import Told

MOST_PACKETS = 1 << 18
"""Of so many packets, all are taken: they wait with 16 bytes each. Four times as many would save nothing."""

MOST_LOOKED_AT = 1 << 16
"""The same of those whose headers are kept."""

_FEW = 8
"""Of so many packets, one is picked faster by its batch, and two from all batches put together."""

HEAD_BYTES = 160
"""So much of a packet is kept: link, tags and network header."""


class _Batch(Struct, frozen=True):
    """A batch: of ``header`` and ``time_ns`` all rows, of the others those that are looked at."""

    header: I64
    time_ns: I64
    looked_at: I64
    heads: Records
    captured: I32
    link: U16
    other: Bool
    first_frame: int


class Heard:
    """Packets of several batches, numbered from 0 in the order of the capture.

    ``looked_at`` are those, rising, that tell something of themselves: the first one of each header that is new, and
    all whose headers have no number (``SortedPackets``); ``header`` are their numbers, ``heads`` the packets'
    beginnings, ``other`` whether they are no telegrams of lists. ``count`` is how many packets each header has.
    """

    def __init__(self, batches: Sequence[_Batch], count: I64) -> None:
        self._batches, self.count = batches, count
        length = np.array([len(one.header) for one in batches])
        self._begin = np.cumsum(length) - length
        self._first_frame = np.array([one.first_frame for one in batches])
        parts = zip(batches, self._begin.tolist(), strict=True)
        self.looked_at = np.concatenate([one.looked_at + begin for one, begin in parts])
        self.header = np.concatenate([one.header[one.looked_at] for one in batches])
        self.other = np.concatenate([one.other for one in batches])
        heads = np.concatenate([one.heads for one in batches])
        captured = np.minimum(np.concatenate([one.captured for one in batches]), HEAD_BYTES)
        data = np.append(heads.view(np.uint8), np.zeros(HEAD_BYTES, np.uint8))
        link = np.concatenate([one.link for one in batches])
        nothing = np.zeros(len(heads), np.int64)
        self.heads = PacketBatch(data, np.arange(len(heads)) * HEAD_BYTES, captured, nothing, nothing, link)

    def times_ns(self, row: I64) -> I64:
        """Return the times of some packets."""
        return self._picked(row, [one.time_ns for one in self._batches])

    def frames(self, row: I64) -> I64:
        """Return the numbers of some packets' frames."""
        own = np.searchsorted(self._begin, row, "right") - 1
        frames: I64 = self._first_frame[own] + row - self._begin[own]
        return frames

    def of_headers(self, chosen: Bool) -> tuple[I64, I64]:
        """Return the packets of some headers, rising, and which header each has."""
        rows, headers = [], []
        for one, begin in zip(self._batches, self._begin.tolist(), strict=True):
            found = np.flatnonzero(chosen[one.header])
            rows.append(found + begin)
            headers.append(one.header[found])
        return np.concatenate(rows), np.concatenate(headers)

    def _picked(self, row: I64, columns: Sequence[I64]) -> I64:
        if len(row) >= sum(map(len, columns)) // _FEW:
            return np.concatenate(columns)[row]
        own = np.searchsorted(self._begin, row, "right") - 1
        picked = np.empty(len(row), np.int64)
        for number, column in enumerate(columns):
            of_batch = np.flatnonzero(own == number)
            picked[of_batch] = column[row[of_batch] - self._begin[number]]
        return picked


class Waiting:
    """Batches that were heard, of one table of varieties."""

    def __init__(self) -> None:
        self._varieties: Varieties | None = None
        self._of_lists: Bool = np.zeros(0, np.bool_)
        self._headers = 1
        self._batches: list[_Batch] = []
        self._count = np.zeros(1, np.int64)
        self._packets = self._looked_at = 0

    @property
    def is_full(self) -> bool:
        """Whether there are so many packets that they should be taken."""
        return self._packets >= MOST_PACKETS or self._looked_at >= MOST_LOOKED_AT

    def fits(self, told: Told) -> bool:
        """Tell whether the headers of a batch have the numbers that those before had."""
        return self._varieties is None or self._varieties is told.varieties

    def add(self, told: Told) -> None:
        """Take a batch, which follows those before."""
        self._varieties = told.varieties
        packets, header = told.packets, told.batch.header
        count, row = told.header_counts, told.without_header
        if len(count) > self._headers:
            row = np.sort(np.append(row, first_rows_from(header, self._headers, len(count))))
            self._headers = len(count)
        if len(count) > len(self._count):
            self._count = np.append(self._count, np.zeros(len(count) - len(self._count), np.int64))
        self._count[: len(count)] += count
        other = ~self._are_of_lists(told, row)
        self._batches.append(
            _Batch(
                header, packets.ts_ns, row, _heads(packets, row), packets.captured[row], packets.link[row], other,
                told.first_frame,
            )
        )  # fmt: skip
        self._packets += len(told)
        self._looked_at += len(row)

    def take(self) -> Heard | None:
        """Return all that waits, None where nothing does; nothing waits then."""
        if not self._batches:
            return None
        heard = Heard(self._batches, self._count)
        self._batches, self._count = [], np.zeros(1, np.int64)
        self._packets = self._looked_at = 0
        return heard

    def _are_of_lists(self, told: Told, row: I64) -> Bool:
        """Tell which packets of a batch hold telegrams that belong to a list."""
        varieties, known = told.varieties, len(self._of_lists)
        if known < len(varieties):
            of_new: Bool = np.zeros(len(varieties) - known, np.bool_)
            on_udp = np.flatnonzero(varieties.carried.carrier[known:] == Carrier.UDP)
            of_new[on_udp] = np.isin(varieties.telegrams_of(on_udp + known).header["id"], LIST_SERVICES)
            self._of_lists = np.append(self._of_lists, of_new)
        return self._of_lists[told.variety[row]]


def _heads(packets: PacketBatch, row: I64) -> Records:
    """Return the beginnings of some packets; what is not theirs behind them is anything."""
    data, offset = packets.data, packets.offset[row]
    if len(row) and int(offset.max()) + HEAD_BYTES > len(data):
        first = int(offset.min())
        data, offset = np.append(data[first:], np.zeros(HEAD_BYTES, np.uint8)), offset - first
    return gather_bytes(data, offset, HEAD_BYTES)
