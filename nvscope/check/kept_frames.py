"""KeptFrames: the first frames of something, with their times, in whatever order they are told."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.event_kinds import FRAMES_KEPT


class KeptFrames:
    """The first ``FRAMES_KEPT`` frames that it was told, each with its time."""

    __slots__ = ("kept",)

    def __init__(self) -> None:
        self.kept: list[tuple[int, int]] = []

    def add(self, frame: I64, time_ns: I64) -> None:
        """Take frames, which may be any."""
        if len(self.kept) == FRAMES_KEPT:
            row = np.flatnonzero(frame < self.kept[-1][0])
            frame, time_ns = frame[row], time_ns[row]
        first = np.argsort(frame, kind="stable")[:FRAMES_KEPT]
        self.kept = first_of([self.kept, zip(frame[first].tolist(), time_ns[first].tolist(), strict=True)])


def first_of(several: Iterable[Iterable[tuple[int, int]]]) -> list[tuple[int, int]]:
    """Return the first frames of several sequences of them."""
    return sorted(one for each in several for one in each)[:FRAMES_KEPT]


def frames_of(kept: Sequence[tuple[int, int]]) -> tuple[int, ...]:
    """Return the numbers alone, each once."""
    return tuple(dict.fromkeys(frame for frame, _ in kept))
