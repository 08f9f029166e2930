"""Rows without any value that a task lacks between its own: whose such a row is stands nowhere.

A task that has a row in each of its cycles lacks none of them. How long a cycle is, its last rows tell that have no
such row between them.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64

_LAST = 9
"""The cycle is the median of so many intervals."""

_MOST_EARLY = 10_000


class LackingRows:
    """Counts them as rows come; however these are cut, it is the same."""

    def __init__(self) -> None:
        self._counted = 0
        self._clean: I64 = np.zeros(0, np.int64)
        self._last_ns: int | None = None
        self._blank = 0
        """How many have come since the last own row, when the first of them came, and when the last one."""
        self._blank_first_ns = self._blank_last_ns = 0
        self._early: list[tuple[I64, I64]] = []
        """Intervals in front of the first that has no such row in it, and how many are in each; not too many."""
        self._early_count = 0
        self._in_front: tuple[int, int] | None = None
        """How long and how many they came in front of the first own row, until it is known how long a cycle is."""

    @property
    def count(self) -> int:
        """How many so far; where nobody knows how long a cycle is, all of them."""
        found = self._counted + sum(int(blanks.sum()) for _, blanks in self._early)
        cycle_ns = self._cycle_ns(self._clean)
        if self._in_front is not None:
            length_ns, count = self._in_front
            found += _fitting(length_ns, cycle_ns, count)
        if self._blank:
            since_ns = self._blank_first_ns - (cycle_ns or 0) if self._last_ns is None else self._last_ns
            found += _fitting(self._blank_last_ns - since_ns, cycle_ns, self._blank)
        return found

    def take(self, time_ns: I64, own: I64, blank: I64) -> None:
        """Take rows with their times: which are its own, and which have no value."""
        if not len(own):
            self._take_blank(time_ns, blank)
            return
        times = time_ns[own]
        blanks = np.bincount(np.searchsorted(own, blank), minlength=len(own) + 1)
        blanks[0] += self._blank
        if self._last_ns is None:
            if blanks[0]:
                first_ns = self._blank_first_ns if self._blank else int(time_ns[blank[0]])
                self._in_front = int(times[0]) - first_ns, int(blanks[0])
            length_ns, between = np.diff(times), blanks[1:-1]
        else:
            length_ns, between = np.diff(times, prepend=self._last_ns), blanks[:-1]
        self._take_intervals(length_ns, between)
        self._last_ns, self._blank = int(times[-1]), 0
        self._take_blank(time_ns, blank[len(blank) - int(blanks[-1]) :])

    def _take_blank(self, time_ns: I64, blank: I64) -> None:
        if len(blank):
            if not self._blank:
                self._blank_first_ns = int(time_ns[blank[0]])
            self._blank_last_ns = int(time_ns[blank[-1]])
            self._blank += len(blank)

    def _take_intervals(self, length_ns: I64, blanks: I64) -> None:
        """Take intervals between its own rows, and how many others are in each."""
        is_clean = blanks == 0
        clean = np.concatenate([self._clean, length_ns[is_clean]])
        places = np.flatnonzero(~is_clean)
        if len(places):
            behind = len(self._clean) + np.cumsum(is_clean)[places]
            early = places[behind == 0]
            if len(early):
                self._keep(length_ns[early], blanks[early])
            places, behind = places[behind > 0], behind[behind > 0]
            number = behind[:, np.newaxis] - _LAST + np.arange(_LAST)
            known = number >= 0
            window = np.where(known, clean[np.where(known, number, 0)], np.iinfo(np.int64).max)
            middle = (known.sum(axis=1) - 1) // 2
            cycle_ns = np.sort(window, axis=1)[np.arange(len(places)), middle]
            self._counted += _between(length_ns[places], blanks[places], cycle_ns)
        if len(clean):
            self._settle(int(clean[0]))
        self._clean = clean[-_LAST:]

    def _keep(self, length_ns: I64, blanks: I64) -> None:
        """Keep intervals until it is known how long a cycle is."""
        some = max(_MOST_EARLY - self._early_count, 0)
        self._early.append((length_ns[:some], blanks[:some]))
        self._early_count += len(blanks[:some])
        self._counted += int(blanks[some:].sum())

    def _settle(self, cycle_ns: int) -> None:
        """Count what came before it was known how long a cycle is."""
        for length_ns, blanks in self._early:
            self._counted += _between(length_ns, blanks, np.full(len(blanks), cycle_ns))
        self._early.clear()
        if self._in_front is not None:
            front_ns, count = self._in_front
            self._counted += _fitting(front_ns, cycle_ns, count)
            self._in_front = None

    @staticmethod
    def _cycle_ns(clean: I64) -> int | None:
        return int(np.sort(clean)[(len(clean) - 1) // 2]) if len(clean) else None


def _between(length_ns: I64, blanks: I64, cycle_ns: I64) -> int:
    """Return how many rows lack in intervals between two rows, ``blanks`` of each at most."""
    fitting = np.round(length_ns / np.where(cycle_ns > 0, cycle_ns, 1)).astype(np.int64) - 1
    return int(np.where(cycle_ns > 0, np.clip(fitting, 0, blanks), blanks).sum())


def _fitting(length_ns: int, cycle_ns: int | None, most: int) -> int:
    """Return how many cycles fit into a time, ``most`` at most, and where nobody knows how long one is."""
    return most if cycle_ns is None or cycle_ns <= 0 else min(max(length_ns // cycle_ns, 0), most)
