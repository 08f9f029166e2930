"""Counters that are written byte-swapped: which steps are +1 in the other byte order, and when that is told."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dissectors.batch import I64, U16, Bool
from nvscope.tracker.steps import Step, Steps

_SWAPPED_PERCENT = 90
_LEAST_SWAPPED = 100


def byte_swapped(steps: I64, regular: I64, swapped: I64) -> Bool:
    """Tell which Counters that do not count are written byte-swapped: nearly all steps are +1 in one byte order.

    ``regular`` are so in the right one, ``swapped`` in the other one only; those are most of the ``steps`` that are not
    regular. A public sender writes the values from 128 on that way.
    """
    nearly_all = 100 * (regular + swapped) >= _SWAPPED_PERCENT * steps
    return nearly_all & (2 * swapped > steps - regular) & (swapped >= _LEAST_SWAPPED)


def swapped_steps(steps: Steps, places: I64, start: I64, last: U16, counter_at: Callable[[I64], U16]) -> I64:
    """Return, of each step that is +1 once the bytes of both counters are swapped, the sequence that takes it.

    Looked at are the steps at some places, rising. ``start`` is where each sequence begins, ``last`` the counter in
    front of that; ``counter_at`` those at places.
    """
    place: I64 = places[steps.step[places] >= Step.OVERTAKEN]
    if not len(place):
        return place
    sequence = np.searchsorted(start, place, "right") - 1
    begins = start[sequence] == place
    # Swapped, +1 is +0x0100, or +0x0101 at a wrap; unsure is it where steps are not from the counter in front.
    before = steps.step[place - 1]
    unsure = begins | (before == Step.LATE) | (before == Step.OVERTAKEN) | (before == Step.NONE)
    likely = unsure | (steps.distance[place] & 0xFFFE == 0x0100)
    place, sequence, begins = place[likely], sequence[likely], begins[likely]
    before = np.where(begins, last[sequence], counter_at(place - 1))
    found: I64 = sequence[counter_at(place).byteswap() - before.byteswap() == 1]
    return found
