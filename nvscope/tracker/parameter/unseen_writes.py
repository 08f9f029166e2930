"""Writes of which nothing but the reply was captured."""

from __future__ import annotations

import numpy as np

from dissectors.keys import KeyTable, first_rows_from
from nvscope.tracker.parameter.matching import Messages

MOST_REQUESTS = 1 << 18
"""So many requests to write are remembered, by their pair, parameter and Counter; of more, replies may be to others."""


class UnseenWrites:
    """Tells replies to writes that come late, or again, from those whose request nobody saw."""

    def __init__(self) -> None:
        self._asked = KeyTable()

    def of(self, asked: Messages, stray: Messages) -> Messages:
        """Return replies whose requests were not seen up to them.

        ``asked`` are the writes asked for in a batch, ``stray`` the replies to writes in it that end none.
        """
        before = len(self._asked)
        number = self._asked.numbers_within(MOST_REQUESTS, asked.pair.view(np.uint64), asked.word.view(np.uint64))
        if not len(stray):
            return stray
        since = np.full(len(self._asked) + 1, -1)  # The last one is of what has no number.
        since[before:-1] = asked.packet[first_rows_from(number, before, len(self._asked))]
        found = self._asked.find(stray.pair.view(np.uint64), stray.word.view(np.uint64))
        return stray.take((found < 0) | (since[found] >= stray.packet))
