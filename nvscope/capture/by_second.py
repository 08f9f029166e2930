"""A source cut at each second of its own time, so that it can be looked at a second at a time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import PacketBatch
from nvscope.capture.derived import DerivedSource
from nvscope.capture.source import Source

_S_NS = 1_000_000_000
_MOST_SILENT_S = 60
"""So many seconds without a packet are told one by one."""


class BySecond(DerivedSource):
    """The packets of a source; between two seconds an empty batch says that the first of them is over (``until_ns``).

    A clock that steps back begins no second anew. Of a longer silence only the last minute is told by seconds.
    ``every``: only so many seconds are told together, from the next batch that is asked for on.
    """

    def __init__(self, source: Source) -> None:
        super().__init__(source)
        self.every = 1

    def __iter__(self) -> Iterator[PacketBatch]:
        over_s: int | None = None  # the seconds up to this one are over, or being told
        for batch in self._source:
            if not len(batch):
                yield batch
                continue
            second = batch.ts_ns // _S_NS
            if over_s is not None:
                np.maximum(second, over_s, out=second)
            second = np.maximum.accumulate(second)
            begin = 0
            while begin < len(batch):
                now_s = int(second[begin])
                while over_s is not None and (next_s := self._behind(max(over_s, now_s - _MOST_SILENT_S))) <= now_s:
                    over_s = next_s
                    yield PacketBatch.nothing(next_s * _S_NS - 1)
                end = int(np.searchsorted(second, self._behind(now_s)))
                yield batch[begin:end]
                over_s, begin = int(second[end - 1]), end

    def _behind(self, second: int) -> int:
        """Return the first second that is told apart from one."""
        return (second // self.every + 1) * self.every

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        return BySecond(self._source.between(start_ns, end_ns))
