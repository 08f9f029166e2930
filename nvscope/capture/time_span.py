"""A span of time, both ends included, and what of a batch lies in it."""

from __future__ import annotations

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import PacketBatch

TIME_LIMIT_NS = (1 << 62) - 1
"""Times of packets are within ± this, so that the difference of any two is an int64; it lies in the year 2116."""

_FIRST_NS, _LAST_NS = -(1 << 63), (1 << 63) - 1


class TimeSpan(Struct, frozen=True):
    """From ``start_ns`` to ``end_ns`` since 1970, both included; nothing is outside unless one of them is given."""

    start_ns: int = _FIRST_NS
    end_ns: int = _LAST_NS

    @staticmethod
    def of(start_ns: int | None, end_ns: int | None) -> TimeSpan:
        """Return the span between two times, None for no bound."""
        return TimeSpan(
            _FIRST_NS if start_ns is None else max(start_ns, _FIRST_NS),
            _LAST_NS if end_ns is None else min(end_ns, _LAST_NS),
        )

    def __and__(self, other: TimeSpan) -> TimeSpan:
        """Return what lies in both."""
        return TimeSpan(max(self.start_ns, other.start_ns), min(self.end_ns, other.end_ns))

    def part(self, batch: PacketBatch) -> PacketBatch | None:
        """Return the packets of a batch that lie in the span, in their order; None where there is nothing to say.

        ``until_ns`` goes no further than the end, since nobody looks behind it, and is kept without packets too; so are
        the ends of sources, but for those that lie behind it.
        """
        ends = tuple(end for end in batch.ends if end.time_ns <= self.end_ns) if batch.ends else ()
        until_ns = batch.until_ns
        if until_ns is not None:
            until_ns = None if until_ns < self.start_ns else min(until_ns, self.end_ns)
        kept = self._kept(batch)
        if kept is not None:
            told = (kept.until_ns, kept.ends) == (until_ns, ends)
            return kept if told else replace(kept, until_ns=until_ns, ends=ends)
        if ends:
            return replace(PacketBatch.nothing(until_ns), ends=ends)
        return None if until_ns is None else PacketBatch.nothing(until_ns)

    def _kept(self, batch: PacketBatch) -> PacketBatch | None:
        if not len(batch):
            return None
        first_ns, last_ns = int(batch.ts_ns.min()), int(batch.ts_ns.max())
        if self.start_ns <= first_ns and last_ns <= self.end_ns:
            return batch
        if last_ns < self.start_ns or first_ns > self.end_ns:
            return None
        rows = np.flatnonzero((batch.ts_ns >= self.start_ns) & (batch.ts_ns <= self.end_ns))
        if not len(rows):
            return None
        begin, end = int(rows[0]), int(rows[-1]) + 1
        # Only where a clock steps are the packets of a span not side by side.
        return batch[begin:end] if end - begin == len(rows) else batch.take(rows)
