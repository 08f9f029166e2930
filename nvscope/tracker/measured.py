"""Measured: what figures are read from, the same for a stream, a list, a node on a list, and a bus."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:  # `explain` reads the table of figures, and starts without what these need
    from nvscope.tracker.can.bus import CanBusSummary
    from nvscope.tracker.diagnosis import Diagnosis
    from nvscope.tracker.intervals import IntervalFigures
    from nvscope.tracker.latency import LatencyFigures


class Measured(NamedTuple):
    """What was measured of one of them; None for what it has not, or what nobody knows of it.

    ``telegrams`` are its well-formed data telegrams, or its frames, ``remote`` the remote frames that asked for it on
    CAN; ``span_ns`` is how long it was watched.
    ``counters`` are by name. Of several streams, ``intervals`` and ``latency`` are those of all, ``jitter_percent`` is
    that of the worst. Without ``extremes``, nobody kept the least and the most of the window.
    """

    telegrams: int
    remote: int | None = None
    span_ns: int | None = None
    diagnosis: Diagnosis | None = None
    counters: Mapping[str, int | None] = MappingProxyType({})
    intervals: IntervalFigures | None = None
    jitter_percent: float | None = None
    latency: LatencyFigures | None = None
    bus: CanBusSummary | None = None
    extremes: bool = True

    @property
    def per_second(self) -> float | None:
        """How many telegrams or frames there were in a second; None where no time has passed."""
        return self.telegrams * 1_000_000_000 / self.span_ns if self.span_ns else None
