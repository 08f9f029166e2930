"""The values of parameters as far as they were seen, and what was last known of each.

Plants read parameters again and again: of what a batch tells of one, only the last is kept.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, U64, Bool
from dissectors.keys import KeyTable
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.told import Told

KEPT_BYTES = 256
"""So many bytes of a value are kept; a list's telegram has no more either."""

_UNKNOWN = -1
_GATHERED = 4096
"""So many values are copied at a time."""


class Value(Struct, frozen=True):
    """A value as it was sent: its bytes, the first ones where it is longer than what is kept or was captured of it.

    ``size_bytes`` is how long it is, ``items`` how many elements its telegram says that it has.
    """

    data: bytes
    size_bytes: int
    items: int

    @property
    def is_cut(self) -> bool:
        """Whether there is more of it than ``data``."""
        return len(self.data) < self.size_bytes

    @property
    def is_known(self) -> bool:
        """Whether all that would be kept of it was captured."""
        return len(self.data) == min(self.size_bytes, KEPT_BYTES)


def values_in(told: Told, packet: I64) -> list[Value]:
    """Return the values in the telegrams of some packets of a batch."""
    carried, variety = told.varieties.carried, told.variety[packet]
    at = told.packets.offset[packet] + carried.at[variety]
    stop = at + np.minimum(carried.captured_bytes[variety], KEPT_BYTES)
    columns = at, stop, carried.size_bytes[variety], carried.items[variety]
    data = told.packets.data.data
    return [
        Value(bytes(data[start:end]), size_bytes, items)
        for start, end, size_bytes, items in zip(*(column.tolist() for column in columns), strict=True)
    ]


class _ValueColumns(KeyedColumns):
    """One row a parameter: how long its value is, -1 where it is not known, and how many elements it has."""

    size_bytes: I64
    items: I64
    COLUMNS: ClassVar = {"size_bytes": (np.int64(_UNKNOWN), 1), "items": (np.int64(0), 1)}


class LastValues:
    """The values last known of parameters, by a number of each; ``places`` number them, by a word of 64 bits."""

    def __init__(self) -> None:
        self.places = KeyTable(1)
        self._columns = _ValueColumns()
        # As wide as the longest one so far, so that short ones, which are the rule, take little.
        self._bytes: U8 = np.zeros((0, 8), np.uint8)
        self._scratch = np.empty(0, np.int64)

    def numbers(self, word: U64, most: int) -> I64:
        """Return the numbers of parameters, those that are new among them; -1 beyond ``most`` of them."""
        return self.places.numbers_within(most, word)

    def find(self, word: U64) -> I64:
        """Return the numbers of parameters, -1 of those of which nothing is known."""
        return self.places.find(word)

    def last_of(self, number: I64) -> I64:
        """Return where each of some numbers stands last, rising."""
        if len(self._scratch) < len(self.places):
            self._scratch = np.empty(2 * len(self.places), np.int64)
        row = np.arange(len(number))
        # Assigned in order, so that the last one is what stays.
        self._scratch[number] = row
        return np.flatnonzero(self._scratch[number] == row)

    def of(self, number: int) -> Value | None:
        """Return what is known of a parameter; None without anything, and of number -1."""
        if not 0 <= number < len(self._columns) or self._columns.size_bytes[number] == _UNKNOWN:
            return None
        size_bytes = int(self._columns.size_bytes[number])
        return Value(
            self._bytes[number, : min(size_bytes, KEPT_BYTES)].tobytes(), size_bytes, int(self._columns.items[number])
        )  # fmt: skip

    def put_from(self, told: Told, number: I64, packet: I64) -> None:
        """Keep what parameters are by the telegrams of some packets of a batch; numbers differ."""
        carried, variety = told.varieties.carried, told.variety[packet]
        size_bytes = carried.size_bytes[variety]
        kept = np.minimum(size_bytes, KEPT_BYTES)
        known: Bool = carried.captured_bytes[variety] >= kept
        self._resize(int(kept.max(initial=0)))
        self._columns.size_bytes[number] = np.where(known, size_bytes, _UNKNOWN)
        self._columns.items[number] = carried.items[variety]
        at, data = told.packets.offset[packet] + carried.at[variety], told.packets.data
        for start in range(0, len(number), _GATHERED):
            part = slice(start, start + _GATHERED)
            places = np.arange(int(kept[part].max()))
            # Behind the end of a value stands anything: its size tells where it ends.
            self._bytes[number[part], : len(places)] = data[
                np.minimum(at[part, np.newaxis] + places, max(len(data) - 1, 0))
            ]

    def _resize(self, width: int) -> None:
        """Make room for all parameters, and for values that long."""
        self._columns.resize(len(self.places))
        rows, wide = self._bytes.shape
        if len(self.places) <= rows and width <= wide:
            return
        grown = np.zeros(
            (max(len(self.places), 2 * rows) if len(self.places) > rows else rows,
             wide if width <= wide else 1 << (width - 1).bit_length()), np.uint8
        )  # fmt: skip
        grown[:rows, :wide] = self._bytes
        self._bytes = grown
