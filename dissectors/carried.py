"""Carried: which variables of which list a frame carries, whatever it is that carries them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntEnum
from functools import cached_property

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.columns import Columns


class Carrier(IntEnum):
    """What carries the variables of a list."""

    NONE = 0
    UDP = 1
    CAN = 2


@dataclass(frozen=True, slots=True)
class Carried(Columns):
    """What frames carry, as far as their headers say; of shape (n,), int64 unless said otherwise.

    A list is told by ``carrier`` (uint8), ``port`` (destination port of UDP, number of the CAN channel) and
    ``identifier`` (Index, COB-ID of the list's first frame; ``dissectors.can.pdo``). ``items`` is 0 on CAN, where no
    frame tells it. ``at`` is where the data begins, from the first byte of the packet; ``size_bytes`` how much of it
    was sent, ``captured_bytes`` how much of that was captured. ``of_list`` (bool) are frames that belong to a list at
    all, ``is_data`` (bool) those that are variables of it, well-formed: the rest are requests, answers, and faults.
    """

    carrier: U8
    port: I64
    identifier: I64
    subindex: I64
    items: I64
    at: I64
    size_bytes: I64
    captured_bytes: I64
    of_list: Bool
    is_data: Bool

    @property
    def truncated(self) -> Bool:
        """Tell of which data less was captured than sent."""
        return self.captured_bytes < self.size_bytes

    def of_packets(self, variety: I64, offset: I64) -> PacketsCarried:
        """Return what packets of some varieties carry that begin at some offsets of a buffer; ``at`` is absolute."""
        return PacketsCarried(self, variety, offset)

    @staticmethod
    def nothing(count: int) -> Carried:
        """Return as many rows that carry nothing."""
        blank, no = np.zeros(count, np.int64), np.zeros(count, np.bool_)
        carrier = np.full(count, Carrier.NONE, np.uint8)
        return Carried(carrier, blank, blank, blank, blank, blank, blank, blank, no, no)


class PacketsCarried(Carried):
    """The same of packets, given what their varieties carry; columns are made when they are asked for."""

    def __init__(self, varieties: Carried, variety: I64, offset: I64) -> None:
        # The base class is frozen, and its columns are made here when they are asked for.
        self.__dict__.update(_varieties=varieties, _variety=variety, _offset=offset)

    _varieties: Carried
    _variety: I64
    _offset: I64

    def __len__(self) -> int:
        return len(self._variety)

    def take(self, rows: I64 | Bool) -> PacketsCarried:
        return PacketsCarried(self._varieties, self._variety[rows], self._offset[rows])

    @cached_property
    def at(self) -> I64:
        return self._offset + self._varieties.at[self._variety]


def _column(name: str) -> cached_property[I64]:
    return cached_property(lambda own: getattr(own._varieties, name)[own._variety])


for _field in fields(Carried):
    if _field.name not in vars(PacketsCarried):
        _made = _column(_field.name)
        _made.__set_name__(PacketsCarried, _field.name)
        setattr(PacketsCarried, _field.name, _made)
