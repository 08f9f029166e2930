"""Stretches: for how long something is so, at one time after the other, however the times are cut into batches."""

from __future__ import annotations

from copy import copy

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.tracker.event_kinds import FRAMES_KEPT


class Stretches:
    """The stretches in which something is so: the longest one, how many are longer than a limit, and the first frames.

    A stretch begins at a time at which it is so, and was not before, or begins anew; it ends at the first time at which
    it is not so, or begins anew, or with the end. ``frames`` are those with which the first ones began that are longer
    than the limit, ``first_ns`` is when the first one of them did.
    """

    def __init__(self, limit_ns: int) -> None:
        self._limit_ns = limit_ns
        self._since_ns: int | None = None
        self._frame = 0
        self.longest_ns: int | None = None
        self.count = 0
        self.first_ns: int | None = None
        self.frames: list[int] = []

    def take(self, time_ns: I64, frame: I64, so: Bool, anew: Bool | None = None) -> None:
        """Take times, which follow those before and never step back; ``anew``: what is so there is a new stretch."""
        if not len(so):
            return
        before = np.append(self._since_ns is not None, so[:-1])
        breaks = ~so if anew is None else ~so | anew
        begin = np.flatnonzero(so & (~before if anew is None else ~before | anew))
        end = np.flatnonzero(breaks & before)
        if self._since_ns is not None and len(end):
            self._add(np.array([self._since_ns]), np.array([self._frame]), time_ns[end[:1]])
            self._since_ns = None
            end = end[1:]
        ended = begin[: len(end)]
        self._add(time_ns[ended], frame[ended], time_ns[end])
        if len(begin) > len(end):
            self._since_ns, self._frame = int(time_ns[begin[-1]]), int(frame[begin[-1]])

    def copied(self) -> Stretches:
        """Return a copy that goes on by itself."""
        found = copy(self)
        found.frames = list(self.frames)
        return found

    def up_to(self, until_ns: int) -> Stretches:
        """Return what it would be if what is so ended with a time; this one goes on."""
        found = self.copied()
        found.end(until_ns)
        return found

    def end(self, until_ns: int) -> None:
        """Let what is so end with a time; what follows begins anew."""
        if self._since_ns is not None:
            self._add(np.array([self._since_ns]), np.array([self._frame]), np.array([max(until_ns, self._since_ns)]))
            self._since_ns = None

    def _add(self, begin_ns: I64, frame: I64, end_ns: I64) -> None:
        if not len(begin_ns):
            return
        length_ns = end_ns - begin_ns
        longest_ns = int(length_ns.max())
        self.longest_ns = longest_ns if self.longest_ns is None else max(self.longest_ns, longest_ns)
        # Where the limit is 0, what was so at all is longer, also if nothing came after it.
        over = np.flatnonzero(length_ns > self._limit_ns if self._limit_ns else length_ns >= 0)
        self.count += len(over)
        if len(over):
            self.first_ns = int(begin_ns[over[0]]) if self.first_ns is None else self.first_ns
            self.frames += frame[over[: FRAMES_KEPT - len(self.frames)]].tolist()
