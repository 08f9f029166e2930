"""The clock of a stream: what time it is where packets are captured, as far as their coming tells.

The two clocks are a constant apart, and every packet is on its way for a while. What both make together, its *delay*,
is the time at which it came, by the steady clock here, less the time that it bears. Of what the capturing side has
taken up to a time of its own, everything has come when the packet with the longest delay would have: so time has passed
there up to *now less the longest delay*, and less ``SLACK_NS``, by which a packet may be later than any so far.

A writer with a buffer passes on packets in bursts. The first of a burst has waited for the others, so that its delay
holds back the time until the next burst is due: nobody is called silent whose packets lie in a buffer.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

SLACK_NS = 1_500_000_000
"""tcpdump's buffer in the kernel hands packets on up to a second late, some sooner; the rest is for the way."""

_FORGETS_NS = 60_000_000_000
_FEWEST = 8
_MOST = 4096


class StreamClock:
    """Tells how far time has passed in a stream by the packets that came, and by a clock that nobody can set."""

    def __init__(self, steady_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._steady_ns = steady_ns
        # When packets came, and their longest delay.
        self._delays: deque[tuple[int, int]] = deque(maxlen=_MOST)
        self._old_ns: int | None = None
        self._last_ns = 0

    def came(self, first_ns: int, last_ns: int, *, old: bool = False) -> None:
        """Note that packets came just now, whose earliest and latest times these are.

        ``old`` ones were there before anybody looked: when they came is unknown, and not later than now.
        """
        now_ns = self._steady_ns()
        self._last_ns = last_ns
        if old:
            self._old_ns = now_ns - last_ns
            return
        self._old_ns = None
        while len(self._delays) > _FEWEST and self._delays[0][0] < now_ns - _FORGETS_NS:
            self._delays.popleft()
        self._delays.append((now_ns, now_ns - first_ns))

    def until_ns(self) -> int | None:
        """Return up to when everything has come, in the time of the packets; None where these alone tell it."""
        longest_ns = self._old_ns
        if self._delays:
            longest_ns = max(delay_ns for _, delay_ns in self._delays)
        if longest_ns is None:
            return None
        until_ns = self._steady_ns() - longest_ns - SLACK_NS
        return until_ns if until_ns > self._last_ns else None
