"""Steps of counters: what each telegram's Counter says about those before it (loss, overtaking, restarts).

``walk_one`` is the rule, one counter after the other; ``nvscope.tracker.sequence`` is the same for many at once.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

from msgspec import Struct

if TYPE_CHECKING:  # the kinds of steps are known without numpy
    from dissectors.batch import I64, U8, U16, U64

WINDOW = 64
"""A skipped counter counts as missing while it is at most this far behind: one bit each of a 64-bit word."""

LATE_FROM = 65536 - WINDOW
EARLY_WRAPS = (255, 65534)
"""Counters after which some senders go on with 0."""

_MASK = (1 << 64) - 1


class Step(IntEnum):
    """What a telegram does to a sequence of counters."""

    NONE = 0  # the first of its sequence: no step
    REGULAR = 1
    SAME = 2  # the current counter again, with other values: nothing, or regular, as the scope has it
    OVERTAKEN = 3
    LATE = 4  # a counter that was there before, or a repeated telegram, which takes no step
    RESTART = 5
    GAP = 6


# Plain integers: the loop below takes a third of the time with them.
_NONE, _REGULAR, _SAME, _OVERTAKEN, _LATE, _RESTART, _GAP = (int(step) for step in Step)
_MOVING = (_REGULAR, _GAP, _RESTART)


class Steps(Struct):
    """The steps of some sequences laid end to end.

    ``step`` uint8 (``Step``) and ``distance`` uint16 (counter less current counter, mod 65536) have one entry a
    telegram; a GAP of distance d has lost d − 1. ``current`` uint16 and ``missing`` uint64 have one entry a sequence,
    after its last step; bit i of ``missing`` stands for the counter i + 1 behind the current one. ``irregular`` are the
    places whose step is not REGULAR, rising.
    """

    step: U8
    distance: U16
    current: U16
    missing: U64
    irregular: I64

    def at(self, kind: Step) -> I64:
        """Return the places of the steps of a kind other than REGULAR, rising."""
        if len(self.irregular) * 8 > len(self.step):  # the faster way where many are not
            places: I64 = (self.step == kind).nonzero()[0]
        else:
            places = self.irregular[self.step[self.irregular] == kind]
        return places

    def distance_at(self, place: I64) -> U16:
        """Return the distances at some places."""
        distances: U16 = self.distance[place]
        return distances


def walk_one(counters: list[int], current: int | None, missing: int) -> tuple[list[int], list[int], int, int]:
    """Walk one sequence; return its steps, distances, and the current counter and missing word after them.

    ``current`` is None where the sequence begins with these counters, of which there must be at least one.
    """
    steps: list[int] = []
    distances: list[int] = []
    for counter in counters:
        if current is None:
            current = counter
            steps.append(_NONE)
            distances.append(0)
            continue
        distance = (counter - current) & 0xFFFF
        behind = 65536 - distance
        if distance == 1 or (counter == 0 and current in EARLY_WRAPS):
            step = _REGULAR
            missing = missing << distance & _MASK if distance <= WINDOW else 0
        elif distance == 0:
            step = _SAME
        elif behind <= WINDOW and missing >> (behind - 1) & 1:
            step = _OVERTAKEN
            missing &= ~(1 << (behind - 1))
        elif counter <= 1 and current < 65534:
            step = _RESTART
        elif distance < 32768:
            step = _GAP
            missing = (missing << distance | ((1 << (distance - 1)) - 1)) & _MASK if distance <= WINDOW else _MASK
        elif distance >= LATE_FROM:
            step = _LATE
        else:
            step = _RESTART
        if step == _RESTART:
            missing = 0
        if step in _MOVING:
            current = counter
        steps.append(step)
        distances.append(distance)
    assert current is not None
    return steps, distances, current, missing
