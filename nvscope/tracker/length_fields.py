"""LengthFields: where telegrams whose Length does not fit have a number that would.

A sender whose header has another size writes a Length all the same, only elsewhere, or of other bytes: then a number of
16 bits differs from the size of the payload by the same in all its telegrams.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64
from dissectors.keys import KeyTable
from dissectors.layout import gather_bytes
from dissectors.netvar import HEADER
from nvscope.engine.dealing import Share
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.told import Told

MOST_SENDERS = 1 << 12
"""Of so many senders of lists it is looked for, 2.5 KB each; of others, nothing is known."""

FIRST_OFFSET, LAST_OFFSET = 8, 18
"""Where the number may begin, little-endian: behind identity and service, in front of the data."""

LEAST_DIFFERENCE, MOST_DIFFERENCE = -8, 20
"""How many bytes the payload may have more than the number says."""

_OFFSETS = LAST_OFFSET - FIRST_OFFSET + 1
_DIFFERENCES = MOST_DIFFERENCE - LEAST_DIFFERENCE + 1


class _FitColumns(KeyedColumns):
    """One row a sender of a list: its telegrams that were looked at, and how often each number at each place fitted."""

    telegrams: I64
    fits: I64
    COLUMNS: ClassVar = {"telegrams": (np.int64(0), 1), "fits": (np.int64(0), _OFFSETS * _DIFFERENCES)}


class LengthField(NamedTuple):
    """A number in telegrams of a sender: ``fits`` times the payload had ``difference`` bytes more than it says."""

    offset: int
    difference: int
    fits: int


class LengthFields:
    """What was found, by list and node; ``telegrams_of`` and ``fields_of`` say it of one of them."""

    def __init__(self) -> None:
        self._senders = KeyTable()
        self._columns = _FitColumns()

    def observe(self, told: Told, row: I64, lists: I64, node: I64) -> None:
        """Take telegrams whose Length does not fit: packets of a batch with their lists and senders; shapes (n,)."""
        datagram, part = told.varieties.telegrams.datagram, told.varieties.part[told.variety[row]]
        whole = (datagram.captured_bytes[part] >= HEADER.size_bytes) & (lists >= 0) & (node >= 0)
        row, part = row[whole], part[whole]
        words = lists[whole].astype(np.uint64), node[whole].astype(np.uint64)
        number = self._senders.numbers_within(MOST_SENDERS, *words)
        self._columns.resize(len(self._senders))
        known = number >= 0
        row, part, number = row[known], part[known], number[known]
        np.add.at(self._columns.telegrams, number, 1)
        at = told.packets.offset[row] + datagram.payload[part]
        head = (
            gather_bytes(told.packets.data, at, HEADER.size_bytes).view(np.uint8).reshape(len(row), HEADER.size_bytes)
        )
        size = datagram.payload_bytes[part].astype(np.int64)
        for place, offset in enumerate(range(FIRST_OFFSET, LAST_OFFSET + 1)):
            difference = size - (head[:, offset].astype(np.int64) | head[:, offset + 1].astype(np.int64) << 8)
            near = (difference >= LEAST_DIFFERENCE) & (difference <= MOST_DIFFERENCE)
            column = place * _DIFFERENCES + difference[near] - LEAST_DIFFERENCE
            np.add.at(self._columns.fits, (number[near], column), 1)

    def take(self, part: LengthFields, share: Share) -> None:
        """Take over what a part has found of its share of the lists."""
        self._columns.take_keyed(self._senders, part._columns, part._senders.words)

    def telegrams_of(self, list_number: int, node: int) -> int:
        """Return how many telegrams of a sender of a list were looked at."""
        row = self._row(list_number, node)
        return 0 if row < 0 else int(self._columns.telegrams[row])

    def fields_of(self, list_number: int, node: int, least: int) -> list[LengthField]:
        """Return the numbers that fitted at least so often, by place and difference."""
        row = self._row(list_number, node)
        if row < 0:
            return []
        fits = self._columns.fits[row]
        return [
            LengthField(
                FIRST_OFFSET + column // _DIFFERENCES, LEAST_DIFFERENCE + column % _DIFFERENCES, int(fits[column])
            )
            for column in np.flatnonzero(fits >= max(least, 1)).tolist()
        ]  # fmt: skip

    def _row(self, list_number: int, node: int) -> int:
        return int(self._senders.find(np.array([list_number], np.uint64), np.array([node], np.uint64))[0])
