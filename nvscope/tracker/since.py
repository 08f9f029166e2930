"""Since: what one state has counted since a moment, beside all that it has counted; it is folded once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import numpy as np
from msgspec.structs import replace

from dissectors.batch import PacketBatch
from nvscope.capture.derived import DerivedSource
from nvscope.capture.source import Source
from nvscope.engine.told import Told
from nvscope.tracker.counted import Counted
from nvscope.tracker.joins import Extremes, Join, extremes_of, forget_extremes, tables_of
from nvscope.tracker.state import TrackerState


class Since:
    """What a state counts from ``start_ns`` on; time is that of the latest frame so far.

    It observes behind the state, on ``cut(source)``. From that moment on, the state has the extremes of what follows;
    ``as_of_all`` gives it back those of all, for as long as somebody looks.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, state: TrackerState, start_ns: int) -> None:
        self._state, self.start_ns = state, start_ns
        self._before: Counted | None = None
        self._extremes: Extremes | None = None
        self._forgotten: list[tuple[Any, str, Join, Any]] = []
        self._latest_ns = start_ns

    @property
    def has_begun(self) -> bool:
        """Whether the moment has passed."""
        return self._before is not None

    def cut(self, source: Source) -> Source:
        """Return a source with a batch cut at the moment, which passes then, if anything comes behind it."""
        return _Cut(source, self.start_ns)

    def observe(self, told: Told) -> None:
        """Take a batch that the state has taken."""
        if len(told):
            self._latest_ns = max(self._latest_ns, int(told.packets.ts_ns.max()))
        if self._before is None and told.until_ns is not None and told.until_ns >= self.start_ns:
            self._before, self._extremes = Counted.of(self._state), extremes_of(self._state)
            self._forgotten = [
                (table, name, join, table.column(name).copy())
                for table, joins in tables_of(self._state)
                for name, join in joins.items()
                if join in (Join.LEAST, Join.MOST)
            ]
            forget_extremes(self._state)

    def counted(self) -> Counted:
        """Return what was counted since; ValueError where nothing has come."""
        if self._before is None:
            raise ValueError("nothing has come since that moment")
        now = Counted.of(self._state, self._extremes)
        return now.since(self._before, extremes=True).between(self.start_ns, self._latest_ns)

    @contextmanager
    def as_of_all(self) -> Iterator[None]:
        """Let the state have the extremes of all that it has counted."""
        kept = [(table.column(name), table.column(name).copy()) for table, name, *_ in self._forgotten]
        for (column, _), (*_, join, before) in zip(kept, self._forgotten, strict=True):
            own = column[: len(before)]
            (np.minimum if join is Join.LEAST else np.maximum)(own, before, out=own)
        try:
            yield
        finally:
            for column, since in kept:
                column[:] = since


class _Cut(DerivedSource):
    """A source with a batch cut at a moment."""

    def __init__(self, source: Source, start_ns: int) -> None:
        super().__init__(source)
        self._start_ns = start_ns

    def __iter__(self) -> Iterator[PacketBatch]:
        batches = iter(self._source)
        for batch in batches:
            before = self._rows_before(batch)
            if before == len(batch):
                yield batch
                continue
            if batch.ends:
                yield PacketBatch.ended(*batch.ends)
            packets = replace(batch, ends=())
            if before:
                yield replace(packets[:before], until_ns=None)
            # Waits whose time is over by then are over before.
            yield PacketBatch.nothing(self._start_ns)
            yield replace(packets[before:], until_ns=packets.until_ns)
            break
        yield from batches

    def _rows_before(self, packets: PacketBatch) -> int:
        """Return how many packets come before the moment, or before anything that does not."""
        behind = np.flatnonzero(packets.ts_ns >= self._start_ns)
        return int(behind[0]) if len(behind) else len(packets)

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        """Return the part of the source that lies between two times, cut in the same way."""
        return _Cut(self._source.between(start_ns, end_ns), self._start_ns)
