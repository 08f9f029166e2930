"""Spans of time that may overlap: how much time they take together, each moment of it once."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.datalogger.audit.sums import total

_WAITING = 100_000
"""So many spans are put together at a time: those that touch each other are one then."""


class Spans:
    """Spans, in bounded memory as long as most of them touch others."""

    def __init__(self) -> None:
        self._first: I64 = np.zeros(0, np.int64)
        self._last: I64 = np.zeros(0, np.int64)
        self._waiting: list[tuple[I64, I64]] = []
        self._waiting_count = 0

    def add(self, first_ns: I64, last_ns: I64) -> None:
        """Take some more, in any order; those that end before they begin are none."""
        there = last_ns > first_ns
        if there.any():
            self._waiting.append((first_ns[there], last_ns[there]))
            self._waiting_count += int(np.count_nonzero(there))
        if self._waiting_count > max(_WAITING, len(self._first)):
            self._put_together()

    def length_ns(self) -> int:
        """Return how much time they take."""
        self._put_together()
        return total(self._last - self._first)

    def length_with(self, other: Spans) -> int:
        """Return how much time they and others take together."""
        both = Spans()
        for one in (self, other):
            one._put_together()
            both.add(one._first, one._last)
        return both.length_ns()

    def _put_together(self) -> None:
        if not self._waiting:
            return
        first = np.concatenate([self._first, *(one for one, _ in self._waiting)])
        last = np.concatenate([self._last, *(one for _, one in self._waiting)])
        self._waiting, self._waiting_count = [], 0
        order = np.argsort(first, kind="stable")
        first, last = first[order], np.maximum.accumulate(last[order])
        begins: Bool = np.append(True, first[1:] > last[:-1])
        places = np.flatnonzero(begins)
        self._first, self._last = first[places], last[np.append(places[1:], len(first)) - 1]
