"""A source cut at each second of its own time, so that it can be looked at a second at a time."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

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
    """

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
            edges = [0, *(np.flatnonzero(np.diff(second)) + 1).tolist(), len(batch)]
            for begin, end in pairwise(edges):
                now_s = int(second[begin])
                if over_s is not None:
                    for passed_s in range(max(over_s, now_s - _MOST_SILENT_S), now_s):
                        yield PacketBatch.nothing((passed_s + 1) * _S_NS - 1)
                over_s = now_s
                yield batch[begin:end]

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        return BySecond(self._source.between(start_ns, end_ns))
