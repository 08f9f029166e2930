"""One clock for all that is sent: when each packet is due, and how late it was."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from msgspec import Struct

_SHORTEST_NS, _LONGEST_NS = 100_000, 100_000_000
_BUCKET_NS, _BUCKETS = 10_000, 100_000
_SKIPPED_NS = 1_000_000_000
"""A pause that is skipped lasts so long."""


class Timing(Struct, frozen=True):
    """How late packets were: half of them, 99 of a hundred, and the worst; None without any."""

    sent: int
    p50_ns: int | None = None
    p99_ns: int | None = None
    worst_ns: int | None = None


class Pace:
    """Says when packets are due: at the begin plus their time since the first one by ``rate``, so that nothing drifts.

    With ``skips_gaps``, a pause of more than a second lasts one.
    """

    def __init__(self, rate: float = 1.0, *, skips_gaps: bool = False) -> None:
        self._rate = rate
        self._skips = skips_gaps
        self._first_ns: int | None = None
        self._last_ns = 0
        self._skipped_ns = 0
        self._begin_ns = 0
        self._late = np.zeros(_BUCKETS + 1, np.int64)
        self._worst_ns = -1

    def due_ns(self, ts_ns: int) -> int:
        """Return when a packet of a time is due, by the monotonic clock; asked in the order of packets."""
        if self._first_ns is None:
            self._first_ns = self._last_ns = ts_ns
            self._begin_ns = time.monotonic_ns()
        if self._skips and ts_ns - self._last_ns > _SKIPPED_NS:
            self._skipped_ns += ts_ns - self._last_ns - _SKIPPED_NS
        self._last_ns = ts_ns
        return self._begin_ns + int((ts_ns - self._first_ns - self._skipped_ns) / self._rate)

    def wait_until(self, due_ns: int, is_stopped: Callable[[], bool]) -> bool:
        """Wait until something is due; return whether nobody has stopped it, which is asked ten times a second."""
        while (rest_ns := due_ns - time.monotonic_ns()) > 0:
            if is_stopped():
                return False
            time.sleep(min(max(rest_ns - _SHORTEST_NS, 0), _LONGEST_NS) / 1e9)
        return not is_stopped()

    def again(self) -> None:
        """Begin anew with the next packet, as if it were the first."""
        self._first_ns, self._skipped_ns = None, 0

    def was_sent(self, late_ns: int) -> None:
        """Take how late a packet was."""
        self._late[min(max(late_ns, 0) // _BUCKET_NS, _BUCKETS)] += 1
        self._worst_ns = max(self._worst_ns, late_ns)

    @property
    def timing(self) -> Timing:
        """How late packets were so far."""
        behind = np.cumsum(self._late)
        sent = int(behind[-1])
        if not sent:
            return Timing(0)
        p50, p99 = (int(np.searchsorted(behind, -(-sent * share // 100))) * _BUCKET_NS for share in (50, 99))
        return Timing(sent, min(p50, self._worst_ns), min(p99, self._worst_ns), max(self._worst_ns, 0))
