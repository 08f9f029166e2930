"""Gaps in Counters that overtaken telegrams filled, or a part of them: what was lost in the end."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.event_columns import EventTable
from nvscope.tracker.steps import WINDOW


def lost_in_the_end(steps: EventTable) -> I64:
    """Return how many are missing of each step that is a gap, the amounts of all others as they are; shape (n,).

    ``steps`` are in the order of frames. An overtaken telegram fills the last gap of its stream that has room.
    """
    amount = steps.amount.copy()
    overtaken = np.flatnonzero(steps.kind == EventKind.OVERTAKEN)
    if not len(overtaken):
        return amount
    rows = np.flatnonzero((steps.kind == EventKind.GAP) | (steps.kind == EventKind.OVERTAKEN))
    columns = (column[rows].tolist() for column in (steps.list, steps.node, steps.subindex, steps.scope))
    is_gap, left = (steps.kind[rows] == EventKind.GAP).tolist(), amount[rows].tolist()
    gaps: dict[tuple[int, ...], list[int]] = defaultdict(list)
    for place, sequence in enumerate(zip(*columns, strict=True)):
        own = gaps[sequence]
        if is_gap[place]:
            own.append(place)
            if len(own) > 2 * WINDOW:
                del own[:-WINDOW]  # what is further behind is filled no more
            continue
        del own[:-WINDOW]
        while own and not left[own[-1]]:
            own.pop()
        if own:
            left[own[-1]] -= 1
    amount[rows] = left
    return amount
