"""What a sender's Counter counts, and whether it counts at all."""

from __future__ import annotations

from enum import IntEnum


class Scope(IntEnum):
    """What a sender's Counter counts; of equal evidence, the earlier one."""

    STREAM = 0
    NODE_TELEGRAM = 1
    NODE_SEND = 2


SCOPE_NAMES = {Scope.STREAM: "stream", Scope.NODE_TELEGRAM: "node-telegram", Scope.NODE_SEND: "node-send"}
SCOPE_UNUSED = "unused"

_ERRATIC_FROM = 100
_ERRATIC_FACTOR = 10


def is_erratic(lost: int, telegrams: int, duration_ns: int, median_ns: int | None, *, swapped: bool) -> bool:
    """Tell whether a stream lost more counters than there was time to send: then the sender does not count telegrams.

    ``duration_ns`` is from its first telegram to its last, ``median_ns`` its median interval. One that is ``swapped``
    has lost none of them, however long it paused.
    """
    if lost <= telegrams:
        return False
    if swapped:
        return True
    if median_ns is None or median_ns <= 0:
        return lost > _ERRATIC_FROM
    absent_ns = max(0, duration_ns - telegrams * median_ns)
    return (lost - _ERRATIC_FROM) * median_ns > _ERRATIC_FACTOR * absent_ns
