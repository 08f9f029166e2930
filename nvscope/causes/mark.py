"""Mark: what a list did in a stretch of time, as the strips of reports show it."""

from __future__ import annotations

from enum import IntEnum


class Mark(IntEnum):
    """What a list did in a stretch of time; of several, the highest one is told (causes.md, section 4)."""

    USUAL = 0
    SILENT = 1
    LATE = 2
    UNANSWERED = 3
    RESTARTED = 4
    SEVERAL_SENDERS = 5
    LOST = 6
