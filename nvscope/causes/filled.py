"""Gaps in Counters that overtaken telegrams filled, or a part of them: what was lost in the end."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64
from nvscope.engine.runs import rows_by
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.event_columns import EventTable
from nvscope.tracker.steps import WINDOW


def lost_in_the_end(steps: EventTable) -> I64:
    """Return how many are missing of each step that is a gap, the amounts of all others as they are; shape (n,).

    ``steps`` are in the order of frames. An overtaken telegram fills the last gap of its stream that has room, of as
    many as a Counter may be behind.
    """
    amount = steps.amount.copy()
    if not (steps.kind == EventKind.OVERTAKEN).any():
        return amount
    rows = np.flatnonzero((steps.kind == EventKind.GAP) | (steps.kind == EventKind.OVERTAKEN))
    for _, places in rows_by([column[rows] for column in (steps.list, steps.node, steps.subindex, steps.scope)]):
        own = rows[places]
        is_gap = steps.kind[own] == EventKind.GAP
        gaps, before = own[is_gap], np.cumsum(is_gap)[~is_gap]
        left = amount[gaps].tolist()
        for known in before.tolist():
            for place in range(known - 1, max(known - WINDOW, 0) - 1, -1):
                if left[place]:
                    left[place] -= 1
                    break
        amount[gaps] = left
    return amount
