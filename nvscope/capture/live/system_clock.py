"""The clock of the system while a source is watched: how often somebody set it."""

from __future__ import annotations

import time
from collections.abc import Callable

_STEP_NS = 1_000_000
_QUICK_NS = 200_000
_TRIES = 5


class SystemClock:
    """Compares the time of day with a clock that nobody can set.

    ``steps`` counts how often the time of day was set by more than a millisecond since the first look; a clock that is
    slowly drawn to another one (NTP) takes no step.
    """

    def __init__(
        self, now_ns: Callable[[], int] = time.time_ns, steady_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self.steps = 0
        self._now_ns, self._steady_ns = now_ns, steady_ns
        self._apart_ns = self._measured_ns()

    def look(self) -> int:
        """Return the time of day in nanoseconds, and count a step since the last look, if there was one."""
        apart_ns = self._measured_ns()
        if abs(apart_ns - self._apart_ns) > _STEP_NS:
            self.steps += 1
        self._apart_ns = apart_ns
        return self._now_ns()

    def _measured_ns(self) -> int:
        """Return how far the time of day is from the steady clock; of some looks, the least interrupted one."""
        best_ns, best = 1 << 62, 0
        for _ in range(_TRIES):
            before_ns = self._steady_ns()
            now_ns = self._now_ns()
            took_ns = self._steady_ns() - before_ns
            if took_ns < best_ns:
                best_ns, best = took_ns, now_ns - before_ns
            if took_ns < _QUICK_NS:
                break
        return best
