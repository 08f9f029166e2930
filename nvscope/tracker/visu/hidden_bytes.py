"""Hidden bytes: those that are missing of clients over connections that show no request of a page.

They may have been requests: where another connection from the same client to the same server and port shows one of a
page, be it earlier or later, they count as missing ones of that page. Until then they wait. Of all others nobody knows
anything that would make them a page's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U64, Bool
from nvscope.tracker.visu.limits import MOST_PAIRS
from nvscope.tracker.visu.messages import Kind
from nvscope.tracker.visu.plain_exchanges import Said


class Shown(NamedTuple):
    """What is told of a batch: which of it, with so many missing bytes each, as so many messages."""

    stays: Bool
    kind: I64
    gap_bytes: I64


class HiddenBytes:
    """Those that wait, by client, server and port; ``left_out`` are those for which there was no room."""

    def __init__(self) -> None:
        self._held: dict[tuple[int, ...], int] = {}
        self._is_page = np.zeros(0, np.bool_)
        self.left_out = 0

    def told(self, said: Said, pair: I64, words_of: Callable[[I64], Sequence[U64]]) -> Shown:
        """Return what is told of what is ``said``, in its order.

        ``pair`` are the numbers of client, server and port, -1 of those that show nothing; ``words_of`` returns these
        themselves of connections.
        """
        stays, kind, gap_bytes = np.ones(len(said), np.bool_), said.kind, said.gap_bytes
        known = len(self._is_page)
        most = int(pair.max(initial=-1)) + 1
        if most > known:
            self._is_page = np.append(self._is_page, np.zeros(max(most, 2 * known) - known, np.bool_))
        opens = np.flatnonzero(said.opens & (pair >= 0))
        hidden = np.flatnonzero(kind == Kind.HIDDEN)
        if not (len(hidden) or self._held):
            self._is_page[pair[opens]] = True
            return Shown(stays, kind, gap_bytes)
        kind, gap_bytes, words = kind.copy(), gap_bytes.copy(), words_of(said.connection)
        new = opens[~self._is_page[pair[opens]]]
        for place in np.sort(np.append(new, hidden)).tolist():
            number, key = int(pair[place]), tuple(int(word[place]) for word in words)
            if kind[place] != Kind.HIDDEN:
                self._is_page[number] = True
                gap_bytes[place] += self._held.pop(key, 0)
            elif number >= 0 and self._is_page[number]:
                kind[place] = int(Kind.GAP)
            else:
                stays[place] = False
                self._hold(key, int(gap_bytes[place]))
        return Shown(stays, kind, gap_bytes)

    def are_pages(self, pair: I64) -> Bool:
        """Tell of numbers of pairs, -1 of those that have none, which ones show a request of a page."""
        known: Bool = (pair >= 0) & (pair < len(self._is_page))
        known[known] = self._is_page[pair[known]]
        return known

    def _hold(self, key: tuple[int, ...], size: int) -> None:
        if key in self._held or len(self._held) < MOST_PAIRS:
            self._held[key] = self._held.get(key, 0) + size
        else:
            self.left_out += 1
