"""Databases of DataLoggers on demand: most captures have no rows of them, and then nothing of it is imported."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.batch import I64, Bool, PacketBatch
from dissectors.dissector import Part
from dissectors.transport import DatagramBatch, SegmentBatch

if TYPE_CHECKING:
    from typing import Self

NAME = "db"


class _Nothing:
    """The part of a batch in which no row is."""

    row: I64 = np.empty(0, np.int64)

    def __len__(self) -> int:
        return 0

    def take(self, rows: I64 | Bool) -> Self:
        return self


def dissect(packets: PacketBatch, datagrams: DatagramBatch, segments: SegmentBatch) -> Part:
    """Return the rows of a batch (``dissectors.datalogger.rows.RowBatch``)."""
    if packets.logged is None:
        return _Nothing()
    from dissectors.datalogger.rows import dissect_rows  # noqa: PLC0415

    return dissect_rows(packets)
