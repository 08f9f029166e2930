"""Times of this machine's clock for frames of which a driver tells times of some clock.

A device counts from when it was plugged in, another machine has a clock of its own, and 32 bits of microseconds begin
anew every 72 minutes. Waits and other sources go by the clock of this machine.
"""

from __future__ import annotations

import math

from nvscope.capture.live.can.drivers import Clock
from nvscope.capture.time_span import TIME_LIMIT_NS

_SAME_NS = 1_000_000_000
"""A clock whose first time is so near is taken for that of this machine."""

_AWAY_NS = 5_000_000_000
"""A clock that is so far away from where it was has begun anew, or runs otherwise."""

_STEADY_NS = 60_000_000_000
"""A clock that has to be set again within this time is none."""


class BusClock:
    """Turns the times of one driver into times of this machine.

    The first one that is far from now is the anchor: that frame came now, and the others keep their distance to it, so
    that intervals are those that the driver measured. A clock that leaves its place is anchored anew; one that does so
    again within a minute is given up, and frames have the times at which they arrived.
    """

    def __init__(self, told: Clock) -> None:
        self._told = told
        self._offset_ns: int | None = None
        self._anchored_ns: int | None = None

    def ns(self, seconds: float, now_ns: int) -> int:
        """Return the time of a frame of which the driver says ``seconds``, and that arrived ``now_ns``."""
        if self._told is Clock.NONE or not math.isfinite(seconds) or seconds <= 0:
            return now_ns
        told_ns = nanoseconds(seconds)
        if self._told is Clock.SYSTEM:
            return told_ns if told_ns < TIME_LIMIT_NS else now_ns
        if self._offset_ns is None:
            self._offset_ns = 0 if abs(told_ns - now_ns) < _SAME_NS else now_ns - told_ns
        elif abs(told_ns + self._offset_ns - now_ns) > _AWAY_NS:
            if self._anchored_ns is not None and abs(now_ns - self._anchored_ns) < _STEADY_NS:
                self._told = Clock.NONE
                return now_ns
            self._offset_ns, self._anchored_ns = now_ns - told_ns, now_ns
        return told_ns + self._offset_ns


def nanoseconds(seconds: float) -> int:
    """Return seconds in nanoseconds, to the microsecond: a float of today's time holds no more."""
    whole = math.floor(seconds)
    # What is left is exact, so that it is rounded as where the number is written with six digits.
    return (whole * 1_000_000 + round((seconds - whole) * 1e6)) * 1000
