"""OpenGaps: where telegrams are missing that may still come, late."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Generic, TypeVar

_MOST_GAPS = 64

Note = TypeVar("Note")
Place = tuple[int, int, int, int]
"""List, node, SubIndex and scope."""


class OpenGaps(Generic[Note]):
    """The last gaps of each place: how many telegrams are still missing in them, each with a note of whoever asks."""

    def __init__(self) -> None:
        self._gaps: dict[Place, deque[tuple[int, Note]]] = {}

    def add(self, place: Place, missing: int, note: Note) -> None:
        """Take that so many telegrams are missing, behind those that were."""
        self._gaps.setdefault(place, deque(maxlen=_MOST_GAPS)).append((missing, note))

    def take_back(self, place: Place, came: int) -> Iterator[tuple[int, Note]]:
        """Yield how many of so many that came late were missing in which gap, the last one first; they no more are."""
        gaps = self._gaps.get(place) or deque()
        for at in reversed(range(len(gaps))):
            missing, note = gaps[at]
            if back := min(came, missing):
                came -= back
                gaps[at] = missing - back, note
                yield back, note

    def clear(self) -> None:
        """Forget all of them: what was missing comes no more."""
        self._gaps.clear()
