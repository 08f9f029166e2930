"""Requests that were given up: a reply to one comes too late, which is another matter than one to nothing at all."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64
from dissectors.keys import KeyTable
from nvscope.tracker.parameter.matching import Messages, Open

MOST_REQUESTS = 1 << 18
"""So many requests are remembered, by their pair, parameter and Counter; of more, nobody knows it."""

_GIVEN_UP, _ANSWERED, _STRAY = range(3)


class GivenUp:
    """The requests that nobody answered in time, until one with the same key is answered."""

    def __init__(self) -> None:
        self._keys = KeyTable()
        self._since_ns = np.empty(0, np.int64)
        self._state = np.empty(0, np.int64)

    def since(self, late: Open, shown: I64, answered: Messages, stray: Messages) -> I64:
        """Return when what a reply is to was asked for, if that was given up; else when the reply came.

        All of it is of one batch: what was given up, the rows that show it, the replies that ended requests, and those
        that did not, whose times are returned.
        """
        since_ns = stray.time_ns.copy()
        before = len(self._keys)
        number = self._keys.numbers_within(MOST_REQUESTS, late.pair.view(np.uint64), late.word.view(np.uint64))
        grown = len(self._keys) - before
        self._since_ns = np.append(self._since_ns, np.zeros(grown, np.int64))
        self._state = np.append(self._state, np.full(grown, _ANSWERED))
        if not len(self._keys):
            return since_ns
        of_answers, of_strays = (
            self._keys.find(one.pair.view(np.uint64), one.word.view(np.uint64)) for one in (answered, stray)
        )
        numbers = np.concatenate([number, of_answers, of_strays])
        known = np.flatnonzero(numbers >= 0)
        kinds = np.repeat([_GIVEN_UP, _ANSWERED, _STRAY], [len(number), len(of_answers), len(of_strays)])
        rows = np.concatenate([shown, answered.packet, stray.packet])
        own = known[np.lexsort((known, kinds[known], rows[known], numbers[known]))]
        if not len(own):
            return since_ns
        numbers, kinds = numbers[own], kinds[own]
        asked_ns = np.concatenate([late.since_ns, np.zeros(len(answered) + len(stray), np.int64)])[own]
        begins = np.append(True, numbers[1:] != numbers[:-1])
        place = np.arange(len(own))
        first = np.maximum.accumulate(np.where(begins, place, 0))
        last = np.maximum.accumulate(np.where(kinds != _STRAY, place, 0))
        # In front of what the batch tells of a request stands what was known before.
        is_here = last >= first
        is_here &= kinds[last] != _STRAY
        state = np.where(is_here, kinds[last], self._state[numbers])
        asked_ns = np.where(is_here, asked_ns[last], self._since_ns[numbers])
        is_late = (kinds == _STRAY) & (state == _GIVEN_UP)
        since_ns[own[is_late] - len(number) - len(of_answers)] = asked_ns[is_late]
        ends = np.append(begins[1:], True)
        self._state[numbers[ends]], self._since_ns[numbers[ends]] = state[ends], asked_ns[ends]
        return since_ns
