"""Telegrams of one place that were not written yet."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8
from nvscope.view.rows.defined import DefinedRows, Place
from nvscope.view.rows.values import ColumnDecoder, SpanColumn, ValueColumn

_HEAD_BYTES = 3 * 8
_OPEN_HEAD_BYTES = 5 * 8
_SLAB_BYTES = 256 << 10
_LEAST_SLAB_BYTES = 4 << 10


class Taken(Struct, frozen=True):
    """Telegrams in the order of the capture: what stands in front of their variables, int64 (n,), and these."""

    frame: I64
    ts_ns: I64
    sender: I64
    subindex: I64
    columns: list[ValueColumn]


class Slabs:
    """Memory in pieces of few sizes, which any list takes and gives back: what is held of many leaves no holes."""

    def __init__(self) -> None:
        self._free: dict[int, list[U8]] = {}

    def take(self, size_bytes: int) -> U8:
        free = self._free.get(size_bytes)
        return free.pop() if free else np.empty(size_bytes, np.uint8)

    def give_back(self, slabs: list[U8]) -> None:
        if slabs:
            self._free.setdefault(len(slabs[0]), []).extend(slabs)
        slabs.clear()


class HeldTelegrams:
    """Telegrams of one size, in slabs; ``places`` is how many places of the list hold some."""

    def __init__(self, place: Place, slabs: Slabs, places: int) -> None:
        self.place = place
        self.rows = 0
        self._decoder = ColumnDecoder(place.layout)
        self._size_bytes = place.layout.layout.size_bytes
        # Of a list that is not packed, each variable has slabs of its own.
        slab_bytes = max(_SLAB_BYTES // places & -_LEAST_SLAB_BYTES, _LEAST_SLAB_BYTES)
        self._slab_bytes = max(slab_bytes, _HEAD_BYTES + self._size_bytes)
        self._rows_a_slab = self._slab_bytes // (_HEAD_BYTES + self._size_bytes)
        self._pool = slabs
        self._slabs: list[U8] = []

    def add(self, rows: DefinedRows, which: I64) -> int:
        """Hold some telegrams, and return how many bytes that takes."""
        taken = len(which)
        while len(which):
            at = self.rows % self._rows_a_slab
            if not at:
                self._slabs.append(self._pool.take(self._slab_bytes))
            piece, which = np.split(which, [self._rows_a_slab - at])
            numbers, data = self._views(self._slabs[-1], slice(at, at + len(piece)))
            for target, source in zip(numbers, (rows.frame, rows.ts_ns, rows.sender), strict=True):
                target[:] = source[piece]
            data[:] = rows.bytes_of(piece, self._size_bytes)
            self.rows += len(piece)
        return taken * (_HEAD_BYTES + self._size_bytes)

    def take(self) -> Taken:
        """Return what is held, and hold nothing."""
        last = self.rows - (len(self._slabs) - 1) * self._rows_a_slab
        used = [self._rows_a_slab] * (len(self._slabs) - 1) + [last]
        views = [self._views(slab, slice(count)) for slab, count in zip(self._slabs, used, strict=True)]
        frame, ts_ns, sender = np.hstack([numbers for numbers, _ in views])
        data = np.concatenate([data for _, data in views])
        self._pool.give_back(self._slabs)
        self.rows = 0
        subindex = np.full(len(frame), self.place.layout.subindex)
        return Taken(frame, ts_ns, sender, subindex, self._decoder.columns(data))

    def _views(self, slab: U8, rows: slice) -> tuple[I64, U8]:
        head, stop = _HEAD_BYTES * self._rows_a_slab, (_HEAD_BYTES + self._size_bytes) * self._rows_a_slab
        numbers = slab[:head].view(np.int64).reshape(3, self._rows_a_slab)
        return numbers[:, rows], slab[head:stop].reshape(self._rows_a_slab, self._size_bytes)[rows]


class OpenPart:
    """Telegrams of which only what is in front is known; the rest of each is as long as it is."""

    def __init__(self, place: Place) -> None:
        self.place = place
        self.rows = 0
        self._decoder = ColumnDecoder(place.layout)
        self._size_bytes = place.layout.layout.size_bytes
        self._heads: list[I64] = []
        self._fronts: list[U8] = []
        self._rests: list[SpanColumn] = []

    def add(self, rows: DefinedRows, which: I64) -> int:
        """Hold some telegrams, and return how many bytes that takes."""
        columns = (rows.frame, rows.ts_ns, rows.sender, rows.subindex)
        self._heads.append(np.stack([column[which] for column in columns]))
        self._fronts.append(rows.bytes_of(which, self._size_bytes))
        self._rests.append(rows.bytes_behind(which, self._size_bytes))
        self.rows += len(which)
        return len(which) * _OPEN_HEAD_BYTES + int(rows.size_bytes[which].sum())

    def take(self) -> Taken:
        """Return what is held, and hold nothing."""
        frame, ts_ns, sender, subindex = np.hstack(self._heads)
        columns = self._decoder.columns(np.concatenate(self._fronts))
        length = np.concatenate([np.diff(rest.offset) for rest in self._rests])
        rest = SpanColumn(np.append(0, np.cumsum(length)), np.concatenate([rest.data for rest in self._rests]))
        for held in (self._heads, self._fronts, self._rests):
            held.clear()
        self.rows = 0
        return Taken(frame, ts_ns, sender, subindex, [*columns, rest])
