"""Questions: who asks by ARP for whom again and again, which is how a sender looks for a reader that is gone."""

from __future__ import annotations

import numpy as np

from dissectors.addresses import FrameAddresses
from dissectors.batch import I64, U64
from dissectors.keys import KeyTable
from nvscope.engine.runs import runs_of, stable_order
from nvscope.tracker.evidence.signs import SignsOfLife

CLOSE_NS = 1_500_000_000
"""Who gets no answer asks again after a second; questions further apart than this are asked for other reasons."""

LASTING_NS = 1_900_000_000
"""Questions that go on for so long, which are three at least, got no answer."""

_NEVER = np.iinfo(np.int64).min


class Questions:
    """Spans of time in which an address asked for another, by ``pairs`` (lower halves of the IPv4 addresses of both).

    ``left_out`` counts the questions of pairs for which there was no room.
    """

    def __init__(self, most_pairs: int, most_spans: int) -> None:
        self._most = most_pairs
        self.pairs, self.spans = KeyTable(2), SignsOfLife(most_spans, CLOSE_NS)
        self._last_ns: I64 = np.empty(0, np.int64)
        self.left_out = 0

    def observe(self, found: FrameAddresses, time_ns: I64) -> None:
        """Take frames, which follow those observed so far, with their times."""
        asks = np.flatnonzero(found.sought)
        if not len(asks):
            return
        number = self.pairs.numbers_within(self._most, found.low[asks], found.sought[asks])
        known = number >= 0
        self.left_out += len(asks) - int(known.sum())
        number, time_ns = number[known], time_ns[asks[known]]
        order = stable_order(number, len(self.pairs))
        number, time_ns = number[order], time_ns[order]
        start, stop = runs_of(number)
        new = np.full(len(self.pairs) - len(self._last_ns), _NEVER)
        self._last_ns = np.append(self._last_ns, new)
        before_ns = np.roll(time_ns, 1)
        before_ns[start] = self._last_ns[number[start]]
        self._last_ns[number[start]] = time_ns[stop - 1]
        self.spans.observe(number, time_ns, before_ns, len(self.pairs))

    def begin_anew(self) -> None:
        """Let no span go on: nobody has listened for a while."""
        self._last_ns[:] = _NEVER

    def unanswered(self) -> tuple[U64, U64, I64, I64]:
        """Return who asked for whom in vain, from when to when; all of shape (n,), by beginning of those of a pair."""
        columns = self.spans.columns
        since_ns, until_ns = columns.column("since_ns"), columns.column("until_ns")
        lasting = np.flatnonzero(until_ns - since_ns >= LASTING_NS)
        asker, sought = (word[columns.column("address")[lasting]] for word in self.pairs.words)
        return asker, sought, since_ns[lasting], until_ns[lasting]
