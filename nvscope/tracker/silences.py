"""Silences: how long streams had been silent when nobody listened to them any more, though others were listened to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64


class Silence(NamedTuple):
    """A silence of a stream: from its last telegram, which was the frame ``frame``, to the end of who listened."""

    since_ns: int
    until_ns: int
    frame: int

    @property
    def length_ns(self) -> int:
        """How long it was."""
        return self.until_ns - self.since_ns


class Silences:
    """Silences in the order in which they ended; there are fewer than telegrams."""

    def __init__(self) -> None:
        self._parts: list[tuple[I64, I64, I64, I64]] = []

    def add(self, stream: I64, since_ns: I64, frame: I64, until_ns: int) -> None:
        """Take the silences of some streams that ended together. Shapes (n,)."""
        if len(stream):
            self._parts.append((stream, since_ns, np.full(len(stream), until_ns), frame))

    def take(self, part: Silences) -> None:
        """Take over those of other streams."""
        self._parts += part._parts

    def by_stream(self) -> dict[int, list[Silence]]:
        """Return the silences of each stream that had some, in their order."""
        found: dict[int, list[Silence]] = {}
        for part in self._parts:
            for stream, *silence in zip(*(column.tolist() for column in part), strict=True):
                found.setdefault(stream, []).append(Silence(*silence))
        return found
