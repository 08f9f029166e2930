"""StreamSummary: what follows from a state for one stream."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from nvscope.tracker.counters import Scope
from nvscope.tracker.intervals import IntervalFigures


class StreamSummary(NamedTuple):
    """One stream: who sends which SubIndex, and what its counters and intervals say.

    ``scope`` is None where nobody knows what its sender counts, since the limit has left out other streams of it: then
    ``figures`` are None, unless its Counter never moved.

    ``byte_swapped``: nearly all steps of its Counter are +1 once its two bytes are swapped. ``erratic``: its counters
    are not believed, here or, of a window, in all that was seen up to its end.
    """

    stream: int
    node: int
    subindex: int
    telegrams: int
    first_ns: int
    last_ns: int
    scope: Scope | None
    counter_scope: str | None
    figures: Mapping[str, int | None]
    intervals: IntervalFigures
    items: int
    length: int
    checksum: int | None
    byte_swapped: bool = False
    erratic: bool = False

    @property
    def counters(self) -> dict[str, int | None]:
        """What is told of its ``figures``: the number of telegrams lost is unknown where the counters are erratic."""
        lost = self.figures["lost"]
        return {**self.figures, "lost": None if self.erratic else lost, "lost_claimed": lost}
