"""Which of several findings of one kind is the worst, where one of them is shown for all."""

from __future__ import annotations

from nvscope.findings.loss import COUNTER_ERRATIC, TELEGRAM_GAP
from nvscope.findings.timing import BURST, JITTER, LATE, STOPPED

EXTENTS = {
    TELEGRAM_GAP.code: "telegrams or sends lost",
    COUNTER_ERRATIC.code: "counters that would be lost",
    LATE.code: "the longest interval in ns",
    JITTER.code: "the jitter in percent",
    BURST.code: "the shortest interval in ns",
    STOPPED.code: "the silence in ns",
}
"""What the ``extent`` of a finding is, by code: how bad it is. All others are as bad as they are often."""

_LEAST_IS_WORST = {BURST.code}


def badness(code: str, extent: float | None, count: int) -> float:
    """Return a number that is larger the worse a finding of a kind is; ``count`` is how many events it has."""
    if extent is None:
        return count
    return -extent if code in _LEAST_IS_WORST else extent
