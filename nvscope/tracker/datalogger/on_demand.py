"""Databases of DataLoggers on demand: most captures have no rows of them, and then nothing of it is imported."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dissectors.batch import I64, Bool, PacketBatch
from dissectors.dissector import Part
from dissectors.transport import DatagramBatch, SegmentBatch
from nvscope.engine.dealing import Share, SplitBy
from nvscope.engine.told import Told
from nvscope.tracker.accumulator import NO_SUMMARY, ProtocolSummary

if TYPE_CHECKING:
    from typing import Self

    from nvscope.tracker.datalogger.counts import DatabaseCounts

NAME = "db"


class _Nothing:
    """The part of a batch in which no row is."""

    row: I64 = np.empty(0, np.int64)

    def __len__(self) -> int:
        return 0

    def take(self, rows: I64 | Bool) -> Self:
        return self


class DatabaseState:
    """What databases hold, ``known``: None before there is any."""

    SPLIT_BY: ClassVar = SplitBy.LIST  # of no list: all go to the first part

    def __init__(self) -> None:
        self.known: DatabaseCounts | None = None

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        part = told.parts.get(NAME)
        if part is None:
            return
        from dissectors.datalogger.rows import RowBatch  # noqa: PLC0415
        from nvscope.tracker.datalogger.counts import DatabaseCounts  # noqa: PLC0415

        assert isinstance(part, RowBatch)
        if self.known is None:
            self.known = DatabaseCounts()
        self.known.observe(told, part)

    def take(self, part: DatabaseState, share: Share) -> None:
        """Take over what the first part has counted: it has all of it."""
        if not share.part:
            self.known = part.known

    def summary(self) -> ProtocolSummary:
        """Return a row a database."""
        return NO_SUMMARY if self.known is None else ProtocolSummary(self.known.summary())


def dissect(packets: PacketBatch, datagrams: DatagramBatch, segments: SegmentBatch) -> Part:
    """Return the rows of a batch (``dissectors.datalogger.rows.RowBatch``)."""
    if packets.logged is None:
        return _Nothing()
    from dissectors.datalogger.rows import dissect_rows  # noqa: PLC0415

    return dissect_rows(packets)
