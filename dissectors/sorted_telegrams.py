"""The telegrams of packets that were told by varieties, as a batch whose columns are made when they are asked for.

What ``dissectors.varieties`` knows of packets is enough to give every column that ``dissect`` gives; few of them are
looked at by those who ask later, a filter for instance.
"""

from __future__ import annotations

from dataclasses import fields
from functools import cached_property

import numpy as np

from dissectors.batch import I64, U8, U16, Bool, Records
from dissectors.headers import UDP
from dissectors.layout import gather_bytes
from dissectors.netvar import HEADER, TelegramBatch
from dissectors.sorter import SortedPackets
from dissectors.transport import DatagramBatch


class SortedTelegrams(TelegramBatch):
    """The telegrams in some packets, ``rows``, of which each must hold one; the same as ``dissect`` gives of them."""

    def __init__(self, batch: SortedPackets, rows: I64) -> None:
        # The base class is frozen, and its columns are made here when they are asked for.
        self.__dict__.update(_batch=batch, _rows=rows, _part=batch.varieties.part[batch.variety[rows]])

    _batch: SortedPackets
    _rows: I64
    _part: I64

    def __len__(self) -> int:
        return len(self._rows)

    @cached_property
    def data(self) -> U8:
        return self._batch.packets.data

    @cached_property
    def datagram(self) -> DatagramBatch:
        return _SortedDatagrams(self._batch, self._rows, self._part)

    @cached_property
    def ts_ns(self) -> I64:
        return self._batch.packets.ts_ns[self._rows]

    @cached_property
    def header(self) -> Records:
        return HEADER.gather(self.data, self.datagram.payload)

    @cached_property
    def fault(self) -> U8:
        return self._batch.varieties.telegrams.fault[self._part]


class _SortedDatagrams(DatagramBatch):
    """The datagrams of the same packets."""

    def __init__(self, batch: SortedPackets, rows: I64, part: I64) -> None:
        self.__dict__.update(_batch=batch, row=rows, _part=part)

    _batch: SortedPackets
    _part: I64

    def take(self, rows: I64 | Bool) -> _SortedDatagrams:
        return _SortedDatagrams(self._batch, self.row[rows], self._part[rows])

    @cached_property
    def payload(self) -> I64:
        common = self._batch.varieties.telegrams.datagram.payload
        return self._batch.packets.offset[self.row] + common[self._part]

    @cached_property
    def source_port(self) -> U16:
        dtype = np.dtype(UDP["source_port"].dtype)
        at = self.payload - (UDP.size_bytes - UDP.offset_of("source_port"))
        return gather_bytes(self._batch.packets.data, at, dtype.itemsize).view(dtype).astype(np.uint16)


def _common(name: str) -> cached_property[I64]:
    return cached_property(lambda own: getattr(own._batch.varieties.telegrams.datagram, name)[own._part])


for _field in fields(DatagramBatch):
    if _field.name not in vars(_SortedDatagrams):
        # Also of ``row``, which has its value from the start: the slot of the base class would hide it.
        _column = _common(_field.name)
        _column.__set_name__(_SortedDatagrams, _field.name)
        setattr(_SortedDatagrams, _field.name, _column)
