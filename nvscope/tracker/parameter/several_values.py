"""Writes of several values that have the same key while they are open: no repetitions, but writes of their own.

Replies do not say which value they are about. They close such writes in the order in which these were asked for, so
that as many are left open as lack a reply; but what came of each of them nobody knows.
"""

from __future__ import annotations

from itertools import groupby

import numpy as np

from dissectors.batch import I64, Bool

MOST_VALUES = 64
"""So many values of one key are told apart at the same time; a further one counts as a repetition of the last."""


def several_values(group: I64, writes: Bool, value: I64) -> I64:
    """Return the rows of groups, which rise, whose write requests have several values."""
    rows = np.flatnonzero(writes)
    differs = (group[rows][1:] == group[rows][:-1]) & (value[rows][1:] != value[rows][:-1])
    if not differs.any():
        return rows[:0]
    return np.flatnonzero(np.isin(group, group[rows[1:][differs]]))


def told_apart(
    group: I64, age: I64, is_request: Bool, value: I64, packet: I64, late: I64, unsure: I64
) -> tuple[I64, I64]:  # fmt: skip
    """Return the value of the transaction that each row is part of, and ``unsure`` as far as it is known now.

    Rows of a group are in the order of the capture by their ``age``. ``late`` is the packet that shows that a request
    has waited too long. ``unsure`` is of the first request of each transaction.
    """
    stream, unsure = value.copy(), unsure.copy()
    order = np.lexsort((age, group))
    columns = (column[order].tolist() for column in (group, is_request, value, packet, late))
    for _, rows in groupby(zip(order.tolist(), *columns, strict=True), key=lambda row: row[1]):
        open_writes: dict[int, tuple[int, int]] = {}  # By value: when it is late, and the row of the first request.
        for row, _, asks, said, at, behind in rows:
            if any(end <= at for end, _ in open_writes.values()):
                open_writes = {one: wait for one, wait in open_writes.items() if wait[0] > at}
            if asks:
                own = said
                if own not in open_writes and len(open_writes) >= MOST_VALUES:
                    own = next(reversed(open_writes))
                open_writes[own] = behind, open_writes.get(own, (0, row))[1]
                stream[row] = own
            elif open_writes:
                own = next(iter(open_writes))
                head = open_writes.pop(own)[1]
                others = [first for _, first in open_writes.values()]
                if others:
                    unsure[[head, *others]] = 1
                stream[row] = own
    return stream, unsure
